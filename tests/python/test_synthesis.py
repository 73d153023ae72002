"""Designs end to end: what the specification asked for holds, by other means than the search that found it."""

from functools import cache

import numpy as np
import pytest

from quasilpv.artifact import evaluate
from quasilpv.errors import InfeasibleError, InputError
from quasilpv.release import Release, release
from quasilpv.synthesis import DesignRequest, Specification
from quasilpv.synthesis.acceleration.inertia_range import needed_inertia_range
from quasilpv.synthesis.acceleration.sampled_loop import AccelerationLaw, SampledLoop
from quasilpv.systems.robots.registry import robot


@cache
def default_release() -> Release:
    return release(DesignRequest.of("arm3"))


def law_of(made: Release) -> AccelerationLaw:
    law = made.artifact.law
    assert law.kind == "dob-acceleration"
    gains = np.array([law.feedback.kp, law.feedback.kd, law.feedback.ki])
    return AccelerationLaw(made.artifact.sample_period_s, gains, np.array(law.observer), law.filter_time_constant_s)


def test_when_the_default_design_ships_expect_stability_for_every_posture_payload_and_half_a_sample_of_delay() -> None:
    made = default_release()
    arm3, law = robot("arm3"), law_of(made)
    loops = [SampledLoop(law), SampledLoop(law, 0.5e-3)]
    rng = np.random.default_rng(0)
    low, high = np.array(arm3.domain.angle_rad).T
    table = made.artifact.law.inertia
    worst = -np.inf
    for _ in range(200):
        theta = rng.uniform(low, high)
        plant = arm3.with_payload_fraction(float(rng.uniform())).inertia(theta)
        design = made.report["inertia_scale"] * arm3.model.inertia(theta)
        for ratio in np.linalg.eigvals(np.linalg.solve(plant, design)).real:
            worst = max(worst, *(loop.growth_rate(ratio) for loop in loops))
    assert worst < 0
    assert worst <= made.report["worst_growth_rate_per_s"] + 1e-6
    assert table.premises == 3


def test_when_the_default_design_ships_expect_the_margin_to_exceed_the_needed_range_by_the_spare() -> None:
    made, needed = default_release(), needed_inertia_range(robot("arm3"))
    margin = SampledLoop(law_of(made), 0.5e-3).inertia_margin()
    assert margin is not None
    spare, scale = Specification().margin_spare, made.report["inertia_scale"]
    assert margin[0] * spare <= needed.lowest / scale * (1 + 1e-9)
    assert needed.highest / scale * spare <= margin[1] * (1 + 1e-9)


def test_when_a_design_is_repeated_expect_the_same_artifact() -> None:
    assert release(DesignRequest.of("arm3")).artifact.hash == default_release().artifact.hash


def test_when_the_specification_changes_expect_another_design_hash() -> None:
    other = release(DesignRequest.of("arm3", specification=Specification(encoder_bits=17)))
    assert other.artifact.design_hash != default_release().artifact.design_hash
    assert other.report["disturbance_gain_s2"] > default_release().report["disturbance_gain_s2"]


@pytest.mark.parametrize(
    ("specification", "reason"),
    [
        (Specification(torque_activity=1e-5), r"torque increments of 0\.0204 N m rms, the quietest .* has \d"),
        (Specification(margin_spare=9.0), r"inertias must span 495 to 1, the widest found spans \d"),
    ],
)
def test_when_the_specification_cannot_be_met_expect_one_line_that_says_why(
    specification: Specification, reason: str
) -> None:
    with pytest.raises(InfeasibleError, match=rf"arm3: no acceleration-level design at 1000 Hz: .*{reason}") as caught:
        release(DesignRequest.of("arm3", specification=specification))
    assert "\n" not in str(caught.value)


def test_when_names_or_numbers_are_wrong_expect_an_input_error() -> None:
    with pytest.raises(InputError, match="arm9"):
        release(DesignRequest.of("arm9"))
    with pytest.raises(InputError, match=r"controller.*fuzzy.*pid"):
        release(DesignRequest.of("arm3", "fuzzy"))
    with pytest.raises(InputError, match="disturbance_compensation"):
        release(DesignRequest.of("arm3", "pid", compensated=False))
    for field, value in (("rate_hz", 0.0), ("rate_hz", float("nan")), ("encoder_bits", 3), ("margin_spare", 0.9)):
        with pytest.raises(InputError, match=field):
            Specification(**{field: value})


def test_when_pid_is_written_expect_the_printed_gains() -> None:
    law = release(DesignRequest.of("arm3", "pid")).artifact.law
    assert law.kind == "pid"
    # Dehak 2022 (III.55), five printed digits
    assert np.allclose(law.kp, 1e4 * np.array([24.280, 6.413, 0.866]), rtol=6e-4)
    assert np.allclose(law.kd, 1e4 * np.array([0.51524, 0.13608, 0.01838]), rtol=3e-4)
    assert np.allclose(law.ki, 1e4 * np.array([381.39, 100.73, 13.60]), rtol=4e-4)


def test_when_computed_torque_is_written_expect_the_printed_gains() -> None:
    law = release(DesignRequest.of("arm3", "ctc")).artifact.law
    assert law.kind == "ctc"
    # Dehak 2022 (III.57)
    assert np.allclose(law.gp, 6.6620e3, rtol=1e-5)
    assert np.allclose(law.gd, 141.3717, rtol=1e-6)
    assert np.allclose(law.gi, 1.0465e5, rtol=5e-5)


# The other laws have the programs of one of these, and take longer.
@pytest.mark.parametrize("controller", ["pid", "ctc", "ctc-dob", "dob-acceleration"])
@pytest.mark.parametrize("robot_id", ["arm2", "arm3"])
def test_when_programs_are_compiled_expect_the_model_they_came_from(robot_id: str, controller: str) -> None:
    model = robot(robot_id).model
    artifact = release(DesignRequest.of(robot_id, controller)).artifact
    rng = np.random.default_rng(1)
    for _ in range(20):
        theta, omega, rho = rng.normal(size=(3, model.joints))
        gravity = evaluate(artifact.programs["gravity"], theta)
        assert np.allclose(gravity, model.gravity(theta), rtol=1e-12, atol=1e-10)
        if "coriolis" in artifact.programs:
            torque = evaluate(artifact.programs["coriolis"], theta, omega)
            assert np.allclose(torque, model.coriolis(theta, omega), rtol=1e-11, atol=1e-10)
        if "coriolis_reference" in artifact.programs:
            torque = evaluate(artifact.programs["coriolis_reference"], theta, omega, rho)
            assert np.allclose(torque, model.coriolis(theta, omega, rho), rtol=1e-11, atol=1e-10)
