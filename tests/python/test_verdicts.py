"""Proofs that nothing exists, analytic truths, and the front door."""

import json
import pickle
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

import quasilpv as ql
from quasilpv.cli import run
from quasilpv.conditions.condition import Options
from quasilpv.conditions.registry import CONDITIONS
from quasilpv.errors import InputError
from quasilpv.lmi import to_rational
from quasilpv.polytopes import polytopic_model
from quasilpv.studies import Answer, Evidence, Question, Sweep, Verdict, answered
from quasilpv.studies.frozen_modes import (
    Disk,
    HalfPlane,
    characteristic_polynomial,
    eliminated,
    unreachable_mode,
)
from quasilpv.studies.refutation import IMPLIED, refutation
from quasilpv.systems.catalogue import system
from quasilpv.systems.descriptor.premise import AffineMatrix, Premise
from quasilpv.systems.descriptor.system import DescriptorSystem
from random_systems import random_system
from test_conditions_soundness import CASES

SEEDS = st.integers(0, 2**32 - 1)


# ---- exact algebra ---------------------------------------------------------------------------------------------------


@settings(max_examples=60, deadline=None, derandomize=True)
@given(SEEDS)
def test_where_eigenvalues_lie_is_decided_as_by_eigenvalues(seed: int) -> None:
    rng = np.random.default_rng(seed)
    size = int(rng.integers(1, 6))
    A = np.round(rng.normal(size=(size, size)) - rng.uniform(0.0, 3.0) * np.eye(size), 2)
    exact, eigenvalues = to_rational(A), np.linalg.eigvals(A)
    assert np.allclose([float(c) for c in characteristic_polynomial(exact)], np.poly(A))
    for stable, excess in (
        (HalfPlane(Fraction(1, 2)), eigenvalues.real.max() + 0.5),
        (Disk(Fraction(1, 4), Fraction(9, 10)), np.abs(1.0 + 0.25 * eigenvalues).max() - 0.9**0.5),
    ):
        if abs(excess) > 1e-6:
            assert stable.holds(exact) == (excess < 0.0)


@pytest.mark.parametrize(("matrix", "holds"), [([[0, 1], [-1, 0]], False), ([[0]], False), ([[-1, 5], [0, -1]], True)])
def test_the_edge_is_outside(matrix: list[list[int]], holds: bool) -> None:
    """On the edge nothing decays fast enough, and doubles cannot tell."""
    assert HalfPlane(Fraction(0)).holds(to_rational(matrix)) == holds
    radius = to_rational([[Fraction(-1, 10)]])
    assert not Disk(Fraction(1), Fraction(81, 100)).holds(radius)
    assert Disk(Fraction(1), Fraction(82, 100)).holds(radius)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(SEEDS)
def test_an_unreachable_mode_is_found_in_any_coordinates(seed: int) -> None:
    """``A = [A_11 A_12; 0 A_22]``, ``B = [B_1; 0]`` in random rational coordinates: the modes are those of A_22."""
    rng = np.random.default_rng(seed)
    reached, hidden = int(rng.integers(1, 4)), int(rng.integers(1, 3))
    n = reached + hidden
    A = np.round(rng.normal(size=(n, n)), 1)
    A[reached:, :reached] = 0.0
    B = np.zeros((n, 1))
    B[:reached] = 1.0
    own = np.linalg.eigvals(A[reached:, reached:])
    T = to_rational(np.round(rng.normal(size=(n, n)), 1) + 3.0 * np.eye(n))
    moved = eliminated(T, to_rational(A) @ T, to_rational(B), n)
    assert moved is not None
    mode = unreachable_mode(*moved, HalfPlane(Fraction(0)))
    if abs(own.real.max()) > 1e-9:
        assert (mode is not None) == (own.real.max() > 0.0)
    if mode is not None:
        assert abs(mode.eigenvalue.real - own.real.max()) < 1e-6


# ---- refutations -----------------------------------------------------------------------------------------------------


def integrators() -> DescriptorSystem:
    """Two double integrators, the second without input."""
    x1, v1, x2, v2, u = sp.symbols("x1 v1 x2 v2 u", real=True)
    equations = [ql.rate(x1) - v1, ql.rate(v1) - u, ql.rate(x2) - v2, ql.rate(v2)]
    return DescriptorSystem.from_equations(
        equations, name="integrators", state=(x1, v1, x2, v2), inputs=(u,), domain={}
    )


