"""The design of `dob-torque`: its frozen loop against the law run sample by sample, the gate, and what it ships."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.artifact import Artifact
from quasilpv.documents.canonical import canonical_cbor, canonical_json
from quasilpv.errors import InfeasibleError
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import track
from quasilpv.loops.frozen_loop import FrozenLoop
from quasilpv.loops.torque_law import TorqueLaw
from quasilpv.release import Release, release, to_artifact
from quasilpv.scenarios import Sensors, tracking_experiment
from quasilpv.synthesis import DesignRequest, Specification
from quasilpv.synthesis.plant_grid import PlantGrid
from quasilpv.synthesis.torque.design import TorqueDesign, design_torque_law, holds_exactly
from quasilpv.synthesis.torque.law import tracking_design
from quasilpv.synthesis.torque.schedule import ScheduledPlants, schedule
from quasilpv.systems.robots.registry import robot
from reference.step import DobTorque, OutputStage, Sample

RATE_HZ = 4000.0


@lru_cache(maxsize=1)
def designed() -> TorqueDesign:
    return design_torque_law(robot("arm3"), Specification(rate_hz=RATE_HZ))


@lru_cache(maxsize=1)
def released() -> Release:
    return release(DesignRequest.of("arm2", "dob-torque", Specification(rate_hz=RATE_HZ)))


# ---- the frozen loop -------------------------------------------------------------------------------------------------


class SampledPlant:
    """M_t theta'' = gamma + d, the torque of sample k acting from t_k + delay: exact zero-order-hold segments."""

    def __init__(self, inertia: FloatArray, T: float, delay: float) -> None:
        n = len(inertia)
        self.mobility, self.T, self.delay = np.linalg.inv(inertia), T, delay
        self.theta, self.omega, self.held = np.zeros(n), np.zeros(n), np.zeros(n)

    def advance(self, torque: FloatArray, disturbance: FloatArray) -> None:
        for duration, acting in ((self.delay, self.held), (self.T - self.delay, torque)):
            acceleration = self.mobility @ (acting + disturbance)
            self.theta = self.theta + duration * self.omega + duration**2 / 2 * acceleration
            self.omega = self.omega + duration * acceleration
        self.held = torque


def random_loop(delay_samples: float) -> tuple[TorqueLaw, FloatArray, float]:
    rng = np.random.default_rng(5)
    n, T = 2, 1e-3
    M = np.array([[3.0, 0.7], [0.7, 1.5]])
    near_one = [np.eye(n) + 0.05 * rng.normal(size=(n, n)) for _ in range(7)]
    K = np.hstack([-gain * M @ x for gain, x in zip((4800.0, 120.0, 64000.0), near_one, strict=False)])
    L = np.vstack([2400 * near_one[3], 2e6 * near_one[4], 8e8 * M @ near_one[5], 1e11 * M @ near_one[6]])
    plant = M + np.diag([1.0, 0.4])
    return TorqueLaw(T, 1.5e-3, M[None], K[None], L[None]), plant[None], delay_samples * T


def run(
    law: TorqueLaw, plant: FloatArray, delay: float, samples: int, *, disturb: FloatArray, noise: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Angles and torques of the law run from rest with an impulse of one sample in the disturbance or the angle."""
    n, T = len(plant[0]), law.sample_period_s
    loop = SampledPlant(plant[0], T, delay)
    zero = np.zeros(n)
    controller = DobTorque(
        lambda y: law.feedback[0],
        lambda y: law.observer[0],
        law.filter_time_constant_s,
        lambda y: law.inertia[0],
        lambda y: zero,
        OutputStage(np.full(n, 1e12), np.full(n, 1e18), T),
        x=np.zeros(4 * n),
    )
    angles, torques = [], []
    for k in range(samples):
        angles.append(loop.theta)
        y = loop.theta + (noise if k == 0 else 0.0)
        torques.append(controller.step(Sample(y, zero, zero, zero, zero)).torque_applied)
        loop.advance(torques[-1], disturb if k == 0 else zero)
    return np.array(angles), np.array(torques)


