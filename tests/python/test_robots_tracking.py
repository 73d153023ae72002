"""Arms in space with a load nobody told their controllers of: how near they keep to their path."""

from __future__ import annotations

import pytest
from robots_tracking import BASELINES, NO_COMPENSATION, Row, rows

from quasilpv.synthesis import DEFAULT_CONTROLLER

LARGEST_UM = {0.02: 10.0, 0.15: 3.0}
"""By torque activity."""

BETTER = 5.0
"""Than the best of those that do not compensate what disturbs them."""


@pytest.mark.full
@pytest.mark.parametrize("name", ["UR5", "Panda"])
@pytest.mark.parametrize("activity", LARGEST_UM)
def test_the_default_law_keeps_micrometres_and_is_far_ahead_of_laws_that_do_not_compensate(
    name: str, activity: float
) -> None:
    found: dict[tuple[str, str], Row] = {(row.path, row.controller): row for row in rows(name, activity)}
    paths = {path for path, _ in found}
    assert len(found) == len(paths) * (len(BASELINES) + 2)
    for path in paths:
        own = found[path, DEFAULT_CONTROLLER]
        assert own.rms_um <= LARGEST_UM[activity]
        assert own.result.metrics.share_at_limit == 0.0
        assert BETTER * own.rms_um <= min(found[path, other].rms_um for other in NO_COMPENSATION)