@pytest.mark.parametrize("name", [name for name, loop in IMPLIED.items() if loop.name == "CLOSED" and name != "I.3"])
def test_a_chain_without_an_input_refutes_every_design_and_is_named(name: str) -> None:
    model = polytopic_model(integrators(), CONDITIONS[name].representation.replace("uncertain", "per-premise"))
    found = refutation(name, model, Options())
    assert found is not None
    assert (found.eigenvalue, found.states) == ((0.0, 0.0), ("x2", "v2"))


def test_the_answer_names_the_mode_and_the_states() -> None:
    answer = ql.solve(integrators(), "I.2")
    assert (answer.verdict, answer.evidence) == (Verdict.INFEASIBLE, Evidence.PROVED)
    assert answer.refutation is not None
    assert answer.refutation.to_document() == {"point": {}, "eigenvalue": (0.0, 0.0), "states": ("x2", "v2")}
    assert "x2, v2" in answer.reason


def test_every_condition_is_known_to_imply_something_or_not() -> None:
    own = {name for name, known in CONDITIONS.items() if known.build.__module__.startswith("quasilpv.")}
    assert set(IMPLIED) | {"estimated-observer"} == own


@pytest.mark.parametrize("case", [case for case in CASES if case[2] != "arm3"], ids=lambda c: " ".join(map(str, c[:3])))
def test_nothing_that_was_proved_is_refuted(case: tuple) -> None:
    name, representation, plant, parameters, options = case
    assert refutation(name, polytopic_model(system(plant, **parameters), representation), options) is None


def planted(seed: int, rate: float) -> tuple[DescriptorSystem, np.ndarray]:
    """A random system of 3 states that loses its input to one mode at one point of the box, and that point.

    In the coordinates of the mode, ``A = [A_11 a(z); 0 rate]``, ``B = [b; c (z_1 - z0_1)]``.
    """
    rng = np.random.default_rng(seed)
    z0 = np.round(rng.uniform(-0.9, 1.9, 2), 3)
    A = AffineMatrix(np.round(rng.normal(size=(3, 3)), 2), np.round(rng.normal(size=(2, 3, 3)), 2))
    constant, slopes = A.constant.copy(), A.coefficients.copy()
    constant[2], slopes[:, 2] = (0.0, 0.0, rate), 0.0
    B, moving = np.round(rng.normal(size=(3, 1)), 2), np.zeros((2, 3, 1))
    moving[0, 2] = 1.0
    B[2] = -z0[0]
    symbols = sp.symbols("z1:3", real=True)
    plant = DescriptorSystem(
        name="planted",
        state=sp.symbols("x1:4", real=True),
        inputs=("u",),
        premises=tuple(Premise(str(z), z, (-1.0, 2.0)) for z in symbols),
        E=AffineMatrix(np.eye(3), np.zeros((2, 3, 3))),
        A=AffineMatrix(constant, slopes),
        B=AffineMatrix(B, moving),
        C=AffineMatrix(np.eye(3), np.zeros((2, 3, 3))),
        domain={z: (-1.0, 2.0) for z in symbols},
    )
    return plant, z0


@pytest.mark.parametrize("seed", range(6))
def test_a_mode_out_of_reach_at_one_inner_point_is_found_there(seed: int) -> None:
    plant, z0 = planted(seed, 0.5)
    found = refutation("TS-Pj", polytopic_model(plant, "ts"), Options())
    assert found is not None
    assert dict(found.point)["z1"] == z0[0]
    assert found.eigenvalue == (pytest.approx(0.5), 0.0)
    assert found.states == ("x3",)
    slow, _ = planted(seed, -0.5)
    assert refutation("TS-Pj", polytopic_model(slow, "ts"), Options()) is None
    assert refutation("TS-Pj", polytopic_model(slow, "ts"), Options(decay_rate=0.5)) is not None


