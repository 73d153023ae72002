"""One control step in C++ against the same step in numpy, law by law, on 1000 random inputs each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from quasilpv import _runtime
from quasilpv.errors import InputError
from quasilpv.polytopes import BlockPolytope
from reference.random_arms import SAMPLE_PERIOD_S, artifact_bytes, random_arm
from reference.serial_arm import SerialArm
from reference.step import (
    Answer,
    ComputedTorque,
    DobAcceleration,
    DobTorque,
    FloatArray,
    HinfTracking,
    OutputStage,
    Pid,
    Sample,
    SpeedFilter,
    StateFeedback,
    Window,
)

RELATIVE_TOLERANCE = 1e-12  # of the largest summand: observer gains make single summands large
RUNS, STEPS_PER_RUN = 200, 5
PERIODS = 3 * STEPS_PER_RUN  # of a run of `delayed-feedback`, longer than its moving window
FILTER_S = 2e-3

Reference = DobAcceleration | DobTorque | HinfTracking | StateFeedback | Pid | ComputedTorque
Builder = Callable[[SerialArm, np.random.Generator, OutputStage], tuple[dict[str, Any], Callable[[], Reference]]]


def fresh(output: OutputStage) -> OutputStage:
    return OutputStage(output.torque_nm, output.slew_nm_per_s, output.T)


def speed_filter() -> SpeedFilter:
    return SpeedFilter(float(np.exp(-SAMPLE_PERIOD_S / FILTER_S)))


def dob_acceleration(compensate: bool) -> Builder:
    def build(
        arm: SerialArm, rng: np.random.Generator, output: OutputStage
    ) -> tuple[dict[str, Any], Callable[[], Reference]]:
        wc, wo = rng.uniform(20, 90), rng.uniform(400, 1600)
        kp, kd, ki = -3 * wc**2, -3 * wc, -(wc**3)
        pole = np.exp(-wo * SAMPLE_PERIOD_S)
        observer = (1 - pole**4, wo * (1 - pole), wo**2 / 2 * (1 - pole), wo**3 / 3 * (1 - pole))
        law = {
            "kind": "dob-acceleration",
            "feedback": {"kp": kp, "kd": kd, "ki": ki},
            "observer": list(observer),
            "filter_time_constant_s": 1e-3,
            "disturbance_compensation": compensate,
        }
        return law, lambda: DobAcceleration(
            kp, kd, ki, observer, 1e-3, arm.mass_matrix, arm.gravity_torque, fresh(output), compensate
        )

    return build


def pid(
    arm: SerialArm, rng: np.random.Generator, output: OutputStage
) -> tuple[dict[str, Any], Callable[[], Reference]]:
    n = len(arm.links)
    kp, kd, ki = rng.uniform(1e3, 1e5, n), rng.uniform(1e2, 1e4, n), rng.uniform(1e3, 1e6, n)
    friction = np.array([link.friction_nm_s for link in arm.links])
    law = {
        "kind": "pid",
        **{name: gain.tolist() for name, gain in (("kp", kp), ("kd", kd), ("ki", ki))},
        "velocity_filter_time_constant_s": FILTER_S,
    }

    def coriolis(y: FloatArray, w: FloatArray, v: FloatArray) -> FloatArray:
        return arm.coriolis_torque(y, w, v) + friction * v

    return law, lambda: Pid(kp, kd, ki, arm.mass_matrix, coriolis, arm.gravity_torque, speed_filter(), fresh(output))


def computed_torque(bandwidth: float) -> Builder:
    def build(
        arm: SerialArm, rng: np.random.Generator, output: OutputStage
    ) -> tuple[dict[str, Any], Callable[[], Reference]]:
        n = len(arm.links)
        gp, gd, gi = rng.uniform(1e3, 1e4, n), rng.uniform(50, 200, n), rng.uniform(1e4, 1e5, n)
        law = {
            "kind": "ctc-dob" if bandwidth else "ctc",
            **{name: gain.tolist() for name, gain in (("gp", gp), ("gd", gd), ("gi", gi))},
            "velocity_filter_time_constant_s": FILTER_S,
            "disturbance_observer_bandwidth_rad_s": bandwidth,
        }

        def coriolis(y: FloatArray, w: FloatArray) -> FloatArray:
            return arm.coriolis_torque(y, w) + arm.friction_torque(w)

        return law, lambda: ComputedTorque(
            gp, gd, gi, bandwidth, arm.mass_matrix, coriolis, arm.gravity_torque, speed_filter(), fresh(output)
        )

    return build


@dataclass(frozen=True, eq=False)
class Scheduled:
    """An affine matrix in the cosines an arm's inertia depends on, as a table and as a function of the angles."""

    affine: FloatArray
    joints: int

    @property
    def table(self) -> dict[str, Any]:
        count = len(self.affine) - 1
        polytope = BlockPolytope.per_premise([-1.0] * count, [1.0] * count)
        return polytope.to_document(polytope.vertices(self.affine[0], self.affine[1:]))

    def at(self, y: FloatArray) -> FloatArray:
        alpha, n = np.cumsum(y), self.joints
        z = [np.cos(alpha[k + gap] - alpha[k]) for gap in range(1, n) for k in range(n - gap)]
        return np.asarray(self.affine[0] + np.tensordot(z, self.affine[1:], axes=1))


