"""The tuned baselines: their frozen loop against the laws run sample by sample, the search, and what it ships."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from quasilpv import scenarios
from quasilpv.arrays import FloatArray
from quasilpv.errors import InfeasibleError
from quasilpv.loops.frozen_loop import FrozenLoop
from quasilpv.loops.velocity_law import VelocityLaw
from quasilpv.progress import no_progress
from quasilpv.release import Release, release
from quasilpv.synthesis import CONTROLLERS, DesignRequest, Specification, specification
from quasilpv.synthesis.acceleration.design import design_acceleration_law
from quasilpv.synthesis.baselines import printed as baselines
from quasilpv.synthesis.baselines import tuned as tuned_baselines
from quasilpv.synthesis.baselines import tuning_search
from quasilpv.synthesis.plant_grid import PlantGrid
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.robots.registry import robot
from reference.step import ComputedTorque, OutputStage, Pid, Sample, SpeedFilter

TUNED = ("pid-tuned", "ctc-tuned", "ctc-dob-tuned")
ONE_SEARCH = [pytest.param(name, marks=() if name == "ctc-tuned" else pytest.mark.full) for name in TUNED]
"""A search takes seconds, and is the same for all: the quick tier makes one."""
T = 1e-3
FILTER_S = 2e-3
DESIGN_INERTIA = np.array([[3.0, 0.7], [0.7, 1.5]])
PLANT_INERTIA = DESIGN_INERTIA + np.diag([1.0, 0.4])
ZERO = np.zeros(2)
# Unequal per joint, so that a transposed or a joint-wise product would show.
KP, KD, KI = (np.diag(gain * np.array([1.0, 1.3])) for gain in (4800.0, 120.0, 40_000.0))


# ---- the frozen loop -------------------------------------------------------------------------------------------------


def frozen(kind: str) -> VelocityLaw:
    gains = (KP, KD, KI) if kind == "pid" else tuple(DESIGN_INERTIA @ gain for gain in (KP, KD, KI))
    bandwidth = 40.0 if kind == "ctc-dob" else 0.0
    return VelocityLaw(T, *(gain[None] for gain in gains), DESIGN_INERTIA[None], FILTER_S, bandwidth)


def reference_law(kind: str) -> Pid | ComputedTorque:
    """The law as documented, without limits, gravity and Coriolis torque."""
    output = OutputStage(np.full(2, 1e12), np.full(2, 1e18), T)
    speed_filter = SpeedFilter(float(np.exp(-T / FILTER_S)))
    gains = KP.diagonal(), KD.diagonal(), KI.diagonal()
    if kind == "pid":
        return Pid(*gains, lambda y: DESIGN_INERTIA, lambda y, w, r: ZERO, lambda y: ZERO, speed_filter, output)
    bandwidth = 40.0 if kind == "ctc-dob" else 0.0
    return ComputedTorque(
        *gains, bandwidth, lambda y: DESIGN_INERTIA, lambda y, w: ZERO, lambda y: ZERO, speed_filter, output
    )


def impulse(kind: str, delay: float, samples: int, source: str, joint: int) -> tuple[FloatArray, FloatArray]:
    """Angles and torques after an impulse of one sample in the disturbance torque, a measured angle or speed."""
    law, unit = reference_law(kind), np.eye(2)[joint]
    law.step(Sample(ZERO, ZERO, ZERO, ZERO, ZERO))  # starts the filter at rest
    theta, omega, held = ZERO, ZERO, ZERO
    angles, torques = [], []
    for k in range(samples):
        angles.append(theta)
        error = {name: unit if name == source and k == 0 else ZERO for name in ("disturbance", "angle", "speed")}
        torque = law.step(Sample(theta + error["angle"], omega + error["speed"], ZERO, ZERO, ZERO)).torque_applied
        torques.append(torque)
        for duration, acting in ((delay, held), (T - delay, torque)):
            acceleration = np.linalg.solve(PLANT_INERTIA, acting + error["disturbance"])
            theta, omega = theta + duration * omega + duration**2 / 2 * acceleration, omega + duration * acceleration
        held = torque
    return np.array(angles), np.array(torques)


@pytest.mark.parametrize("kind", ["pid", "ctc", "ctc-dob"])
@pytest.mark.parametrize("delay_samples", [0.0, 0.5])
def test_when_a_law_is_run_sample_by_sample_expect_the_powers_of_the_transition(
    kind: str, delay_samples: float
) -> None:
    loop = FrozenLoop(frozen(kind), PLANT_INERTIA[None], delay_samples * T)
    starts = {
        "disturbance": loop.drive[0],
        "angle": loop.noise[0, :, :2],
        "speed": loop.noise[0, :, 2:],
    }
    for source, effect in starts.items():
        for joint in range(2):
            angles, torques = impulse(kind, delay_samples * T, 50, source, joint)
            state = effect[:, joint]
            for k in range(1, 50):
                np.testing.assert_allclose(state[:2], angles[k], rtol=1e-7, atol=1e-10 * np.abs(angles).max())
                expected = torques[k]
                np.testing.assert_allclose(loop.torque[0] @ state, expected, atol=1e-8 * np.abs(torques).max())
                state = loop.transition[0] @ state


@pytest.mark.parametrize("kind", ["pid", "ctc", "ctc-dob"])
def test_when_impulse_responses_are_summed_expect_the_disturbance_gain_and_the_torque_activity(kind: str) -> None:
    loop = FrozenLoop(frozen(kind), PLANT_INERTIA[None])
    assert loop.growth_rates()[0] < -5.0
    samples, frequency = 3000, 20.0
    phase = np.exp(-1j * frequency * T * np.arange(samples))
    response = np.array([impulse(kind, 0.0, samples, "disturbance", j)[0].T @ phase for j in range(2)]).T
    unit = np.linalg.cholesky(DESIGN_INERTIA)
    expected = np.linalg.norm(unit.T @ response @ unit, ord=2)
    assert loop.disturbance_gains(frequency, unit[None])[0] == pytest.approx(expected, rel=1e-5)
    deviations = {"angle": 1e-6, "speed": 0.05}
    variance = 0.0
    for source, deviation in deviations.items():
        for joint in range(2):
            torques = impulse(kind, 0.0, samples, source, joint)[1]
            variance += float((np.diff(torques, axis=0, prepend=0.0 * torques[:1]) ** 2).sum()) * deviation**2
    assert loop.torque_activity(list(deviations.values()))[0] == pytest.approx(np.sqrt(variance), rel=1e-5)


def test_when_computed_torque_decouples_expect_the_scalar_loops_of_the_inertia_ratios() -> None:
    gain = baselines.Tuning(bandwidth_rad_s=60.0).unit_gains()
    joint = VelocityLaw(T, *(g * DESIGN_INERTIA[None] for g in gain), DESIGN_INERTIA[None], FILTER_S, 30.0)
    loop = FrozenLoop(joint, PLANT_INERTIA[None], 0.5 * T)
    ratios = np.linalg.eigvals(np.linalg.solve(DESIGN_INERTIA, PLANT_INERTIA)).real[:, None, None]
    ones = np.ones_like(ratios)
    scalar = VelocityLaw(T, *(g * ones for g in gain), ones, FILTER_S, 30.0)
    scalars = FrozenLoop(scalar, ratios, 0.5 * T)
    assert loop.growth_rates()[0] == pytest.approx(scalars.growth_rates().max(), abs=1e-6)
    unit = np.linalg.cholesky(DESIGN_INERTIA)[None]
    assert loop.disturbance_gains(20.0, unit)[0] == pytest.approx(scalars.disturbance_gains(20.0, ones).max())


# ---- the search ------------------------------------------------------------------------------------------------------


@cache
def tuned(controller: str) -> TrackingDesign:
    return CONTROLLERS[controller].design(robot("arm3"), Specification(), no_progress)


def performance(controller: str, tuning: baselines.Tuning) -> tuple[float, float, float]:
    """Growth rate, disturbance gain and torque increment on configurations the search has not seen."""
    arm, period = robot("arm3"), Specification().sample_period_s
    rng = np.random.default_rng(4)
    low, high = np.array(arm.domain.angle_rad).T
    angles = [rng.uniform(low, high) for _ in range(60)]
    nominal = np.array([arm.model.inertia(theta) for theta in angles])
    true = np.array([arm.with_payload_fraction(float(rng.uniform())).inertia(theta) for theta in angles])
    kp, kd, ki = tuning.unit_gains()
    if controller.startswith("pid"):
        per_joint = np.diag(tuning.inertia_scale * baselines.stretched_inertia(arm, tuning.payload_fraction))
        unit = np.broadcast_to(per_joint, nominal.shape)
    else:
        unit = tuning.inertia_scale * nominal
    law = VelocityLaw(
        period,
        kp * unit,
        kd * unit,
        ki * unit,
        tuning.inertia_scale * nominal,
        tuning.velocity_filter_time_constant_s,
        tuning.observer_bandwidth_rad_s,
    )
    loop = FrozenLoop(law, true)
    rates = [FrozenLoop(law, true, delay).growth_rates().max() for delay in (0.0, 0.5e-3)]
    gain = loop.disturbance_gains(20.0, np.asarray(np.linalg.cholesky(nominal), dtype=np.float64)).max()
    angle_noise = 2 * np.pi / 2**20 / np.sqrt(12)
    return max(rates), gain, loop.torque_activity([angle_noise, scenarios.VELOCITY_NOISE_RAD_S]).max()


def tuning_of(design: TrackingDesign) -> baselines.Tuning:
    names = baselines.Tuning.__dataclass_fields__
    return baselines.Tuning(**{name: design.report[name] for name in names})


@pytest.mark.parametrize("way", [-300.0, 300.0, 1e3])
def test_when_a_descent_asks_for_a_point_without_bounds_expect_a_measure_of_one_that_can_be(
    way: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm = robot("arm2")
    axes = {"bandwidth": (0.05,), "filter_time": (1.0,), "inertia_scale": (1.0,)}
    search = tuning_search.TuningSearch(
        arm, Specification(), tuned_baselines.pid_law, axes, PlantGrid.screen(arm), no_progress
    )
    point = {name: values[0] for name, values in axes.items()}
    start = tuning_search.Candidate(point, search.tuning(point), 1.0, 1.0)
    asked = []

    def far(objective: Callable[[FloatArray], float], origin: FloatArray, **_: object) -> None:
        asked.append(objective(origin + way))

    monkeypatch.setattr(tuning_search.scipy.optimize, "minimize", far)
    search._descend(start, 1)
    assert np.isfinite(asked).all()
    assert len(asked) == 1


@pytest.mark.parametrize("controller", ONE_SEARCH)
def test_when_a_baseline_is_tuned_expect_what_was_asked_for_at_configurations_it_has_not_seen(controller: str) -> None:
    design = tuned(controller)
    rate, gain, activity = performance(controller, tuning_of(design))
    limits = np.linalg.norm(robot("arm3").limits.torque_nm)
    assert rate < 0.0
    assert gain <= design.report["disturbance_gain_s2"] * 1.05
    assert activity <= 0.15 * limits * 1.02
    assert design.report["worst_growth_rate_per_s"] < 0.0


@pytest.mark.parametrize(
    ("controller", "admissible"), [("pid-tuned", False), ("ctc-tuned", True), ("ctc-dob-tuned", False)]
)
def test_when_the_gains_of_the_thesis_meet_the_same_bounds_expect_only_computed_torque_to_pass_and_the_tuned_to_win(
    controller: str, admissible: bool
) -> None:
    observer = {"ctc-dob-tuned": baselines.DISTURBANCE_OBSERVER_BANDWIDTH_RAD_S}.get(controller, 0.0)
    rate, gain, activity = performance(controller, baselines.Tuning.printed(robot("arm3"), observer))
    bound = 0.15 * np.linalg.norm(robot("arm3").limits.torque_nm)
    assert (rate < 0.0 and activity <= bound) == admissible
    if admissible:
        assert tuned(controller).report["disturbance_gain_s2"] < gain


@pytest.mark.full
def test_when_the_budget_is_counted_expect_that_of_the_default_design() -> None:
    default = design_acceleration_law(robot("arm3"), Specification())
    assert tuning_search.SCALES_PER_CANDIDATE * default.candidates_tried == tuning_search.SEARCH_BUDGET
    for controller in TUNED:  # a descent may converge before its share is spent
        assert tuned(controller).report["candidates_tried"] > 0.8 * tuning_search.SEARCH_BUDGET
        assert tuned(controller).report["candidates_tried"] <= tuning_search.SEARCH_BUDGET


@pytest.mark.full
def test_when_a_law_contains_another_as_a_limit_expect_its_search_to_find_nothing_worse() -> None:
    without, with_observer = (tuned(name).report["disturbance_gain_s2"] for name in ("ctc-tuned", "ctc-dob-tuned"))
    assert with_observer <= 1.01 * without


@pytest.mark.parametrize("controller", ONE_SEARCH)
def test_when_single_numbers_of_a_tuned_baseline_move_expect_no_better_admissible_one(controller: str) -> None:
    """A constrained optimum: every step of 5 % that lowers the objective by as much breaks a constraint."""
    chosen, plants = tuned(controller), PlantGrid.screen(robot("arm3"))
    law = tuned_baselines.pid_law if controller == "pid-tuned" else tuned_baselines.computed_torque_law
    search = tuning_search.TuningSearch(robot("arm3"), Specification(), law, {}, plants, no_progress)
    numbers = tuning_of(chosen)
    best = search.disturbance_gain(search.loops(numbers, plants), plants)
    for name in ("bandwidth_rad_s", "velocity_filter_time_constant_s", "inertia_scale"):
        for factor in (1.05, 1 / 1.05):
            moved = replace(numbers, **{name: factor * getattr(numbers, name)})
            loops = search.loops(moved, plants)
            if search.disturbance_gain(loops, plants) < 0.98 * best:
                assert not search.is_robust(loops) or search.torque_increment(loops) > search.activity_bound_nm


def test_when_the_noise_of_the_design_is_compared_with_the_scenarios_expect_the_same() -> None:
    assert specification.VELOCITY_NOISE_RAD_S == scenarios.VELOCITY_NOISE_RAD_S


def test_when_the_torque_may_not_move_expect_no_design_and_the_reason() -> None:
    with pytest.raises(InfeasibleError, match=r"arm2: no pid-tuned design at 1000 Hz: .* torque activity"):
        tuned_baselines.pid_tuned(robot("arm2"), Specification(torque_activity=1e-6))


@pytest.mark.parametrize(
    ("controller", "kind"),
    [
        pytest.param("pid-tuned", "pid", marks=pytest.mark.full),
        pytest.param("ctc-tuned", "ctc", marks=pytest.mark.full),
        pytest.param("ctc-dob-tuned", "ctc-dob", marks=pytest.mark.full),
    ],
)
def test_when_a_tuned_baseline_is_released_expect_the_law_kind_of_its_family_and_the_numbers_found(
    controller: str, kind: str
) -> None:
    made: Release = release(DesignRequest.of("arm2", controller))
    law, report = made.artifact.law, made.report
    assert law.kind == kind
    assert controller in made.artifact.name
    assert law.velocity_filter_time_constant_s == report["velocity_filter_time_constant_s"]
    if kind != "pid":
        numbers = {name: report[name] for name in baselines.Tuning.__dataclass_fields__}
        assert list(law.gp) == pytest.approx([baselines.Tuning(**numbers).unit_gains()[0]] * 2)
        assert law.disturbance_observer_bandwidth_rad_s == report["observer_bandwidth_rad_s"]
    if kind == "pid":  # the search is the same for all
        assert release(DesignRequest.of("arm2", controller)).artifact.hash == made.artifact.hash


def test_when_the_poles_are_equal_expect_the_gains_of_a_triple_pole() -> None:
    tuning = baselines.Tuning(bandwidth_rad_s=7.0)
    assert tuning.unit_gains() == pytest.approx((3 * 49.0, 21.0, 343.0))
    kp, kd, ki = replace(tuning, integral_ratio=0.25).unit_gains()
    assert np.sort(np.roots([1.0, kd, kp, ki]).real) == pytest.approx([-7.0, -7.0, -1.75], rel=1e-5)