def test_a_sampled_condition_is_refuted_outside_its_disk_only() -> None:
    """``1 + h s`` with s = -1 contracts by exp(-alpha h) for small alpha; with s = -210 and h = 0.01 it does not."""
    for rate, decay, refuted in ((-1.0, 0.5, False), (-1.0, 1.1, True), (-210.0, 0.0, True), (-190.0, 0.0, False)):
        plant, _ = planted(0, rate)
        options = Options(decay_rate=decay, sample_period_s=0.01)
        found = refutation("sampled-feedback", polytopic_model(plant, "per-premise"), options)
        assert (found is not None) == refuted


def test_an_observer_is_refuted_by_what_no_output_shows() -> None:
    x, y = sp.symbols("x y", real=True)
    plant = DescriptorSystem.from_equations(
        [ql.rate(x) + x, ql.rate(y) - y / 2], name="hidden", state=(x, y), inputs=(), domain={}, outputs=(x,)
    )
    answer = ql.solve(plant, "sampled-observer")
    assert answer.headline == "infeasible, proved"
    assert answer.refutation is not None
    assert answer.refutation.states == ("y",)


def test_nothing_is_claimed_where_algebraic_states_are_not_determined() -> None:
    """``x' = x``, ``0 = y z``: at z = 0 there is no frozen system, elsewhere there is."""
    x, y = sp.symbols("x y", real=True)
    z = sp.Symbol("z", real=True)
    for domain, found in (((-1.0, 1.0), True), ((0.0, 0.0 + 1e-9), True)):
        plant = DescriptorSystem.from_equations(
            [ql.rate(x) - x, y * z], name="fold", state=(x, y), inputs=(), domain={z: domain}
        )
        made = refutation("I.1", polytopic_model(plant, "ts"), Options())
        assert (made is not None) == found
        assert made is None or dict(made.point)["z1"] != 0.0


# ---- analytic truths -------------------------------------------------------------------------------------------------


def oscillator(r: float = 0.1) -> DescriptorSystem:
    """``x1' = x2, x2' = -(1 + p/2) x1 - x2/5``, |p| <= r."""
    x1, x2, p = sp.symbols("x1 x2 p", real=True)
    equations = [ql.rate(x1) - x2, ql.rate(x2) + (1 + p / 2) * x1 + x2 / 5]
    return DescriptorSystem.from_equations(
        equations, name="oscillator", state=(x1, x2), inputs=(), domain={p: (-r, r)}, unknown=(p,)
    )


LIMIT = 2.0 * (1.0 - 0.98**2) ** 0.5
"""Shorten and Narendra (2002): stiffnesses 1 +- r/2 and damping 1/5 have a common quadratic function if and only if
``sqrt(1 + r/2) - sqrt(1 - r/2) < 1/5``, squared ``1 - 1/50 < sqrt(1 - r^2/4)``."""


def test_the_boundary_of_a_common_quadratic_function_is_where_theory_has_it() -> None:
    found = ql.boundary(oscillator, "I.1", ("r", 0.1, 1.9))
    assert found.value == pytest.approx(LIMIT, abs=1e-4)
    assert found.certified_up_to is not None
    assert found.certified_up_to < LIMIT < found.infeasible_from
    assert found.infeasible_evidence is Evidence.NUMERICAL  # every frozen system is stable up to r = 2
    assert ql.solve(oscillator, "I.1", parameters={"r": 1.99}).evidence is Evidence.NUMERICAL
    assert ql.solve(oscillator, "I.1", parameters={"r": 2.0}).headline == "infeasible, proved"


def test_no_decay_rate_is_ever_verified_at_a_flat_minimum() -> None:
    """``x' = (U - 1) grad U``, ``U = |A_1 x|^2 |A_2 x|^2``: grad U is of third order at 0, and nothing decays there."""
    x = sp.symbols("x1 x2", real=True)
    A1 = sp.Matrix([[1, 2], [3, 4]])
    A2 = A1 * sp.diag(-1, 1)
    one, two = ((A * sp.Matrix(x)).dot(A * sp.Matrix(x)) for A in (A1, A2))
    U = sp.expand(one * two)
    drift = [sp.expand((U - 1) * sp.diff(U, symbol)) for symbol in x]
    plant = DescriptorSystem.from_equations(
        [ql.rate(symbol) - f for symbol, f in zip(x, drift, strict=True)],
        name="flat",
        state=x,
        inputs=(),
        domain=dict.fromkeys(x, (-0.1, 0.1)),
    )
    for decay in (0.0, 1e-9, 1e-3):
        for representation in ("per-premise", "reduced"):
            answer = ql.solve(plant, "I.1", representation=representation, decay_rate=decay)
            assert answer.headline == "infeasible, proved"


