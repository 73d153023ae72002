"""Limits hold: memory before and while a solver works, time, and Ctrl-C; what is too large names cheaper ways."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from scipy import sparse

import quasilpv as ql
from quasilpv.conditions.condition import Options
from quasilpv.conditions.registry import CONDITIONS, condition
from quasilpv.errors import InputError
from quasilpv.lmi import budget, worker
from quasilpv.lmi.budget import Limits, TimeUpError, TooLargeError
from quasilpv.lmi.compiled import CompiledProblem
from quasilpv.polytopes import polytopic_model
from quasilpv.studies import affordable
from quasilpv.studies.front_door import question
from quasilpv.systems.catalogue import system
from quasilpv.systems.descriptor.equations import rate
from quasilpv.systems.descriptor.system import DescriptorSystem

ROOT = Path(__file__).parents[2]

LARGE = {"II.7", "II.8", "II.8-direct"}
"""Conditions that take seconds to write down for anything."""


def quadrotor() -> DescriptorSystem:
    """Roll, pitch, yaw kinematics and the rates of a rigid body: 6 states, 8 premises."""
    phi, theta, psi, p, q, r = sp.symbols("phi theta psi p q r", real=True)
    u = sp.symbols("u1:4", real=True)
    s, c = sp.sin, sp.cos
    tan = s(theta) / c(theta)
    return DescriptorSystem.from_equations(
        [
            rate(phi) - (p + s(phi) * tan * q + c(phi) * tan * r),
            rate(theta) - (c(phi) * q - s(phi) * r),
            rate(psi) - (s(phi) / c(theta) * q + c(phi) / c(theta) * r),
            rate(p) + q * r / 2 - 30 * u[0],
            rate(q) - p * r / 2 - 25 * u[1],
            rate(r) - p * q / 8 - 16 * u[2],
        ],
        name="quadrotor",
        state=[phi, theta, psi, p, q, r],
        inputs=list(u),
        domain={phi: (-0.5, 0.5), theta: (-0.5, 0.5), p: (-2, 2), q: (-2, 2), r: (-1, 1)},
    )


def large_program(order: int = 30) -> tuple[sparse.csc_matrix, np.ndarray, list[int]]:
    """A feasible program whose factorisation takes minutes: dense columns over many blocks."""
    rng = np.random.default_rng(0)
    rows = order * (order + 1) // 2
    blocks = [sparse.random(rows, 2000, density=0.2, random_state=rng) for _ in range(24)]
    return sparse.vstack(blocks).tocsc(), -np.ones(24 * rows), [order] * 24


def test_a_time_limit_stops_the_solver() -> None:
    start = time.monotonic()
    with budget.limited(Limits(time_s=1.0)), pytest.raises(TimeUpError, match="limit of 1 s"):
        worker.solve(*large_program())
    assert time.monotonic() - start < 8.0


def test_an_allocation_that_fails_does_not_end_this_process() -> None:
    with budget.limited(Limits(memory_gib=0.05)), pytest.raises(TooLargeError, match=r"more than 0\.05 GiB"):
        worker.solve(*large_program())


def test_ctrl_c_does_not_wait_for_the_solver() -> None:
    timer = threading.Timer(1.0, signal.raise_signal, (signal.SIGINT,))
    timer.start()
    start = time.monotonic()
    with budget.limited(Limits(time_s=60.0)), pytest.raises(KeyboardInterrupt):
        worker.solve(*large_program())
    assert time.monotonic() - start < 8.0


def test_a_process_of_its_own_gives_the_answer_of_this_one(monkeypatch: pytest.MonkeyPatch) -> None:
    model = polytopic_model(system("ex-I.1", b=2.0), "per-premise@0")
    compiled = CompiledProblem.of(condition("II.6").build(model, Options()).problem)
    program = (compiled.matrix()[0], -compiled.layout.diagonal.astype(float), compiled.layout.sizes)
    here = worker.solve(*program)
    monkeypatch.setattr(worker, "IN_PLACE", 0)
    with budget.limited(Limits(time_s=60.0, memory_gib=1.0)):
        apart = worker.solve(*program)
    assert here.status == apart.status == "Solved"
    assert np.array_equal(here.x, apart.x)


def test_time_is_up_between_inequalities_too() -> None:
    with budget.limited(Limits(time_s=1e-6)), pytest.raises(TimeUpError):
        condition("II.5").build(polytopic_model(quadrotor(), "per-premise@0"), Options())


def test_the_time_limit_of_a_question_makes_its_answer_unknown() -> None:
    answer = ql.solve("ex-I.1", "II.6", time_limit_s=1e-4)
    assert answer.verdict.value == "unknown"
    assert "time limit" in answer.reason
    assert "cheaper" in answer.reason


def test_what_is_too_large_names_its_size_and_cheaper_ways_that_are_within_the_limit() -> None:
    with pytest.raises(InputError, match=r"about .* GiB.*cheaper: .*--representation") as refused:
        ql.solve("ex-I.1", "II.5", memory_limit_gib=0.012)
    assert "--common" in str(refused.value)


def test_looking_for_cheaper_ways_ends_in_time_and_says_what_it_found(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = question(quadrotor(), "II.6")
    monkeypatch.setattr(affordable, "WAYS_S", 1e-6)
    start = time.monotonic()
    assert "no cheaper way of asking is known" in affordable.ways(asked)
    assert time.monotonic() - start < 2.0


def test_when_no_way_is_cheaper_expect_none_named() -> None:
    assert "no cheaper way of asking is known" in affordable.ways(question("ex-I.1", "guerra-2007"))


@pytest.mark.full
def test_no_way_is_named_that_is_not_cheaper(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(affordable, "WAYS_S", 60.0)  # however busy the machine is
    named = affordable.ways(question("ex-I.1", "II.8"))
    assert "--representation reduced" in named
    assert "--common" not in named


@pytest.mark.parametrize("name", [n if n not in LARGE else pytest.param(n, marks=pytest.mark.full) for n in CONDITIONS])
def test_conditions_say_whether_common_multipliers_make_a_difference(name: str) -> None:
    for known in ("ex-I.1", "ex-III.10", "ex-II.5"):
        asked = question(known, name)
        try:
            free, common = (
                replace(asked, options=replace(asked.options, common=common)).inequalities().problem
                for common in (False, True)
            )
        except InputError:
            continue
        sizes = [(len(one.constraints), sum(v.size for v in one.variables)) for one in (free, common)]
        assert (sizes[0] != sizes[1]) == condition(name).has_multipliers
        return
    pytest.skip("applies to none of these")


@pytest.mark.parametrize("limits", [{"time_limit_s": 0.0}, {"memory_limit_gib": -1.0}, {"time_limit_s": float("nan")}])
def test_limits_without_a_meaning_are_refused(limits: dict[str, float]) -> None:
    with pytest.raises(InputError, match="limit"):
        ql.solve("ex-I.1", "II.6", **limits)


@pytest.mark.full
@pytest.mark.parametrize("name", CONDITIONS)
def test_quadrotor_attitude_gets_an_answer_or_a_refusal_that_names_alternatives(name: str) -> None:
    start = time.monotonic()
    assert answer_or_refusal(name)
    assert time.monotonic() - start < 120.0


def answer_or_refusal(name: str) -> str:
    try:
        return ql.solve(quadrotor(), name).reason
    except InputError as error:
        return str(error)


PHASES = {
    "building": "quasilpv.lmi.problem.Problem.positive",
    "compiling": "quasilpv.lmi.compiled.CompiledProblem.of",
    "solving": "quasilpv.lmi.worker._apart",
    "looking for cheaper ways": "quasilpv.studies.affordable._size",
}
"""What a question enters, by what it is doing then."""

WATCHED = """
import sys, unittest.mock
from pathlib import Path
sys.path.insert(0, {tests!r})
from test_budget import quadrotor
import pkgutil

def entered(*arguments, **options):
    Path({entered!r}).touch()
    return original(*arguments, **options)

original = pkgutil.resolve_name({target!r})
unittest.mock.patch({target!r}, entered).start()
"""


@pytest.mark.full
@pytest.mark.parametrize("phase", PHASES)
def test_kill_int_ends_a_question_about_the_quadrotor_whatever_it_is_doing(phase: str, tmp_path: Path) -> None:
    own, entered = tmp_path / "own.py", tmp_path / "entered"
    tests = str(ROOT / "tests" / "python")
    own.write_text(WATCHED.format(tests=tests, entered=str(entered), target=PHASES[phase]), encoding="utf-8")
    limits = ["--memory-limit", "4" if phase == "looking for cheaper ways" else "16"]
    asked = [sys.executable, "-m", "quasilpv", "solve", f"{own}:quadrotor", "-c", "II.6", *limits]
    process = subprocess.Popen(asked, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while not entered.exists():
        assert process.poll() is None
        time.sleep(0.05)
    time.sleep(0.3)
    start = time.monotonic()
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=30.0)
    assert time.monotonic() - start < 2.0
    assert process.returncode == 130
    assert "Traceback" not in errors