def near_one(joints: int, rng: np.random.Generator) -> FloatArray:
    """A random affine matrix near the identity, in the cosines of an arm."""
    count = joints * (joints - 1) // 2
    return np.asarray(np.eye(joints) + 0.1 * rng.normal(size=(count + 1, joints, joints)))


def dob_torque(
    arm: SerialArm, rng: np.random.Generator, output: OutputStage
) -> tuple[dict[str, Any], Callable[[], Reference]]:
    n = len(arm.links)
    one = near_one(n, rng)
    feedback = Scheduled(np.concatenate([-gain * one for gain in (5e3, 150.0, 6e4)], axis=2), n)
    observer = Scheduled(np.concatenate([gain * one for gain in (2.4e3, 2e6, 8e8, 1e11)], axis=1), n)
    law = {
        "kind": "dob-torque",
        "feedback": feedback.table,
        "observer": observer.table,
        "filter_time_constant_s": 1e-3,
    }
    return law, lambda: DobTorque(feedback.at, observer.at, 1e-3, arm.mass_matrix, arm.gravity_torque, fresh(output))


def premultiplied_dob_torque(
    arm: SerialArm, rng: np.random.Generator, output: OutputStage
) -> tuple[dict[str, Any], Callable[[], Reference]]:
    law, build = dob_torque(arm, rng, output)
    affine = np.triu(near_one(len(arm.links), rng), 1)
    affine[0] += np.eye(len(arm.links))
    beta = Scheduled(affine, len(arm.links))

    def premultiplied() -> Reference:
        reference = build()
        assert isinstance(reference, DobTorque)
        return replace(reference, premultiplication=beta.at)

    return {**law, "premultiplication": beta.table}, premultiplied


def hinf_tracking(
    arm: SerialArm, rng: np.random.Generator, output: OutputStage
) -> tuple[dict[str, Any], Callable[[], Reference]]:
    n = len(arm.links)
    one = near_one(n, rng)
    numerator = Scheduled(np.concatenate([-gain * one for gain in (4e3, 9e4, 7e2)], axis=2), n)
    root = np.diag(np.repeat([1.0, 30.0, 1.0 / 30.0], n)) @ (np.eye(3 * n) + 0.1 * rng.normal(size=(3 * n, 3 * n)))
    lyapunov = (root @ root.T + (root @ root.T).T) / 2.0
    law = {
        "kind": "hinf-tracking",
        "numerator": numerator.table,
        "lyapunov": lyapunov.tolist(),
        "velocity_filter_time_constant_s": FILTER_S,
    }
    return law, lambda: HinfTracking(numerator.at, lyapunov, arm.mass_matrix, speed_filter(), fresh(output))


BOUNDS = np.array([1.0, 6.0])
"""Of the schedule cos(theta_2), omega_1 sin(theta_2): random speeds leave the second interval."""


def schedule_weights(y: FloatArray, w: FloatArray) -> FloatArray:
    """Weights of the four vertices of two blocks, from the definition."""
    z = np.clip([np.cos(y[1]), w[0] * np.sin(y[1])], -BOUNDS, BOUNDS)
    upper = (z + BOUNDS) / (2.0 * BOUNDS)
    return np.column_stack([1.0 - upper, upper]).ravel() / 2.0


def schedule_table(vertices: FloatArray) -> dict[str, Any]:
    return BlockPolytope.per_premise(-BOUNDS, BOUNDS).to_document(vertices)


def random_gains(count: int, n: int, rng: np.random.Generator) -> FloatArray:
    stiff = np.hstack([-3000.0 * np.eye(n), -200.0 * np.eye(n)])
    return np.asarray(stiff * rng.uniform(0.5, 1.5, (count, 1, 1)) + rng.normal(0.0, 30.0, (count, n, 2 * n)))