# ---- words -----------------------------------------------------------------------------------------------------------


def test_an_answer_is_short_and_says_how_sure() -> None:
    for b in (1.0, 4.0):
        answer = answered(Question("ex-I.1", "I.2", parameters=(("b", b),)))
        assert len(repr(answer).splitlines()) <= 10
        assert repr(answer).startswith(answer.headline)
    for name in ("ex-I.1", "arm3", "ex-III.12"):
        assert len(repr(system(name)).splitlines()) <= 10


def test_an_answer_survives_its_document() -> None:
    """All but the law."""
    for name, b in (("I.2", 1.0), ("I.1", 1.0), ("I.2", 9.0)):
        answer = replace(answered(Question("ex-I.1", name, parameters=(("b", b),))), law=None)
        assert {one.status.value for one in answer.relies_on} == {"proved", "assumed"}
        assert Answer.from_document(json.loads(json.dumps(answer.to_document()))) == answer


def test_a_sweep_says_what_is_proved_infeasible() -> None:
    """ex-I.1 without its input's gain over the premises: at b = 0 the frozen system I.1 asks for is unstable."""
    sweep = Sweep(Question("ex-I.1", "I.1"), ("a", "b"))
    assert sweep.updates
    answer = sweep.at({"a": 1.0, "b": 2.0})
    assert answer.headline == "infeasible, proved"
    E, A, _, _ = system("ex-I.1", a=1.0, b=2.0).evaluate([value for _, value in answer.refutation.point])
    assert np.linalg.eigvals(np.linalg.solve(E, A)).real.max() == pytest.approx(answer.refutation.eigenvalue[0])


# ---- the front door --------------------------------------------------------------------------------------------------


TRAVELLERS = [("I.2", "ts"), ("I.53", "ts"), ("II.6", "per-premise"), ("guerra-2007", "ts")]


@pytest.mark.parametrize(("name", "representation"), [*TRAVELLERS, ("sampled-observer", "per-premise")])
def test_a_law_is_data_that_travels(name: str, representation: str) -> None:
    plant = random_system(2, order=2, differential=2, instability=0.2)
    law = ql.solve(plant, name, representation=representation).law
    assert law is not None
    again = pickle.loads(pickle.dumps(law))
    z = np.array([0.25, 1.5])
    assert np.array_equal(law.gain(z), again.gain(z))
    assert np.array_equal(law.gain({"z1": 0.25, "z2": 1.5}), law.gain(z))
    assert np.isfinite(law.vertices).all()
    assert (law.E is not None) == (name == "II.6")
    assert len(repr(law).splitlines()) <= 10
    for wrong in ([0.25], [0.25, np.nan], {"z1": 0.25}, {"z1": 0.25, "z2": 1.5, "z9": 0.0}):
        with pytest.raises(InputError):
            law.gain(wrong)


def test_a_law_of_vertices_is_their_weighted_sum() -> None:
    plant = random_system(2, order=2, differential=2, instability=0.2)
    law = ql.solve(plant, "I.2", representation="ts").law
    assert law is not None
    w1, w2 = (0.25 + 1.0) / 3.0, (1.5 + 1.0) / 3.0
    weights = np.array([(1 - w1) * (1 - w2), (1 - w1) * w2, w1 * (1 - w2), w1 * w2])
    assert np.allclose(law.gain([0.25, 1.5]), np.tensordot(weights, law.vertices, axes=1))


def test_systems_functions_and_names_are_asked_in_the_same_way() -> None:
    def parametrised(b: float = 1.0) -> DescriptorSystem:
        return system("ex-I.1", b=b)

    told = [
        ql.solve(system("ex-I.1", b=3.0), "I.2"),
        ql.solve(parametrised, "I.2", parameters={"b": 3.0}),
        ql.solve("ex-I.1", "I.2", parameters={"b": 3.0}),
    ]
    assert {answer.headline for answer in told} == {"feasible, proved"}
    assert np.array_equal(told[0].law.vertices, told[2].law.vertices)


