"""Arms whose joints stick, at rest: what the rules of the integral are for."""

from __future__ import annotations

import pytest
from robots_rest import INTEGRATING, LAWS, SHIPPED, Row, rows, table

from quasilpv.synthesis import DEFAULT_CONTROLLER

COUNT_URAD = 6.0
"""Of an encoder of 20 bits."""


@pytest.mark.full
@pytest.mark.parametrize("law", [DEFAULT_CONTROLLER, "motor-pid", "link-damped", "link-dob"])
def test_an_arm_whose_joints_stick_rests_by_the_rule_that_ships_and_hunts_with_its_integral_on(law: str) -> None:
    found = {(row.rule, row.breakaway): row.worst_urad for row in rows(law, (1.0, 1.8))}
    print(law, found)
    for breakaway in (1.0, 1.8):
        assert found[SHIPPED, breakaway] < 2.0 * COUNT_URAD
    assert found[INTEGRATING, 1.8] > 10.0 * COUNT_URAD


def test_a_table_has_a_row_per_law_and_rule_and_a_column_per_friction() -> None:
    found = [
        Row("a", rule, ratio, (1.0, 10.0 * ratio + 2.0), 7.0) for rule in (SHIPPED, INTEGRATING) for ratio in (0.0, 1.8)
    ]
    assert list(table(found)) == [
        "| law | rule | smooth | break-away 1.8 c |",
        "|---|---|---|---|",
        "| `a` | shipped | 2 / 7 | 20 / 7 |",
        "| `a` | integral on | 2 / 7 | 20 / 7 |",
    ]
    assert {DEFAULT_CONTROLLER, "motor-pid"} <= set(LAWS)