def random_lyapunov(count: int, n: int, rng: np.random.Generator) -> FloatArray:
    root = np.eye(2 * n) + 0.15 * rng.normal(size=(count, 2 * n, 2 * n))
    square = root @ root.swapaxes(1, 2)
    return np.asarray((square + square.swapaxes(1, 2)) / 2.0)


def descriptor(arm: SerialArm, y: FloatArray) -> FloatArray:
    n = len(arm.links)
    E = np.eye(2 * n)
    E[n:, n:] = arm.mass_matrix(y)
    return E


def state_feedback(
    arm: SerialArm, rng: np.random.Generator, output: OutputStage
) -> tuple[dict[str, Any], Callable[[], Reference]]:
    gains = random_gains(4, len(arm.links), rng)
    law = {"kind": "state-feedback", "gain": schedule_table(gains), "velocity_filter_time_constant_s": FILTER_S}

    def gain(y: FloatArray, w: FloatArray) -> FloatArray:
        return np.asarray(np.tensordot(schedule_weights(y, w), gains, axes=1))

    return law, lambda: StateFeedback(gain, speed_filter(), fresh(output))


def descriptor_feedback(
    arm: SerialArm, rng: np.random.Generator, output: OutputStage
) -> tuple[dict[str, Any], Callable[[], Reference]]:
    n = len(arm.links)
    numerators, lyapunov = random_gains(4, n, rng), random_lyapunov(1, n, rng)[0]
    law = {
        "kind": "descriptor-feedback",
        "numerator": schedule_table(numerators),
        "lyapunov": lyapunov.tolist(),
        "velocity_filter_time_constant_s": FILTER_S,
    }

    def gain(y: FloatArray, w: FloatArray) -> FloatArray:
        F = np.tensordot(schedule_weights(y, w), numerators, axes=1)
        return np.asarray(F @ np.linalg.inv(lyapunov @ descriptor(arm, y).T))

    return law, lambda: StateFeedback(gain, speed_filter(), fresh(output))


def delayed_feedback(periods: int, *, regular: bool) -> Builder:
    def build(
        arm: SerialArm, rng: np.random.Generator, output: OutputStage
    ) -> tuple[dict[str, Any], Callable[[], Reference]]:
        n = len(arm.links)
        numerators, lyapunov = random_gains(64, n, rng), random_lyapunov(4, n, rng)
        law = {
            "kind": "delayed-feedback",
            "lyapunov": schedule_table(lyapunov),
            "numerators": numerators.tolist(),
            "window_samples": periods,
            "descriptor": regular,
            "velocity_filter_time_constant_s": FILTER_S,
        }

        def start() -> Reference:
            window = Window(periods)

            def gain(y: FloatArray, w: FloatArray) -> FloatArray:
                weights = schedule_weights(y, w)
                mean, delayed = window.moved(weights)
                F = np.einsum("j,k,m,jkmab->ab", weights, mean, delayed, numerators.reshape(4, 4, 4, n, 2 * n))
                P = np.tensordot(mean, lyapunov, axes=1)
                return np.asarray(F @ np.linalg.inv(P @ descriptor(arm, y).T if regular else P))

            return StateFeedback(gain, speed_filter(), fresh(output))

        return law, start

    return build


LAWS: dict[str, Builder] = {
    "dob-acceleration": dob_acceleration(compensate=True),
    "dob-acceleration without compensation": dob_acceleration(compensate=False),
    "dob-torque": dob_torque,
    "dob-torque with a premultiplication": premultiplied_dob_torque,
    "hinf-tracking": hinf_tracking,
    "state-feedback": state_feedback,
    "descriptor-feedback": descriptor_feedback,
    "delayed-feedback": delayed_feedback(5, regular=True),
    "delayed-feedback without E": delayed_feedback(5, regular=False),
    "delayed-feedback in the limit of a short window": delayed_feedback(0, regular=True),
    "pid": pid,
    "ctc": computed_torque(0.0),
    "ctc-dob": computed_torque(200.0),
}


def random_sample(joints: int, rng: np.random.Generator) -> Sample:
    reference = rng.uniform(-3, 3, joints)
    return Sample(
        angle=reference + rng.normal(0, 1e-3, joints),
        speed=rng.normal(0, 2, joints),
        reference_angle=reference,
        reference_speed=rng.normal(0, 2, joints),
        reference_acceleration=rng.normal(0, 5, joints),
    )


def step_both(controller: _runtime.Controller, reference: Reference, s: Sample) -> tuple[_runtime.StepReport, Answer]:
    report = controller.step(s.angle, s.reference_angle, s.reference_speed, s.reference_acceleration, s.speed)
    return report, reference.step(s)


