"""The table of regions: what a prototype of the method reached is reached, exactly, where systems are comparable."""

from __future__ import annotations

import math

import pytest
from systems_table import SYSTEMS, main, measured, periods, share_of

from reference.released_systems import changed, released

SMALLER = {"boost-constant-power"}
"""Whose load here is harder than it can have been there: the region is smaller."""


@pytest.mark.full
@pytest.mark.parametrize("name", SYSTEMS)
def test_share_and_half_the_period_of_a_prototype_are_reached_and_verified(name: str) -> None:
    row = measured(SYSTEMS[name])
    assert row.verified
    assert row.share >= SYSTEMS[name].share * (0.8 if name in SMALLER else 1.0) - 5e-4
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
