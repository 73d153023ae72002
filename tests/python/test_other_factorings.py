"""A question about equations is a question about all their factorings."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

import quasilpv as ql
from quasilpv.lmi.budget import Limits, time_left_s
from quasilpv.studies.answer import Answer
from quasilpv.studies.other_factorings import with_other_factorings
from quasilpv.systems.descriptor import DescriptorSystem
from test_systems_factorings import tora


def test_tora_is_feasible_with_the_factoring_by_its_angle() -> None:
    """Checked on the nonlinear equations: they contract towards 0 from inside the domain as the law's P says."""
    answer = ql.solve(tora(), "I.2", decay_rate=0.01)
    assert answer.headline == "feasible, proved"
    assert answer.reason.startswith("with another factoring of A(x) x: a solution satisfies")
    assert "z2 = x4**2*sinc(x3)" in answer.factoring
    law = answer.law
    assert law is not None
    for x in np.random.default_rng(5).uniform(-1, 1, (200, 4)):
        cosine, rate = np.cos(x[2]), x[3] ** 2 * np.sinc(x[2] / np.pi)
        E = np.eye(4)
        E[1, 3] = E[3, 1] = 0.2 * cosine
        A = np.array([[0, 1, 0, 0], [-1, 0, 0.2 * rate, 0], [0, 0, 0, 1], [0, 0, 0, 0.0]])
        closed = np.linalg.solve(E, A + np.array([[0], [0], [0], [1]]) @ law.gain([cosine, rate]))
        assert np.linalg.eigvals(closed).real.max() < -0.01


def test_matrices_are_meant_as_they_are_given() -> None:
    given = replace(tora(), from_formulas=False)
    answer = ql.solve(given, "guerra-2007", decay_rate=0.01)
    assert answer.headline == "infeasible, numerically"
    assert "factoring" not in answer.reason


def test_a_refutation_at_the_origin_concerns_every_factoring() -> None:
    """``y' = (1 + x y) y`` is linearised to ``y' = y``, which no input reaches, in every factoring."""
    model = DescriptorSystem.from_equations(
        ["x' = x*y + u", "y' = y + x*y**2"], state="x y", inputs="u", domain={"x": (-1, 1), "y": (-1, 1)}
    )
    answer = ql.solve(model, "guerra-2007")
    assert answer.headline == "infeasible, proved"
    assert "factoring" not in answer.reason


def test_a_refutation_elsewhere_concerns_one_factoring() -> None:
    """``(-1 + 2 x) y`` has a mode at x = 1 that grows and that no input reaches; ``-y + (2 y) x`` has none."""
    equations, domain = ["x' = u", "y' = -y + 2*y*x"], {"x": (-1, 1), "y": (-1, 1)}
    model = DescriptorSystem.from_equations(equations, state="x y", inputs="u", domain=domain)
    first = ql.solve(replace(model, from_formulas=False), "guerra-2007")
    assert first.headline == "infeasible, proved"
    found = with_other_factorings(model, first, Limits(100.0), lambda other: ql.solve(other, "guerra-2007"))
    assert found.headline == "feasible, proved"
    assert found.factoring == "z1 = y"
    lost = with_other_factorings(model, first, Limits(100.0), lambda other: first)
    assert lost.headline == "infeasible, proved"
    assert "this concerns one factoring of A(x) x, " in lost.reason


def test_the_time_limit_holds_for_all_of_them() -> None:
    first = replace(ql.solve(replace(tora(), from_formulas=False), "guerra-2007", decay_rate=0.01), seconds=0.5)

    def slow(other: DescriptorSystem) -> Answer:
        while True:
            time_left_s()

    start = time.monotonic()
    answer = with_other_factorings(tora(), first, Limits(1.0), slow)
    assert time.monotonic() - start < 1.5
    assert answer.reason == first.reason