@pytest.mark.parametrize("delay_samples", [0.0, 0.5])
def test_when_the_law_is_run_sample_by_sample_expect_the_powers_of_the_transition(delay_samples: float) -> None:
    law, plant, delay = random_loop(delay_samples)
    loop = FrozenLoop(law, plant, delay)
    for unit in np.eye(2):
        angles, torques = run(law, plant, delay, 60, disturb=unit, noise=0 * unit)
        state = loop.drive[0] @ unit
        for k in range(1, 60):
            np.testing.assert_allclose(state[:2], angles[k], rtol=1e-8, atol=1e-12 * np.abs(angles).max())
            np.testing.assert_allclose(loop.torque[0] @ state, torques[k], rtol=1e-7, atol=1e-9 * np.abs(torques).max())
            state = loop.transition[0] @ state


@pytest.mark.parametrize("delay_samples", [0.0, 0.5])
def test_when_impulse_responses_are_summed_expect_the_disturbance_gain_and_the_torque_activity(
    delay_samples: float,
) -> None:
    law, plant, delay = random_loop(delay_samples)
    loop = FrozenLoop(law, plant, delay)
    assert loop.growth_rates()[0] < -10.0
    samples, frequency = 1500, 30.0
    phase = np.exp(-1j * frequency * law.sample_period_s * np.arange(samples))
    columns = [run(law, plant, delay, samples, disturb=unit, noise=0 * unit)[0].T @ phase for unit in np.eye(2)]
    expected = np.linalg.norm(np.array(columns).T, ord=2)
    assert loop.disturbance_gains(frequency)[0] == pytest.approx(expected, rel=1e-5)
    torques = [run(law, plant, delay, samples, disturb=0 * unit, noise=unit)[1] for unit in np.eye(2)]
    increments = [np.diff(torque, axis=0, prepend=0.0 * torque[:1]) for torque in torques]
    assert loop.torque_activity([1.0])[0] == pytest.approx(
        np.sqrt(sum((step**2).sum() for step in increments)), rel=1e-5
    )


# ---- the choice of premises ------------------------------------------------------------------------------------------


def test_when_an_arm_is_scheduled_expect_definite_vertices_of_its_inertia_and_the_widest_premise_left_out() -> None:
    chosen = schedule(robot("arm3"))
    assert [str(premise.expression) for premise in chosen.premises] == ["cos(theta_3)", "cos(theta_2 + theta_3)"]
    assert np.linalg.eigvalsh(chosen.inertia).min() > 0.3
    assert [str(premise.expression) for premise in schedule(robot("arm2")).premises] == ["cos(theta_2)"]
    model, theta_2 = robot("arm2").model, 0.3
    inertia = schedule(robot("arm2")).polytope.evaluate(schedule(robot("arm2")).inertia, np.array([np.cos(theta_2)]))
    np.testing.assert_allclose(inertia, model.inertia([0.0, theta_2]), atol=1e-12)


# ---- what the design claims ------------------------------------------------------------------------------------------


def test_when_the_arm_is_designed_expect_exact_inequalities_that_a_changed_gain_breaks() -> None:
    design = designed()
    assert holds_exactly(design.law, design.feedback, design.observer)
    K, L = design.feedback.gains.copy(), design.observer.gains.copy()
    K[1, 0, 3] *= 1.5  # Kd of the first joint at one vertex
    assert not holds_exactly(design.law, replace(design.feedback, gains=K), design.observer)
    L[2, 6, 0] *= 0.5
    assert not holds_exactly(design.law, design.feedback, replace(design.observer, gains=L))


def test_when_5000_points_of_the_box_are_drawn_expect_no_violation_of_what_was_certified() -> None:
    design = designed()
    polytope, law = design.law.polytope, design.law
    rng = np.random.default_rng(8)
    frozen = law.at(rng.uniform(polytope.lower, polytope.upper, (5000, polytope.premises)))
    n = law.inertia.shape[1]
    mobility = np.linalg.inv(frozen.inertia)
    A = np.zeros((5000, 3 * n, 3 * n))
    A[:, :n, n : 2 * n] = A[:, 2 * n :, :n] = np.eye(n)
    A[:, n : 2 * n] = mobility @ frozen.feedback
    check(A, np.asarray(np.linalg.inv(design.feedback.P), dtype=float), design.feedback.decay, design.feedback.disk)
    A = np.zeros((5000, 4 * n, 4 * n))
    A[:, :n, n : 2 * n] = A[:, 2 * n : 3 * n, 3 * n :] = np.eye(n)
    A[:, n : 2 * n, 2 * n : 3 * n] = mobility
    A[:, :, :n] -= frozen.observer
    check(A, design.observer.Q, design.observer.decay, design.observer.disk)


