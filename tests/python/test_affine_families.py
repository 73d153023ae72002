"""Systems of users over parameters in which they are affine: found out from their equations, never believed."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import quasilpv as ql
from quasilpv.errors import InputError
from quasilpv.lmi.compiled import lattice
from quasilpv.systems.catalogue import system_kind
from quasilpv.systems.own_kind import own_kind


def _line(text: str, **domain: tuple[float, float]) -> ql.DescriptorSystem:
    return ql.DescriptorSystem.from_equations([text], state="x", inputs="u", domain=domain)


def circuit(L: float = 1e-5, g: float = 0.1) -> ql.DescriptorSystem:
    return ql.DescriptorSystem.from_equations(
        [f"{L}*i' = -i/10 - v + u", f"v' = i + {g}*v - v**3/1000 + {2 * g}*i*cos(v)"],
        state="i v",
        inputs="u",
        domain={"v": (-5, 5)},
    )


def stable(a: float = -1.0, b: float = 0.5) -> ql.DescriptorSystem:
    """``x' = (a + b w) x``, |w| <= 1: stable if and only if a + |b| < 0."""
    return ql.DescriptorSystem.from_equations([f"x' = ({a} + {b}*w)*x"], state="x", domain={"w": (-1, 1)}, unknown="w")


def in_numbers(a: float = 1.0, b: float = 0.1) -> ql.DescriptorSystem:
    return _line(f"x' = {a}*x + {math.sin(b)}*u")


def in_the_premise(a: float = 1.0, b: float = 0.1) -> ql.DescriptorSystem:
    return _line(f"x' = {a}*x**2 + {b}*x**3 + u", x=(-1, 1))


def in_the_domain(a: float = 1.0, b: float = 0.1) -> ql.DescriptorSystem:
    return _line(f"x' = {b}*x + x**3 + u", x=(-a, a))


def as_a_divisor(a: float = 1.0, b: float = 0.1) -> ql.DescriptorSystem:
    return _line(f"x' = x/{a} + {b}*u")


def as_a_product(a: float = 1.0, b: float = 0.1) -> ql.DescriptorSystem:
    return _line(f"x' = {a}*{b}*x + u")


def by_type(a: float = 1.0, b: float = 0.1) -> ql.DescriptorSystem:
    return _line(f"x' = {a}*x*{1 if isinstance(a, float) else 2} + {b}*u")


def by_size(a: float = 1.0, b: float = 0.1) -> ql.DescriptorSystem:
    return _line(f"x' = {a if a < 2 else 4}*x + {b}*u")


def by_value(a: float = 1.0, b: float = 0.1) -> ql.DescriptorSystem:
    return _line(f"x' = {a if a != 2 else 4}*x + {b}*u")


def by_table(a: float = 1.0, b: float = 0.1) -> ql.DescriptorSystem:
    return _line(f"x' = {({2.0: 4.0}).get(a, a)}*x + {b}*u")


def by_digits(a: float = 1.0, b: float = 0.1) -> ql.DescriptorSystem:
    return _line(f"x' = {a:.3f}*x + {b}*u")


def in_the_outputs(a: float = 1.0, b: float = 0.1) -> ql.DescriptorSystem:
    return ql.DescriptorSystem.from_equations([f"x' = {b}*x"], state="x", outputs=[f"{a}*x"], domain={})


@pytest.mark.parametrize(
    "function",
    [
        in_numbers,
        in_the_premise,
        in_the_domain,
        as_a_divisor,
        as_a_product,
        by_type,
        by_size,
        by_value,
        by_table,
        by_digits,
        in_the_outputs,
    ],
)
def test_what_is_not_shown_to_be_affine_is_no_family(function: Callable[..., ql.DescriptorSystem]) -> None:
    assert own_kind(function).family(["a", "b"]) is None
    assert own_kind(function).system(a=1.5, b=0.25).order == 1  # and is a system all the same


def test_members_of_a_family_are_the_systems_made_for_their_points() -> None:
    family = own_kind(circuit).family(["L", "g"])
    assert family is not None
    for L, g in np.random.default_rng(1).uniform([1e-6, -2.0], [1e-4, 2.0], (8, 2)):
        member, made = family.at({"L": L, "g": g}), circuit(L, g)
        assert [p.expression for p in member.premises] == [p.expression for p in made.premises]
        z = 0.5 * (made.lower + made.upper)
        for one, other in zip(member.evaluate(z), made.evaluate(z), strict=True):
            assert np.allclose(one, other, rtol=1e-9, atol=1e-12)


def test_members_are_affine_without_rounding_where_a_family_is_compiled() -> None:
    """Second differences of the doubles on the lattice vanish exactly, or nothing could be compared there."""
    family = own_kind(circuit).family(["L", "g"])
    assert family is not None
    numbers = [
        np.concatenate([matrix.constant.ravel(), matrix.coefficients.ravel()])
        for point in lattice(family.base, family.steps)
        for member in [family.at(point)]
        for matrix in [member.A]
    ]
    origin, one, other = ([Fraction(number) for number in table] for table in numbers[:3])
    for place, table in zip(lattice({"p": 0.0, "q": 0.0}), numbers, strict=True):
        p, q = Fraction(place["p"]), Fraction(place["q"])
        assert table.tolist() == [(1 - p - q) * a + p * b + q * c for a, b, c in zip(origin, one, other, strict=True)]


