"""Robots in space on the run-time side: the same motion as in Pinocchio and in Python, and the plant."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from quasilpv import _runtime
from quasilpv.documents.canonical import canonical_json
from quasilpv.errors import InputError
from quasilpv.systems.robots.tree import KinematicTree
from reference.random_trees import coordinates, pinocchio_tree, random_tree

seeds = st.integers(0, 2**32 - 1)


def document(tree: KinematicTree) -> dict:
    return tree.parameters_document()


@given(seeds, st.integers(1, 7))
def test_motion_and_its_derivatives_are_those_of_pinocchio(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    tree = random_tree(rng, n)
    own, model = _runtime.Tree(document(tree)), pinocchio_tree(tree)
    data = model.createData()
    q, w, a = coordinates(tree, rng, 1)[0], rng.normal(size=n), rng.normal(size=n)

    torque = pin.rnea(model, data, q, w, a)
    pin.computeRNEADerivatives(model, data, q, w, a)
    by_coordinate, by_speed = own.derivatives(q, w, a)

    def close(actual: np.ndarray, expected: np.ndarray) -> None:
        assert_allclose(actual, expected, rtol=0, atol=1e-12 * (1.0 + np.abs(expected).max()))

    close(own.inverse_dynamics(q, w, a), torque)
    close(own.torque_at_rest(q, a), pin.rnea(model, data, q, np.zeros(n), a))
    close(own.inertia(q), tree.inertia(q))
    close(by_coordinate, data.dtau_dq)
    close(by_speed, data.dtau_dv)


@given(seeds, st.integers(1, 7))
def test_energy_changes_by_the_power_of_the_torque(seed: int, n: int) -> None:
    """dE/dt = w . Gamma for any motion: by a central difference along it."""
    rng = np.random.default_rng(seed)
    tree = random_tree(rng, n)
    own = _runtime.Tree(document(tree))
    q, w, a = coordinates(tree, rng, 1)[0], rng.normal(size=n), rng.normal(size=n)
    h = 1e-5
    later, earlier = (own.energy(q + s * w * h + 0.5 * a * h * h, w + s * a * h) for s in (1.0, -1.0))

    power = w @ own.inverse_dynamics(q, w, a)

    assert (later - earlier) / (2.0 * h) == pytest.approx(power, abs=1e-6 * (1.0 + abs(power) + abs(later)))


def scenario(tree: KinematicTree, friction: float) -> _runtime.Scenario:
    plant = {"label": "drawn", **document(tree)}
    for joint in plant["joints"]:
        joint |= {"friction_viscous_nm_s": friction, "friction_coulomb_nm": friction, "coulomb_speed_rad_s": 0.05}
    n = tree.order
    content = {
        "schema": "quasilpv.scenario",
        "schema_version": 1,
        "name": "drawn",
        "duration_s": 1.0,
        "plant": plant,
        "integrator": {"kind": "ida", "relative_tolerance": 1e-8, "absolute_tolerance": 1e-10},
        "external_torque": [],
        "sensors": {"encoder_bits": 0, "velocity_noise_rad_s": 0.0, "seed": 1},
        "transport_delay_s": 0.0,
        "initial": {"angle_rad": [0.1] * n, "speed_rad_s": [0.0] * n},
    }
    return _runtime.Scenario.parse(canonical_json(content))


@given(seeds, st.integers(1, 7))
@settings(max_examples=20)
def test_the_plant_accelerates_as_the_torque_less_friction_says(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    tree = random_tree(rng, n)
    plant = _runtime.Plant(scenario(tree, 0.3))
    q, w, torque = coordinates(tree, rng, 1)[0], rng.normal(size=n), rng.normal(size=n)
    state = plant.initial_state(q, w)

    moving = plant.derivative(0.0, state, torque)

    friction = 0.3 * w + 0.3 * np.tanh(w / 0.05)
    assert_allclose(moving[:n], w)
    assert_allclose(moving[n:], tree.forward_dynamics(q, w, torque - friction), rtol=1e-8, atol=1e-8)
    assert_allclose(plant.residual(0.0, state, moving, torque), 0.0, atol=1e-9 * (1.0 + np.abs(moving).max()))


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"kind": "ball"}, r"joints\[0\].kind"),
        ({"axis": [0.0, 0.0, 2.0]}, r"joints\[0\].axis"),
        ({"rotation": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]}, r"joints\[0\].rotation"),
        ({"rotation": [[1.0, 0.0, 0.0]]}, r"joints\[0\].rotation"),
        ({"mass_kg": -1.0}, r"joints\[0\].mass_kg"),
        ({"mass_kg": float("nan")}, "mass_kg|finite|number"),
        ({"rotational_kg_m2": [[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]}, "not symmetric"),
        ({"rotational_kg_m2": [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]}, "negative kinetic energy"),
        ({"rotor_inertia_kg_m2": -0.1}, r"joints\[0\].rotor_inertia_kg_m2"),
    ],
)
def test_a_document_of_no_robot_is_refused_by_field(change: dict, field: str) -> None:
    content = document(random_tree(np.random.default_rng(0), 2))
    content["joints"][0] |= change
    with pytest.raises(InputError, match=field):
        _runtime.Tree(content)


def test_eight_joints_and_none_are_refused() -> None:
    content = document(random_tree(np.random.default_rng(0), 7))
    with pytest.raises(InputError, match="8 joints"):
        _runtime.Tree({**content, "joints": [*content["joints"], content["joints"][0]]})
    with pytest.raises(InputError, match="0 joints"):
        _runtime.Tree({**content, "joints": []})