@pytest.mark.parametrize("processes", [1, pytest.param(2, marks=pytest.mark.full)])
def test_a_map_of_a_function_of_parameters(processes: int) -> None:
    def scalar(a: float = 1.0, b: float = 1.0) -> DescriptorSystem:
        x, u = sp.symbols("x u", real=True)
        return DescriptorSystem.from_equations(
            [ql.rate(x) - a * x - b * u], name="scalar", state=(x,), inputs=(u,), domain={}
        )

    found = ql.region(scalar, "I.2", ("a", -1.0, 1.0, 3), ("b", 0.0, 1.0, 2), grid=True, processes=processes)
    assert len(repr(found).splitlines()) <= 10
    assert "4 feasible, 2 infeasible" in repr(found)
    verdicts = {(point.x, point.y): point.answer.headline for point in found.points}
    reached = dict.fromkeys([(-1.0, 0.0), (-1.0, 1.0), (0.0, 1.0), (1.0, 1.0)], "feasible, proved")
    assert verdicts == reached | dict.fromkeys([(0.0, 0.0), (1.0, 0.0)], "infeasible, proved")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"system": 3}, "DescriptorSystem"),
        ({"system": lambda b: None}, "no default"),
        ({"system": lambda b=1.0: None}, "expected a DescriptorSystem"),
        ({"condition": "I.200"}, "condition"),
        ({"slack": "much"}, "one of none"),
        ({"form": "short"}, "one of published"),
        ({"decay": 1.0}, "decay_rate"),
        ({"parameters": {"q": 1.0}}, "parameter"),
        ({"representation": "tensor"}, "one of ts"),
    ],
)
def test_wrong_questions_are_one_line(changes: dict, words: str) -> None:
    asked = {"system": "ex-I.1", "condition": "I.2", **changes}
    with pytest.raises(InputError, match=words) as caught:
        ql.solve(asked.pop("system"), asked.pop("condition"), **asked)
    assert "\n" not in str(caught.value)


def test_the_front_door_costs_nothing_until_it_is_opened() -> None:
    code = "import sys, quasilpv; assert not {'numpy', 'sympy', 'clarabel'} & set(sys.modules); print(quasilpv.__all__)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout


def test_type_checkers_see_the_names_of_the_front_door() -> None:
    stub = (Path(ql.__file__).with_suffix(".pyi")).read_text(encoding="utf-8")
    declared = {line.split(" as ")[1] for line in stub.splitlines() if " as " in line}
    assert declared | {"__version__"} == set(ql.__all__)
    assert Path(ql.__file__).with_name("py.typed").exists()
    assert all(getattr(ql, name) is not None for name in ql.__all__)
    with pytest.raises(AttributeError):
        _ = ql.nothing


# ---- the command line ------------------------------------------------------------------------------------------------

OWN = """
import sympy as sp
import quasilpv as ql

def oscillator(r=0.1):
    x1, x2, p = sp.symbols("x1 x2 p", real=True)
    return ql.DescriptorSystem.from_equations(
        [ql.rate(x1) - x2, ql.rate(x2) + (1 + p / 2) * x1 + x2 / 5],
        name="oscillator", state=(x1, x2), inputs=(), domain={p: (-r, r)}, unknown=(p,),
    )
"""


def test_the_commands_say_what_is_proved(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "own.py").write_text(OWN, encoding="utf-8")
    name = f"{tmp_path / 'own.py'}:oscillator"
    assert run(["boundary", name, "-c", "I.1", "--over", "r=0.1:1.9", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["value"] == pytest.approx(LIMIT, abs=1e-4)
    assert found["infeasible_evidence"] == "numerical"
    assert run(["solve", name, "-c", "I.1", "--set", "r=2.5", "--json"]) == 1
    answer = json.loads(capsys.readouterr().out)
    assert (answer["verdict"], answer["evidence"]) == ("infeasible", "proved")
    assert set(answer["refutation"]) == {"point", "eigenvalue", "states"}
    assert all(set(one) == {"name", "status", "detail"} for one in answer["relies_on"])
    assert run(["solve", name, "-c", "I.1", "--set", "r=2.5"]) == 1
    assert capsys.readouterr().out.startswith("infeasible, proved: at z1 = ")
    assert run(["solve", name, "-c", "I.1", "--set", "r=0.3"]) == 0
    assert capsys.readouterr().out.startswith("feasible, proved: ")
