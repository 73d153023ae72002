"""Arms with elastic gears and a load nobody told their controllers of: how near they keep to their path, by class."""

from __future__ import annotations

import pytest
from elastic_tracking import Row, rows

INDUSTRY, KNOWN = "PID and gravity", "motor-pid, load known"
LARGEST_UM = {
    ("elastic, motor encoders", "motor-pid"): 350.0,
    ("elastic, dual encoders", "motor-pid"): 200.0,
    ("elastic, dual encoders", "link-damped"): 80.0,
}
"""Of the UR5 with gears as stiff as its laws take them to be."""


@pytest.mark.full
def test_when_a_ur5_has_elastic_gears_expect_each_class_ahead_of_the_one_that_measures_less() -> None:
    found: dict[tuple[str, str, float], Row] = {(row.arm_class, row.law, row.factor): row for row in rows("UR5")}
    motors = "elastic, motor encoders"
    before = found[motors, INDUSTRY, 1.0].rms_um
    for (kind, law), largest in LARGEST_UM.items():
        row = found[kind, law, 1.0]
        assert row.rms_um <= largest
        assert row.rms_um < before
        before = row.rms_um
    assert found[motors, KNOWN, 1.0].rms_um < found[motors, "motor-pid", 1.0].rms_um
    assert {row.evidence for row in found.values() if row.law == "motor-pid"} == {"proved"}
    assert {row.evidence for row in found.values() if row.law in ("link-damped", "link-dob")} == {"gridded"}