def test_a_map_of_a_function_proves_its_area() -> None:
    """The area is known: a + |b| < 0, of which only points inside may be proved."""
    found = ql.region(stable, "I.1", ("a", -2.0, 2.0, 33), ("b", -1.0, 1.0, 33))
    assert found.areas is not None
    corners = [(a, b) for r in found.areas.proved for a in r.x for b in r.y]
    assert corners
    assert all(a + abs(b) < 0 for a, b in corners)
    true_share = 3.0 / 8.0
    assert true_share - 0.06 < found.areas.proved_share < true_share
    assert found.areas.proved_share + found.areas.undecided_share >= true_share


def test_a_document_proves_areas_as_the_function_does(tmp_path: Path) -> None:
    document = {
        "schema": "quasilpv.system",
        "schema_version": 1,
        "name": "stable",
        "state": ["x"],
        "parameters": {"a": -1.0, "b": 0.5, "c": 3.0},
        "equations": ["x' = (a + b*w)*x"],
        "domain": {"w": [-1, "c - 2"]},
        "unknown": ["w"],
    }
    path = tmp_path / "stable.json"
    path.write_text(json.dumps(document))
    axes = ("a", -2.0, 2.0, 9), ("b", -1.0, 1.0, 9)
    found, same = ql.region(str(path), "I.1", *axes), ql.region(stable, "I.1", *axes)
    assert found.areas is not None
    assert same.areas is not None
    assert found.areas.proved == same.areas.proved
    assert system_kind(str(path)).family(["a", "c"]) is None  # bounds of the premise depend on c


def test_code_in_a_file_is_asked_too(tmp_path: Path) -> None:
    path = tmp_path / "plant.py"
    path.write_text(
        "import quasilpv as ql\n"
        "def plant(k=2.0, n=1, c=0.5):\n"
        '    rows = [f"x\' = {k}*x + {c}*u" for _ in range(n)]\n'
        "    return ql.DescriptorSystem.from_equations(rows, state='x', inputs='u', domain={})\n"
    )
    kind = system_kind(f"{path}:plant")
    assert kind.family(["k", "c"]) is not None
    assert kind.family(["k", "n"]) is None  # a range needs a number


def driven(a: float = 1.0, b: float = 1.0) -> ql.DescriptorSystem:
    return ql.DescriptorSystem.from_equations(
        [f"x' = y + {a}*x", f"y' = x*cos(x) + {b}*u"], state="x y", inputs="u", domain={"x": (-1, 1)}
    )


@pytest.mark.parametrize("condition", ["I.2", "I.53", "II.6-direct", "TS-Pj", "guerra-2007", "sampled-feedback"])
def test_no_area_is_proved_where_the_input_vanishes(condition: str) -> None:
    """With b = 0 nothing stabilises ``y' = x cos x``: forms without gains must not see the rank of B only beside it."""
    found = ql.region(driven, condition, ("a", -2.0, 2.0, 3), ("b", -1.0, 1.0, 5), representation="ts")
    assert all(r.y[0] > 0.0 or r.y[1] < 0.0 for r in (found.areas.proved if found.areas else ()))
    assert all(p.answer.headline == "infeasible, proved" for p in found.points if p.y == 0.0)
    alone = ql.region(driven, condition, ("a", -2.0, 2.0, 3), ("b", -1.0, 1.0, 5), representation="ts", grid=True)
    assert {p.answer.certified for p in alone.points if p.y == 0.0} == {False}
    assert {p.answer.certified for p in alone.points if p.y != 0.0} == {True}


def resistive(L: float = 0.01, k: float = 0.5) -> ql.DescriptorSystem:
    """At L = 0 the current is algebraic and ``v' = -(10 + k) v``, which is stable."""
    return ql.DescriptorSystem.from_equations([f"{L}*i' = -i/10 - v", f"v' = i - {k}*v"], state="i v", domain={})


def test_a_point_where_a_state_loses_its_rate_is_another_system() -> None:
    found = ql.region(resistive, "I.1", ("k", 0.0, 1.0, 3), ("L", 0.0, 0.01, 3), grid=True)
    assert [p.answer.headline for p in found.points if p.y == 0.0] == ["feasible, proved"] * 3


@pytest.mark.parametrize(("equation", "domain"), [("x' = x/R + w*x", [-1, 1]), ("x' = R*x + w*x", [-1, "1/R"])])
def test_a_formula_without_a_value_is_one_line(tmp_path: Path, equation: str, domain: list[float | str]) -> None:
    document = {"schema": "quasilpv.system", "schema_version": 1, "name": "s", "state": ["x"], "parameters": {"R": 1.0}}
    path = tmp_path / "divided.json"
    path.write_text(json.dumps({**document, "equations": [equation], "domain": {"w": domain}}))
    with pytest.raises(InputError, match=r"values for which|undefined"):
        ql.solve(str(path), "I.1", parameters={"R": 0.0})
