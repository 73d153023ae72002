"""The plant in C++ against a numpy arm derived from centre-of-mass Jacobians, and against the Python model."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from quasilpv import _runtime
from quasilpv.systems.robots.arms import PlanarSerialArm
from reference.random_arms import random_arm
from reference.serial_arm import SerialArm, Sine

SAMPLES = 1000
RELATIVE_TOLERANCE = 1e-12  # of the largest summand


def scenario_document(arm: PlanarSerialArm, sines: tuple[Sine, ...]) -> dict[str, Any]:
    return {
        "schema": "quasilpv.scenario",
        "schema_version": 1,
        "name": "random",
        "duration_s": 1.0,
        "plant": arm.plant_document("random"),
        "integrator": {"kind": "rk4", "steps_per_sample": 1},
        "external_torque": [vars(sine) for sine in sines],
        "sensors": {"encoder_bits": 0, "velocity_noise_rad_s": 0, "seed": 0},
        "transport_delay_s": 0,
        "initial": {"angle_rad": [0.0] * arm.joints, "speed_rad_s": [0.0] * arm.joints},
    }


def random_plant(joints: int) -> tuple[PlanarSerialArm, SerialArm, _runtime.Plant, np.random.Generator]:
    rng = np.random.default_rng(99 + joints)
    arm, numpy_arm = random_arm(joints, rng)
    sines = tuple(Sine(j, rng.uniform(1, 500), rng.uniform(1, 50), rng.uniform(-3, 3)) for j in range(joints))
    numpy_arm = SerialArm(numpy_arm.links, numpy_arm.gravity_m_s2, sines)
    scenario = _runtime.Scenario.parse(json.dumps(scenario_document(arm, sines)).encode())
    return arm, numpy_arm, _runtime.Plant(scenario), rng


@pytest.mark.parametrize("joints", [1, 2, 3, 5])
def test_when_states_are_random_expect_the_residual_of_the_formulas(joints: int) -> None:
    _, numpy_arm, plant, rng = random_plant(joints)
    for _ in range(SAMPLES):
        time_s = rng.uniform(0, 10)
        state = np.concatenate([rng.uniform(-3.2, 3.2, joints), rng.normal(0, 3, joints)])
        derivative = np.concatenate([state[joints:], rng.normal(0, 10, joints)])
        torque = rng.normal(0, 300, joints)
        expected = numpy_arm.residual(time_s, state, derivative, torque)
        scale = max(np.abs(term).max() for term in numpy_arm.torque_terms(time_s, state, derivative, torque))
        residual = plant.residual(time_s, state, derivative, torque)
        np.testing.assert_allclose(residual, expected, rtol=0, atol=RELATIVE_TOLERANCE * scale)


@pytest.mark.parametrize("joints", [1, 2, 3, 5])
def test_when_angles_are_random_expect_one_mass_matrix_from_three_derivations(joints: int) -> None:
    arm, numpy_arm, plant, rng = random_plant(joints)
    for _ in range(SAMPLES):
        angle = rng.uniform(-3.2, 3.2, joints)
        mass = plant.mass_matrix(angle)
        scale = np.abs(arm.inertia_constants).sum()
        np.testing.assert_allclose(mass, numpy_arm.mass_matrix(angle), rtol=0, atol=RELATIVE_TOLERANCE * scale)
        np.testing.assert_allclose(mass, arm.inertia(angle), rtol=0, atol=RELATIVE_TOLERANCE * scale)


@pytest.mark.parametrize("joints", [1, 2, 3, 5])
def test_when_states_are_random_expect_forward_dynamics_to_make_the_residual_of_the_formulas_zero(joints: int) -> None:
    _, numpy_arm, plant, rng = random_plant(joints)
    for _ in range(SAMPLES):
        time_s = rng.uniform(0, 10)
        state = np.concatenate([rng.uniform(-3.2, 3.2, joints), rng.normal(0, 3, joints)])
        torque = rng.normal(0, 300, joints)
        derivative = plant.derivative(time_s, state, torque)
        terms = numpy_arm.torque_terms(time_s, state, derivative, torque)
        scale = (
            max(np.abs(term).max() for term in terms)
            + np.abs(numpy_arm.mass_matrix(state[:joints])).sum() * np.abs(derivative[joints:]).max()
        )
        np.testing.assert_array_equal(derivative[:joints], state[joints:])
        np.testing.assert_allclose(np.asarray(sum(terms)), 0.0, rtol=0, atol=RELATIVE_TOLERANCE * scale)


def test_when_the_residual_is_called_between_expect_forward_dynamics_not_to_remember_its_torque() -> None:
    _, _, plant, rng = random_plant(2)
    state, torque = rng.normal(0, 1, 4), rng.normal(0, 10, 2)
    before = plant.derivative(0.1, state, torque)
    plant.residual(0.2, state, np.zeros(4), 100 * torque)
    np.testing.assert_array_equal(plant.derivative(0.1, state, torque), before)