@pytest.mark.parametrize("limits", ["wide", "tight"])
@pytest.mark.parametrize("joints", [2, 3])
@pytest.mark.parametrize("name", LAWS)
def test_when_inputs_are_random_expect_the_step_of_the_formulas(name: str, joints: int, limits: str) -> None:
    rng = np.random.default_rng(20240 + joints)
    arm, numpy_arm = random_arm(joints, rng)
    bounds = {"wide": (1e12, 1e18), "tight": (300.0, 4e4)}[limits]
    output = OutputStage(np.full(joints, bounds[0]), np.full(joints, bounds[1]), SAMPLE_PERIOD_S)
    law, make_reference = LAWS[name](numpy_arm, rng, output)
    table = {"torque_nm": output.torque_nm.tolist(), "slew_nm_per_s": output.slew_nm_per_s.tolist()}
    controller = _runtime.Controller(_runtime.Artifact.parse(artifact_bytes(arm, law, table)))
    limited = 0
    steps = PERIODS if law["kind"] == "delayed-feedback" else STEPS_PER_RUN
    for _ in range(RUNS):
        controller.reset()
        reference = make_reference()
        scale = 0.0
        for _ in range(steps):
            report, answer = step_both(controller, reference, random_sample(joints, rng))
            scale = max(scale, answer.scale)  # the state carries what earlier summands rounded off
            for mine, theirs in (
                (report.torque_commanded, answer.torque_commanded),
                (report.torque_applied, answer.torque_applied),
                (report.estimated_disturbance, answer.estimated_disturbance),
            ):
                np.testing.assert_allclose(mine[:joints], theirs, rtol=0, atol=RELATIVE_TOLERANCE * scale)
            limited += int(np.any(answer.torque_applied != answer.torque_commanded))
    assert (limited > 0) == (limits == "tight")


@pytest.mark.parametrize("joints", [1, 2, 3, 4])
def test_when_angles_are_random_expect_premises_inertia_and_gravity_of_the_python_model(joints: int) -> None:
    rng = np.random.default_rng(7 + joints)
    arm, numpy_arm = random_arm(joints, rng)
    law, _ = LAWS["ctc"](numpy_arm, rng, OutputStage(np.ones(joints), np.ones(joints), SAMPLE_PERIOD_S))
    limits = {"torque_nm": [1e3] * joints, "slew_nm_per_s": [1e6] * joints}
    artifact = _runtime.Artifact.parse(artifact_bytes(arm, law, limits))
    affine = arm.inertia_affine()
    for _ in range(1000):
        angle, speed = rng.uniform(-3.2, 3.2, joints), rng.normal(0, 3, joints)
        alpha = np.cumsum(angle)
        expected = [np.cos(alpha[k + gap] - alpha[k]) for gap in range(1, joints) for k in range(joints - gap)]
        premise = artifact.premises(angle)
        np.testing.assert_allclose(premise, expected, rtol=0, atol=1e-12)
        scale = np.abs(affine.constant).max() + np.abs(affine.coefficients).sum()
        np.testing.assert_allclose(artifact.inertia(premise), arm.inertia(angle), rtol=0, atol=1e-12 * scale)
        gravity_scale = np.abs(arm.gravity_constants).sum()
        np.testing.assert_allclose(artifact.gravity(angle), arm.gravity(angle), rtol=0, atol=1e-12 * gravity_scale)
        coriolis = arm.coriolis(angle, speed)
        coriolis_scale = (
            np.abs(arm.inertia_constants).sum() * np.abs(np.cumsum(speed)).max() ** 2 + np.abs(coriolis).max()
        )
        mine = artifact.coriolis(angle, speed, speed)
        np.testing.assert_allclose(mine, coriolis, rtol=0, atol=1e-12 * coriolis_scale)


def test_when_an_array_has_the_wrong_length_expect_one_line_naming_it() -> None:
    rng = np.random.default_rng(1)
    arm, numpy_arm = random_arm(2, rng)
    law, _ = pid(numpy_arm, rng, OutputStage(np.ones(2), np.ones(2), SAMPLE_PERIOD_S))
    limits = {"torque_nm": [1e3] * 2, "slew_nm_per_s": [1e6] * 2}
    controller = _runtime.Controller(_runtime.Artifact.parse(artifact_bytes(arm, law, limits)))
    with pytest.raises(InputError, match=r"reference_speed: got shape \(3,\), expected shape \(2,\)"):
        controller.step([0, 0], [0, 0], [0, 0, 0], [0, 0], [0, 0])
