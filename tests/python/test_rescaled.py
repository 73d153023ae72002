"""Inequalities in other units by powers of two are those a condition writes down for the rescaled system."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from quasilpv.lmi.compiled import CompiledProblem
from quasilpv.lmi.rescaled import powers_between, rescaled
from quasilpv.polytopes.units import Units
from quasilpv.studies import Question

UNITS = Units(state=(3, -5), inputs=(2,), outputs=(0, 0), rows=(-1, 4), time=-2, differential=2)


def compiled(question: Question, units: Units | None = None) -> CompiledProblem:
    return CompiledProblem.of(question.inequalities(units).problem)


@pytest.mark.parametrize("condition", ["I.2", "II.6", "II.6-direct"])
def test_powers_read_off_at_one_point_hold_at_another(condition: str) -> None:
    here, there = (Question("ex-I.1", condition).at({"a": a, "b": b}) for a, b in ((1.375, 0.8125), (-3.1, 7.3)))
    powers = powers_between(compiled(here), compiled(here, UNITS))
    assert powers is not None
    assert powers.any()
    expected, found = compiled(there, UNITS), rescaled(compiled(there), powers)
    assert np.array_equal(found.layout.row, expected.layout.row)
    assert all(
        a * expected.denominator == b * found.denominator
        for a, b in zip(found.coefficients.tolist(), expected.coefficients.tolist(), strict=True)
    )


def test_what_is_not_a_power_of_two_or_vanishes_is_not_taken_for_one() -> None:
    own = compiled(Question("ex-I.1", "II.6"))
    assert powers_between(own, replace(own, denominator=3 * own.denominator)) is None
    coefficients = own.coefficients.copy()
    coefficients[7] = 0
    assert powers_between(replace(own, coefficients=coefficients), own) is None
    assert powers_between(own, compiled(Question("ex-I.1", "I.2"))) is None
