"""Arguments of the front door that are of another type than stated are refused by name, and no work is begun."""

from __future__ import annotations

import inspect
from fractions import Fraction
from typing import Any, Literal

import numpy as np
import pytest
import sympy as sp

import quasilpv as ql
from quasilpv.arguments import checked


def required(function: Any) -> dict[str, object]:
    """Something that fits for every argument without a default, of the kinds below."""
    fitting = {"system": "ex-I.1", "condition": "II.6", "over": ("b", 0, 1), "x": ("a", 0, 1, 2), "y": ("b", 0, 1, 2)}
    fitting |= {"robot": "arm2", "robot_id": "arm2", "name": "arm2", "artifact": "missing.json", "path": "missing.json"}
    needed = [p for p in inspect.signature(function).parameters.values() if p.default is inspect.Parameter.empty]
    return {p.name: fitting.get(p.name, object()) for p in needed if p.kind is not inspect.Parameter.VAR_KEYWORD}


@pytest.mark.parametrize(
    ("function", "argument"),
    [
        (ql.solve, "system"),
        (ql.solve, "condition"),
        (ql.solve, "parameters"),
        (ql.solve, "representation"),
        (ql.solve, "decay_rate"),
        (ql.solve, "time_limit_s"),
        (ql.boundary, "over"),
        (ql.boundary, "tolerance"),
        (ql.region, "x"),
        (ql.region, "processes"),
        (ql.robot, "name"),
        (ql.design, "law"),
        (ql.design, "rate_hz"),
        (ql.verify, "artifact"),
        (ql.gate, "artifact"),
        (ql.controller, "path"),
        (ql.stabilise, "objective"),
        (ql.stabilise, "input_limits"),
        (ql.stabilise, "share"),
        (ql.structure_report, "system"),
    ],
)
@pytest.mark.parametrize("wrong", [object(), np.eye(2), b"x", float("nan")], ids=["object", "array", "bytes", "nan"])
def test_when_an_argument_is_of_another_type_expect_its_name(function: Any, argument: str, wrong: object) -> None:
    arguments = required(function) | {argument: wrong}
    with pytest.raises(ql.InputError) as refused:
        function(**arguments)
    assert refused.value.field == argument or np.isscalar(wrong)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("wrong", [3, {"x": "1"}, {3: 1.0}, {"x": float("nan")}, [("x", 1.0)]])
def test_when_a_table_of_numbers_is_none_expect_it_named(wrong: object) -> None:
    with pytest.raises(ql.InputError, match=r"solve: parameters: got .*, expected a mapping from names to numbers"):
        ql.solve("ex-I.1", "II.6", parameters=wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("argument", ["equations", "state", "inputs", "domain", "unknown", "outputs", "units", "name"])
def test_when_equations_come_with_something_else_expect_it_named(argument: str) -> None:
    given: dict[str, Any] = {"equations": ["x' = u"], "state": "x", "inputs": "u", "domain": {"x": (-1, 1)}}
    with pytest.raises(ql.InputError, match=f"from_equations: {argument}: got 3, expected"):
        ql.DescriptorSystem.from_equations(**given | {argument: 3})


@checked
def doubled(value: float, times: int = 2, mode: Literal["plain", "loud"] = "plain", *more: str) -> float:
    """An example."""
    return float(value) * times + len(mode) * 0 + len(more) * 0


def test_numbers_of_other_libraries_are_numbers() -> None:
    numbers: list[Any] = [1, 1.0, np.float64(1.0), np.int64(1), Fraction(1), np.array(1.0), sp.Rational(1)]
    others: list[Any] = [True, "1", None, float("inf"), np.array([1.0]), sp.Symbol("a"), sp.I, 10**400, 1j]
    for value in numbers:
        assert doubled(value) == 2.0
    for value in others:
        with pytest.raises(ql.InputError, match=r"doubled: value: got .*, expected a finite number"):
            doubled(value)
    with pytest.raises(ql.InputError, match=r"times: got 2.5, expected a whole number"):
        doubled(1.0, 2.5)  # type: ignore[arg-type]
    with pytest.raises(ql.InputError, match="mode: got quiet, expected one of plain, loud"):
        doubled(1.0, 2, "quiet")  # type: ignore[arg-type]
    with pytest.raises(ql.InputError, match="more: got 3, expected a text"):
        doubled(1.0, 2, "loud", "a", 3)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="unexpected keyword"):
        doubled(1.0, twice=True)  # type: ignore[call-arg]
