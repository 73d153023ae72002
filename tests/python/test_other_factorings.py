"""A question about equations is a question about all their factorings."""

from __future__ import annotations

import time
from dataclasses import fields, replace

import numpy as np
import sympy as sp

import quasilpv as ql
from quasilpv.lmi.budget import Limits, time_left_s
from quasilpv.studies.answer import Answer
from quasilpv.studies.other_factorings import with_other_factorings
from quasilpv.systems.descriptor.premise import PremiseKind
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.own_kind import fingerprint
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
    ql.solve(tora(), "guerra-2007", decay_rate=0.01)  # the same matrices, of equations, in the same program
    given = replace(tora(), from_formulas=False)
    answer = ql.solve(given, "guerra-2007", decay_rate=0.01)
    assert answer.headline == "infeasible, numerically"
    assert "factoring" not in answer.reason


def test_questions_about_systems_that_differ_in_anything_are_different_questions() -> None:
    """Systems are remembered by their digest: it covers every field, so that none is answered for another."""
    one = tora()
    symbol = one.state[0]
    others = {
        "name": "other",
        "state": (sp.Symbol("y"), *one.state[1:]),
        "inputs": ("torque",),
        "premises": (replace(one.premises[0], kind=PremiseKind.UNKNOWN), *one.premises[1:]),
        "E": replace(one.E, constant=2 * one.E.constant),
        "A": replace(one.A, coefficients=2 * one.A.coefficients),
        "B": replace(one.B, constant=2 * one.B.constant),
        "C": replace(one.C, constant=2 * one.C.constant),
        "domain": {**one.domain, symbol: (-7.0, 7.0)},
        "disturbance": (0.0, 0.0, 0.0, 1e-3),
        "given_by_rules": True,
        "from_formulas": False,
        "trim": (0.0, 0.0, 0.0, 1e-3, 0.0),
        "equations": one.equations[:-1],
        "units": {symbol.name: "m"},
    }
    assert others.keys() == {field.name for field in fields(one)}
    assert fingerprint(one) == fingerprint(tora())
    digests = {fingerprint(replace(one, **{name: value})) for name, value in others.items()}
    assert len(digests | {fingerprint(one)}) == len(others) + 1


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


def test_a_premise_of_a_state_and_a_parameter_has_no_one_value_at_rest() -> None:
    """Weak gains: at x = 0 with g = 11 the closed loop x'' = 11 x - 5 x - 2 x' has the mode sqrt(7) - 1."""
    loop = ql.DescriptorSystem.from_equations(
        ["x' = w", "w' = g*sin(x) - 5*x - 2*w"],
        state="x w",
        inputs="",
        domain={"x": (-1, 1), "g": (9, 11)},
        unknown="g",
    )
    answer = ql.solve(loop, "I.1")
    assert answer.headline == "infeasible, proved"