def check(A: FloatArray, lyapunov: FloatArray, decay: float, disk: float) -> None:
    """V = x' X x decays at least at the rate, and A is a contraction of ratio ``disk`` in its norm."""
    scale = 1.0 / np.sqrt(np.diag(lyapunov))  # the verdict does not depend on it, the rounding does
    X = lyapunov * np.outer(scale, scale)
    B = A * scale / scale[:, None]
    flow = X @ B
    assert np.linalg.eigvalsh(flow + flow.swapaxes(1, 2) + 2 * decay * X).max() < 0
    assert np.linalg.eigvalsh(B.swapaxes(1, 2) @ X @ B - disk**2 * X).max() < 0


def test_when_the_grid_is_evaluated_again_expect_the_reported_rates_and_other_gains_unstable() -> None:
    design = designed()
    delay = 0.5 / RATE_HZ
    plants = ScheduledPlants.of(robot("arm3"), design.schedule, PlantGrid.full(robot("arm3")))
    loops = plants.loops(design.law)
    worst = max(loops.worst(delay_s=d).growth_rate_per_s for d in (0.0, delay))
    assert worst == pytest.approx(design.report()["worst_growth_rate_per_s"], rel=1e-6)
    assert worst < 0.0
    assert all(loops.is_stable(factor, delay) for factor in (1 / 1.1, 1.1))
    assert not plants.loops(replace(design.law, feedback=5.0 * design.law.feedback)).is_stable(delay_s=delay)


@pytest.mark.full
def test_when_the_arm_tracks_the_default_scenarios_expect_the_required_accuracy(tmp_path: Path) -> None:
    artifact = to_artifact(tracking_design(robot("arm3"), Specification(rate_hz=RATE_HZ), designed()))
    for scenario in ("serial-square", "serial-circle"):
        experiment = tracking_experiment(scenario)
        result = track(RunSetup(experiment, artifact, plant="perturbed", sensors=Sensors()), tmp_path / scenario)
        metrics = result.metrics
        assert max(metrics.rms_x_m, metrics.rms_y_m) <= 4e-4
        assert max(metrics.mav_x_m, metrics.mav_y_m) <= 7e-4
        assert result.worst_growth_rate_per_s is not None
        assert result.worst_growth_rate_per_s < 0.0


# ---- the artifact ----------------------------------------------------------------------------------------------------


def test_when_the_artifact_is_written_expect_both_twins_to_load_on_both_sides() -> None:
    artifact = released().artifact
    assert artifact.law.kind == "dob-torque"
    document = artifact.to_document()
    assert Artifact.from_document(document).hash == artifact.hash
    for data in (canonical_json(document), canonical_cbor(document)):
        assert _runtime.Artifact.parse(data).hash == artifact.hash


def test_when_the_report_is_read_expect_numbers_a_person_asks_for() -> None:
    report = released().report
    assert report["worst_growth_rate_per_s"] < 0
    assert report["inequalities_verified_exactly"] is True
    assert report["feedback_disk_rad_s"] < report["observer_disk_rad_s"]
    assert max(report["growth_rates_per_s"].values()) < 0


def test_when_a_witness_is_shipped_expect_the_points_of_both_conditions() -> None:
    witness = released().artifact.witness
    assert witness is not None
    assert np.linalg.eigvalsh(np.array(witness["feedback"]["P"])).min() > 0
    assert np.shape(witness["observer"]["Q"]) == (8, 8)
    assert {np.shape(F) for F in witness["observer"]["multipliers"].values()} == {(10, 2)}


def test_when_nothing_is_quiet_enough_expect_one_line_that_says_so() -> None:
    with pytest.raises(
        InfeasibleError, match=r"arm2: no dob-torque design at 4000 Hz: encoder .* N m rms, the quietest"
    ):
        design_torque_law(robot("arm2"), Specification(rate_hz=RATE_HZ, torque_activity=1e-6))
