"""The table of regions: what a prototype of the method reached is reached, exactly, where systems are comparable."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product

import cvxpy
import numpy as np
import pytest
from systems_table import SYSTEMS, Entry, main, measured, periods, share_of

from reference.released_systems import changed, released

SMALLER = {"boost-constant-power": 0.685}
"""Whose parameters here are harder than they can have been there: no law of this form has more, and what it can have;
the bound of the closed loop's speed in the table costs some of it."""


def most_of(entry: Entry) -> float:
    """An upper bound of the share that any law ``u = K(x) x`` has with one quadratic V, whatever its premises: the
    inequalities at the corners of the box only, a gain of its own at each, by another solver."""
    system = entry.system()
    bounds = np.array([max(abs(end) for end in interval) for interval in system.domain.values()])
    limit, slow = np.array(list(entry.limits.values())), 1e-3
    P = cvxpy.Variable((system.order, system.order), symmetric=True)
    asked = [P[k, k] <= 1 for k in range(system.order)]
    for corner in product((-1, 1), repeat=system.order):
        E, A, B, _C = system.evaluate(system.premise_values(bounds * corner, {}))
        drift, force = (slow * np.linalg.solve(E * bounds, X) for X in (A * bounds, B * limit))
        M = cvxpy.Variable((len(limit), system.order))
        rate = drift @ P + force @ M
        asked += [
            rate + rate.T + 2 * slow * entry.decay_rate * P << 0,
            cvxpy.bmat([[np.eye(len(limit)), M], [M.T, P]]) >> 0,
        ]
    cvxpy.Problem(cvxpy.Maximize(cvxpy.log_det(P)), asked).solve(solver=cvxpy.CLARABEL)
    return float(math.pi / 4 * np.sqrt(np.linalg.det(P.value)))


def test_no_law_with_one_quadratic_function_reaches_the_prototype_where_the_table_does_not() -> None:
    for name, most in SMALLER.items():
        assert most_of(SYSTEMS[name]) == pytest.approx(most, abs=1e-3)
        assert most < SYSTEMS[name].share
    # The bound is none of every system: without the load of constant power a ball fits.
    assert most_of(SYSTEMS["boost"]) == pytest.approx(math.pi / 4, abs=1e-3)


@pytest.mark.full
def test_without_a_bound_of_the_speed_nearly_all_of_that_is_reached() -> None:
    for name, most in SMALLER.items():
        share = measured(replace(SYSTEMS[name], speed=None)).share
        assert 0.96 * most < share <= most


@pytest.mark.full
@pytest.mark.parametrize("name", SYSTEMS)
def test_share_and_half_the_period_of_a_prototype_are_reached_and_verified(name: str) -> None:
    row = measured(SYSTEMS[name])
    assert row.verified
    least = 0.92 * SMALLER[name] if name in SMALLER else SYSTEMS[name].share
    assert row.share >= least - 5e-4
    euler, sharper = periods(row.artifact)
    assert sharper >= euler >= 0.5 * (SYSTEMS[name].period_s or 0.0)


def test_a_region_that_touches_its_box_fills_what_a_disc_fills() -> None:
    row = measured(SYSTEMS["two-tanks"])
    assert row.verified
    assert math.pi / 4 * 0.998 < row.share < math.pi / 4
    assert row.seconds < 5.0


def test_the_share_counts_bounded_states_only() -> None:
    artifact = released("two-tanks")
    signals = artifact.content()["signals"]
    signals[1] = {**signals[1], "low": None, "high": None}
    P = artifact.region.lyapunov
    assert share_of(changed(artifact, signals=signals)) == pytest.approx(math.sqrt(P[0][0]) / 0.15)


def test_a_system_that_is_not_in_the_table_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--system", "nothing"])
    assert "two-tanks" in capsys.readouterr().err
