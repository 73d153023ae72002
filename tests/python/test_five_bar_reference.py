"""The five-bar in C++ against a numpy model from centre-of-mass Jacobians, and against Pinocchio's closed chain."""

from __future__ import annotations

import json

import numpy as np
import pytest

from quasilpv import _runtime
from quasilpv.documents.mechanism import LinkParameters
from quasilpv.documents.plants import FiveBarPlant
from quasilpv.scenarios import Scenario, SineTorque
from reference.five_bar import FiveBar, closed_chain_acceleration
from reference.serial_arm import Link, Sine

SAMPLES = 300
RELATIVE_TOLERANCE = 1e-12  # of the largest summand


def random_link(rng: np.random.Generator, length: float) -> Link:
    mass, com = rng.uniform(0.5, 5.0), rng.uniform(0.1, 1.0) * length
    return Link(length, mass, com, mass * com**2 + rng.uniform(0.02, 0.2) * mass * length**2, rng.uniform(0.0, 3.0))


def random_five_bar(seed: int) -> tuple[FiveBar, _runtime.Plant, np.random.Generator]:
    """The same random mechanism twice; its passive links are the longer ones."""
    rng = np.random.default_rng(seed)
    active = random_link(rng, rng.uniform(0.2, 1.0))
    passive = random_link(rng, active.length_m * rng.uniform(1.1, 1.5))
    sines = tuple(Sine(j, rng.uniform(1, 50), rng.uniform(1, 50), rng.uniform(-3, 3)) for j in range(2))
    rest = (rng.uniform(-1, 0), rng.uniform(0, 1))
    five_bar = FiveBar(active, passive, 9.81, rng.uniform(0, 10), rest, rng.uniform(0, 100), sines)
    plant = FiveBarPlant(
        label="random",
        gravity_m_s2=five_bar.gravity_m_s2,
        active=LinkParameters(**vars(active)),
        passive=LinkParameters(**vars(passive)),
        spring_nm_rad=five_bar.spring_nm_rad,
        spring_rest_rad=rest,
        baumgarte_per_s=five_bar.baumgarte_per_s,
    )
    document = {
        "schema": "quasilpv.scenario",
        "schema_version": 1,
        "name": "random",
        "duration_s": 1.0,
        "plant": plant.model_dump(mode="json"),
        "integrator": {"kind": "rk4", "steps_per_sample": 1},
        "external_torque": [SineTorque(**vars(sine)).model_dump(mode="json") for sine in sines],
        "sensors": {"encoder_bits": 0, "velocity_noise_rad_s": 0, "seed": 0},
        "transport_delay_s": 0,
        "initial": {"angle_rad": [-0.8, 0.8], "speed_rad_s": [0, 0]},
    }
    scenario = Scenario.from_document(document).to_document()
    return five_bar, _runtime.Plant(_runtime.Scenario.parse(json.dumps(scenario).encode())), rng


def assembled_state(plant: _runtime.Plant, rng: np.random.Generator) -> np.ndarray:
    direction, opening = rng.uniform(-2, 2), rng.uniform(0.4, 2.7)
    return plant.initial_state([direction - opening / 2, direction + opening / 2], rng.normal(0, 2, 2))


@pytest.mark.parametrize("seed", range(3))
def test_when_states_are_random_expect_the_residual_of_the_formulas(seed: int) -> None:
    five_bar, plant, rng = random_five_bar(seed)
    for _ in range(SAMPLES):
        time_s = rng.uniform(0, 10)
        state = assembled_state(plant, rng) + np.concatenate(
            [rng.normal(0, 1e-2, 4), rng.normal(0, 2, 4), rng.normal(0, 10, 2)]
        )
        derivative, torque = rng.normal(0, 10, 10), rng.normal(0, 30, 2)
        np.testing.assert_allclose(
            plant.residual(time_s, state, derivative, torque),
            five_bar.residual(time_s, state, derivative, torque),
            rtol=0,
            atol=RELATIVE_TOLERANCE * five_bar.residual_scale(state, derivative, torque),
        )


@pytest.mark.parametrize("seed", range(3))
def test_when_a_state_is_made_consistent_expect_the_residual_of_the_formulas_to_vanish(seed: int) -> None:
    five_bar, plant, rng = random_five_bar(seed)
    for _ in range(SAMPLES):
        time_s, torque = rng.uniform(0, 10), rng.normal(0, 30, 2)
        near = assembled_state(plant, rng) + np.concatenate(
            [rng.normal(0, 1e-4, 4), rng.normal(0, 0.1, 4), np.zeros(2)]
        )
        state, derivative = plant.make_consistent(time_s, near, torque)
        np.testing.assert_allclose(
            five_bar.residual(time_s, state, derivative, torque),
            0.0,
            rtol=0,
            atol=RELATIVE_TOLERANCE * five_bar.residual_scale(state, derivative, torque),
        )
        assert np.abs(five_bar.constraint(state[:4])).max() < 1e-13


@pytest.mark.parametrize("seed", range(3))
def test_when_the_chain_is_closed_expect_the_acceleration_of_pinocchio(seed: int) -> None:
    five_bar, plant, rng = random_five_bar(seed)
    for _ in range(SAMPLES):
        time_s, torque = rng.uniform(0, 10), rng.normal(0, 30, 2)
        state, derivative = plant.make_consistent(time_s, assembled_state(plant, rng), torque)
        expected = closed_chain_acceleration(five_bar, time_s, state[:4], state[4:8], torque)
        np.testing.assert_allclose(derivative[4:8], expected, rtol=0, atol=1e-10 * np.abs(expected).max())
