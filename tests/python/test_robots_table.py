"""The table of robots: their inertia is bounded close to what occurs, and bounds that are false are refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import robots_table
from robots_table import LARGEST_GAP, ROBOTS, TOLERANCE, measured, package_folder, robot_of

from quasilpv.errors import InputError

DATA = Path(__file__).parents[2] / "examples/ur5"


@pytest.mark.full
@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("domain", LARGEST_GAP)
@pytest.mark.parametrize("tolerance", [0.0, TOLERANCE])
def test_both_bounds_of_a_robot_are_proved_near_what_occurs_and_false_ones_refused(
    name: str, domain: str, tolerance: float
) -> None:
    row = measured(name, package_folder(), domain, tolerance)
    assert row.proved == (True, True)
    assert row.refused == (True, True)
    assert max(row.gaps) <= LARGEST_GAP[domain]
    assert row.sides[0].bound < row.sides[0].sampled < 1.0 < row.sides[1].sampled < row.sides[1].bound
    assert row.holds


def test_a_row_is_read_through_a_file_as_a_user_writes_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """On the UR5 of this project, which needs no package."""
    entry = replace(ROBOTS["UR5"], file="ur5.urdf", tip="flange", mass_kg=1.5)
    full, box = (robot_of(entry, DATA, domain=domain, tolerance=0.1) for domain in LARGEST_GAP)
    assert box.tree.joints[0].upper - box.tree.joints[0].lower == pytest.approx(2 * robots_table.BOX_RAD)
    assert full.link_uncertainty == box.link_uncertainty == 0.1
    assert [joint.rotor_tolerance for joint in full.joints] == [0.1] * 6
    assert full.payload is not None
    assert full.payload.mass_kg == 1.5
    np.testing.assert_array_equal(full.tree.rotor_inertias, 0.1)

    monkeypatch.setitem(robots_table.ROBOTS, "small", entry)
    row = measured("small", DATA, "box", 0.0)
    assert row.holds
    far = replace(row, sides=(replace(row.sides[0], sampled=1.1 * row.sides[0].sampled), row.sides[1]))
    assert not far.holds
    assert not replace(row, proved=(True, False)).holds
    assert not replace(row, refused=(False, True)).holds


def test_without_the_package_expect_a_line_that_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(robots_table, "PACKAGE", "example-robot-data-of-nobody")
    with pytest.raises(InputError, match="not installed, expected pip install example-robot-data"):
        package_folder()
