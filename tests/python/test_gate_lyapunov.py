"""The Lyapunov function of a moving robot: that it decreases, what is known of it at run time, what is refused."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from flint import fmpq
from hypothesis import given, settings
from hypothesis import strategies as st

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.matrices import matrix, rational
from quasilpv.certificate.exact.rationals import to_floats
from quasilpv.certificate.gate.loop import AccelerationLoopData
from quasilpv.certificate.gate.lyapunov import LyapunovClaim, SampledSignals
from quasilpv.certificate.gate.motion import InertiaDisc, LyapunovDocument
from quasilpv.certificate.laws.dob_acceleration import LyapunovBound
from quasilpv.documents.strict_model import validate
from quasilpv.errors import ClaimError, InputError
from quasilpv.release import checked_artifact, to_artifact
from quasilpv.synthesis import DesignRequest, synthesise
from quasilpv.synthesis.acceleration import moving_inertia as design
from quasilpv.synthesis.acceleration.moving_lyapunov import delayed_loop, known_signals, moving_lyapunov
from quasilpv.synthesis.acceleration.sampled_loop import AccelerationLaw
from quasilpv.systems.robots.registry import robot
from reference.checked import is_function_proved, loop_data, robust_gate
from reference.gated_arms import full_map, moving_design, moving_five_bar, multiple_pole_loop, quotients

Document = dict[str, Any]

LOOP = multiple_pole_loop(60, 1200, 1e-3, 1e-3)


def in_samples(loop: AccelerationLoopData) -> FloatArray:
    """From signals in SI units to those with time in samples."""
    return loop.sample_period_s ** np.array([0.0, 1.0, 0.0, 1.0, 2.0, 3.0, 2.0, -1.0, 2.0])


def moving_map(loop: AccelerationLoopData, X: FloatArray, delay: float) -> FloatArray:
    """Per-sample map, time in samples, whose last signal is what the command on its way will do, ``X a``."""
    n = len(X)
    units = np.diag(np.repeat(in_samples(loop), n))
    units[-n:, -n:] = units[-n:, -n:] @ X
    return np.asarray(units @ full_map(loop, X, delay) @ np.linalg.inv(units))


def shipped(document: Document) -> tuple[Callable[[float], FloatArray], FloatArray]:
    """``P x Y^-1`` by delay, and the bound ``R x W``."""
    motion, bound = document["witness"]["motion"], document["law"]["lyapunov_bound"]
    first, last = (np.array(motion["lyapunov"][name]) for name in ("no_delay", "longest_delay"))
    inverse = np.linalg.inv(np.array(motion["shape"]))

    def function(delay: float) -> FloatArray:
        share = delay / motion["longest_delay_samples"]
        return np.kron((1 - share) * first + share * last, inverse)

    return function, np.kron(np.array(bound["signals"]), np.array(bound["joints"]))


def as_law(loop: AccelerationLoopData) -> AccelerationLaw:
    feedback = np.array([loop.kp, loop.kd, loop.ki])
    return AccelerationLaw(loop.sample_period_s, feedback, np.array(loop.observer), loop.filter_time_constant_s)


# ---- the loop --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("delay", [0.0, 0.25, 0.5, 0.9])
def test_when_the_gate_writes_its_loop_expect_the_law_run_on_every_unit_state_and_the_loop_of_the_design(
    delay: float,
) -> None:
    signals, early = SampledSignals.of(LOOP, LOOP.filter_poles()[0]), rational(1 - delay)
    free, drive = signals.sample(early, early**2)
    exact = to_floats(free + fmpq(7, 10) * drive * signals.command)
    assert exact == pytest.approx(moving_map(LOOP, np.array([[0.7]]), delay), abs=1e-9)
    # The last Bernstein coefficient of a design for this delay is its value there.
    loop = delayed_loop(as_law(LOOP), 0.7, delay)
    assert loop.transition[-1] == pytest.approx(exact, abs=1e-9)
    assert loop.drive[-1] == pytest.approx(to_floats(drive), abs=1e-12)
    assert known_signals(as_law(LOOP)) == pytest.approx(to_floats(signals.known), abs=1e-12)


def test_when_a_disturbance_is_constant_expect_a_steady_state_of_which_nothing_is_known() -> None:
    mu, disturbance, delay = 0.7, 0.3, 0.25
    A = moving_map(LOOP, np.array([[mu]]), delay)
    pushed = disturbance * np.array([0.5, 1.0, 0, 0, 0, 0, 0, 0, 0])
    steady = np.linalg.solve(np.eye(9) - A, pushed)
    level = disturbance / mu
    assert steady == pytest.approx([0, 0, 0, 0, level, 0, level, 0, -disturbance], abs=1e-9)
    assert known_signals(as_law(LOOP)) @ steady == pytest.approx(np.zeros(5), abs=1e-9)


# ---- the function ----------------------------------------------------------------------------------------------------


def require_decrease(document: Document, robot_id: str, steps: int) -> None:
    """Along random sequences of postures and payloads, at several delays, from random states."""
    loop, (function, _) = loop_data(document), shipped(document)
    scale = document["verification"]["report"]["inertia_scale"]
    longest = document["witness"]["motion"]["longest_delay_samples"]
    rng = np.random.default_rng(3)
    for delay in (0.0, 0.3 * longest, longest):
        V = function(delay)
        states = rng.normal(size=(50, len(V))) / np.sqrt(V.diagonal())
        before = np.einsum("ni,ij,nj->n", states, V, states)
        for X in quotients(robot(robot_id), scale, steps, 4):
            states = states @ moving_map(loop, X, delay).T
            after = np.einsum("ni,ij,nj->n", states, V, states)
            assert np.all(after < before)
            before = after


def test_when_postures_and_payloads_change_at_every_sample_expect_the_shipped_function_to_decrease() -> None:
    require_decrease(moving_five_bar(), "fivebar", 60)


@pytest.mark.full
def test_when_an_arm_with_three_links_moves_and_changes_its_load_expect_the_shipped_function_to_decrease() -> None:
    document = to_artifact(synthesise(DesignRequest.of("arm3", "dob-moving"))).content()
    assert robust_gate(document).motion is True
    require_decrease(document, "arm3", 200)


def test_when_v_is_given_expect_it_not_to_be_less_than_the_position_error_alone() -> None:
    document = moving_five_bar()
    inverse = np.linalg.inv(np.array(document["witness"]["motion"]["shape"]))
    for name in ("no_delay", "longest_delay"):
        P = np.array(document["witness"]["motion"]["lyapunov"][name])
        position = np.zeros((9, 9))
        position[0, 0] = 1.0 - 1e-6
        assert np.linalg.eigvalsh(P - position).min() > 0.0
    assert np.linalg.eigvalsh(inverse).min() > 0.0


@settings(max_examples=4, deadline=None)
@given(st.floats(20, 50), st.floats(900, 1500), st.floats(0.3, 0.8), st.floats(0, 1))
def test_when_a_function_is_found_for_a_loop_expect_the_gate_to_prove_it(
    wc: float, wo: float, centre: float, delay: float
) -> None:
    loop = multiple_pole_loop(wc, wo, 1e-3, 1e-3)
    found = moving_lyapunov(as_law(loop), design.InertiaDisc(centre, 0.1 * centre, np.eye(2)), delay)
    assert found is not None
    function = validate(LyapunovDocument, found.to_document(), "function")
    claim = LyapunovClaim.of(function, validate(LyapunovBound, found.bound_document(), "bound"), 2)
    disc = InertiaDisc(rational(centre), rational(0.1 * centre), matrix(np.eye(2).tolist()))
    assert claim.is_proved(loop, disc, rational(delay))


def test_when_no_function_exists_expect_none() -> None:
    assert moving_lyapunov(as_law(LOOP), design.InertiaDisc(1.0, 0.999, np.eye(1)), 0.5) is None


# ---- what is known of it ---------------------------------------------------------------------------------------------


@given(st.integers(0, 2**31), st.sampled_from([0.0, 0.2, 0.5]))
def test_when_only_the_known_signals_are_taken_expect_no_more_than_v_whatever_the_steady_state(
    seed: int, delay: float
) -> None:
    document = moving_five_bar()
    loop, (function, bound) = loop_data(document), shipped(document)
    V, n = function(delay), document["joints"]
    rng = np.random.default_rng(seed)
    errors = rng.normal(size=9 * n) * 10.0 ** np.repeat(rng.uniform(-3, 1, 9), n)
    level, pull, speed = rng.normal(size=(3, n))
    steady = np.concatenate([np.zeros(n), speed, np.zeros(2 * n), level, np.zeros(n), level, np.zeros(n), pull])
    known = known_by_running_the_law(loop, (errors + steady).reshape(9, n)).ravel()
    assert known @ bound @ known <= errors @ V @ errors


def known_by_running_the_law(loop: AccelerationLoopData, s: FloatArray) -> FloatArray:
    """The known signals of a sample, time in samples, from the correction and the filter of the law."""
    T, (l1, l2, l3, _), q = (
        loop.sample_period_s,
        loop.observer,
        math.exp(-loop.sample_period_s / loop.filter_time_constant_s),
    )
    y, _, p1, p2, p3, _, filtered, integral, _ = s / in_samples(loop)[:, None]
    corrected, speed, disturbance = p1 + l1 * (y - p1), p2 + l2 * (y - p1), p3 + l3 * (y - p1)
    filtered = q * filtered + (1 - q) * disturbance
    innovation = (y - corrected) / (1 - l1)
    return np.array([y, innovation, T * speed, T**2 * (disturbance - filtered), integral / T])


def test_when_the_bound_is_compared_with_the_least_v_expect_it_to_give_little_away() -> None:
    document = moving_five_bar()
    motion, R = document["witness"]["motion"], np.array(document["law"]["lyapunov_bound"]["signals"])
    C = known_signals(as_law(loop_data(document)))
    least = [
        np.linalg.inv(C @ np.linalg.solve(np.array(motion["lyapunov"][name]), C.T))
        for name in ("no_delay", "longest_delay")
    ]
    # In every direction R is at most both, and in some direction it is nearly the one, in some nearly the other.
    shares = [np.linalg.eigvals(np.linalg.solve(S, R)).real for S in least]
    assert all(share.max() < 1.0 for share in shares)
    assert all(share.max() > 1.0 - 1e-5 for share in shares)


# ---- what the gate refuses -------------------------------------------------------------------------------------------


def changed(document: Document, change: Callable[[Document, Document], None]) -> Document:
    """A copy with other members ``motion`` of the witness and ``law``."""
    other = copy.deepcopy(document)
    change(other["witness"]["motion"], other["law"])
    return other


def entry(where: str, row: int, column: int, factor: float) -> Callable[[Document, Document], None]:
    """Multiply an entry and the one across the diagonal."""

    def change(motion: Document, law: Document) -> None:
        table = {**motion["lyapunov"], **law["lyapunov_bound"]}[where]
        table[row][column] *= factor
        if row != column:
            table[column][row] *= factor

    return change


def another_loop(motion: Document, _: Document) -> None:
    disc = design.InertiaDisc(motion["centre"], motion["radius"], np.array(motion["shape"]))
    found = moving_lyapunov(as_law(multiple_pole_loop(100, 2500, 5e-4, 5e-4)), disc, motion["longest_delay_samples"])
    assert found is not None
    motion["lyapunov"] = found.to_document()


def swapped(motion: Document, _: Document) -> None:
    function = motion["lyapunov"]
    function["no_delay"], function["longest_delay"] = function["longest_delay"], function["no_delay"]


MUTANTS: dict[str, Callable[[Document, Document], None]] = {
    "sign on the diagonal": entry("no_delay", 7, 7, -1.0),
    "sign beside the diagonal": entry("no_delay", 0, 2, -1.0),
    "sign at the longest delay": entry("longest_delay", 1, 3, -1.0),
    "scale of an entry": entry("longest_delay", 4, 4, 1.05),
    "scale of a small entry": entry("no_delay", 7, 7, 0.5),
    "function of another loop": another_loop,
    "ends exchanged": swapped,
    "longer delay": lambda motion, _: motion.update(longest_delay_samples=0.52),
    "larger disc": lambda motion, _: motion.update(radius=1.03 * motion["radius"]),
    "another centre": lambda motion, _: motion.update(centre=1.1 * motion["centre"]),
    "multiplier negative": lambda motion, _: motion["lyapunov"].update(multiplier=-motion["lyapunov"]["multiplier"]),
    "multiplier too large": lambda motion, _: motion["lyapunov"].update(
        multiplier=9.0 * motion["lyapunov"]["multiplier"]
    ),
    "bound too large": entry("signals", 2, 2, 1.001),
    "bound not positive": entry("signals", 4, 4, -1.0),
    "bound of joints too large": entry("joints", 1, 1, 1.00001),
    "no bound": lambda _, law: law.pop("lyapunov_bound"),
    "bound without function": lambda motion, _: motion.pop("lyapunov"),
    "law without compensation": lambda _, law: law.update(disturbance_compensation=False),
    "other observer": lambda _, law: law["observer"].__setitem__(2, 1.02 * law["observer"][2]),
}


@pytest.mark.parametrize("mutant", MUTANTS)
def test_when_the_function_or_its_bound_is_not_true_expect_it_refused(mutant: str) -> None:
    document = changed(moving_five_bar(), MUTANTS[mutant])
    assert not is_function_proved(document)


def test_when_the_function_is_refused_expect_the_gate_not_passed() -> None:
    gate = robust_gate(changed(moving_five_bar(), MUTANTS["bound too large"]))
    assert gate.motion is False
    assert not gate.passed


def test_when_a_design_with_an_unproved_function_is_to_be_released_expect_one_line() -> None:
    document = changed(moving_five_bar(), MUTANTS["ends exchanged"])
    with pytest.raises(ClaimError, match="one Lyapunov function for all motions is claimed, but not proved"):
        checked_artifact(replace(moving_design(), witness=document["witness"]))


def test_when_a_bound_comes_without_any_claim_expect_the_gate_not_passed() -> None:
    document = copy.deepcopy(moving_five_bar())
    document["witness"].pop("motion")
    assert robust_gate(document).motion is False


def test_when_an_artifact_carries_no_function_expect_the_lemma_to_do() -> None:
    document = changed(moving_five_bar(), lambda motion, law: (motion.pop("lyapunov"), law.pop("lyapunov_bound"))[0])
    assert robust_gate(document).motion is True


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (lambda motion, _: motion["lyapunov"]["no_delay"].pop(), "witness.motion.lyapunov.no_delay"),
        (lambda motion, _: motion["lyapunov"]["longest_delay"][0].__setitem__(1, 9.0), "lyapunov.longest_delay"),
        (lambda _, law: law["lyapunov_bound"]["signals"][0].__setitem__(1, 9.0), "law.lyapunov_bound.signals"),
        (lambda _, law: law["lyapunov_bound"].update(joints=[[1.0]]), "law.lyapunov_bound.joints"),
    ],
)
def test_when_the_function_is_malformed_expect_one_line(change: Any, field: str) -> None:
    document = changed(moving_five_bar(), change)
    with pytest.raises(InputError, match=f"{field}: got another matrix, expected symmetric"):
        is_function_proved(document)
