"""Robots in space against Pinocchio, which is independent of them; and what their parts refuse."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from quasilpv.errors import InputError
from quasilpv.systems.robots.spatial import Placement, SpatialInertia
from quasilpv.systems.robots.tree import JointKind, KinematicTree, TreeJoint, merged
from reference.random_trees import coordinates, pinocchio_tree, random_body, random_rotation, random_tree

seeds = st.integers(0, 2**32 - 1)


@given(seeds, st.integers(1, 7))
def test_dynamics_and_kinematics_are_those_of_pinocchio(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    tree = random_tree(rng, n)
    model = pinocchio_tree(tree)
    data = model.createData()
    q, w, a = coordinates(tree, rng, 1)[0], rng.normal(size=n), rng.normal(size=n)

    upper = np.triu(pin.crba(model, data, q))
    inertia = upper + np.triu(upper, 1).T
    torque = pin.rnea(model, data, q, w, a)
    pin.framesForwardKinematics(model, data, q)
    pose = data.oMf[model.getFrameId("tool")]
    jacobian = pin.computeFrameJacobian(model, data, q, model.getFrameId("tool"), pin.LOCAL_WORLD_ALIGNED)
    jacobian = jacobian.reshape(6, n)  # of one joint it has one dimension only

    assert_allclose(tree.inertia(q), inertia, atol=1e-12 * np.abs(inertia).max())
    assert_allclose(tree.inverse_dynamics(q, w, a), torque, atol=1e-12 * np.abs(torque).max() + 1e-13)
    assert_allclose(tree.tool_pose(q).rotation, pose.rotation, atol=1e-13)
    assert_allclose(tree.tool_pose(q).translation_m, pose.translation, atol=1e-13)
    assert_allclose(tree.tool_jacobian(q), jacobian, atol=1e-12)
    assert_allclose(tree.forward_dynamics(q, w, torque), a, atol=1e-9)


@given(seeds, st.integers(1, 7))
def test_the_parts_of_the_torque_add_up(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    tree = random_tree(rng, n)
    q, w, a = coordinates(tree, rng, 1)[0], rng.normal(size=n), rng.normal(size=n)

    parts = tree.inertia(q) @ a + tree.coriolis(q, w) + tree.gravity(q)

    assert_allclose(parts, tree.inverse_dynamics(q, w, a), rtol=0, atol=1e-12 * (1 + np.abs(parts).max()))


@given(seeds)
def test_many_postures_at_once_are_the_same_as_one_by_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tree = random_tree(rng, 4)
    postures = coordinates(tree, rng, 3)

    assert_allclose(tree.inertia(postures), [tree.inertia(q) for q in postures], atol=1e-13)


@given(seeds)
def test_a_payload_adds_its_kinetic_energy_at_the_tool(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tree, payload = random_tree(rng, 5), random_body(rng)
    q, w = coordinates(tree, rng, 1)[0], rng.normal(size=5)
    v = tree.tool.motion_matrix @ tree.jacobians(q)[-1] @ w

    added = w @ (tree.carrying(payload).inertia(q) - tree.inertia(q)) @ w

    assert added == pytest.approx(v @ payload.matrix @ v, rel=1e-11)


@given(seeds)
def test_bodies_merged_in_two_orders_are_one_body(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first = Placement(random_rotation(rng), rng.normal(size=3))
    second = Placement(random_rotation(rng), rng.normal(size=3))
    body, other = random_body(rng), random_body(rng)

    at_once = merged([(first.then(second), body), (first, other)])
    in_turn = merged([(second, body), (Placement.identity(), other)]).seen_from(first)

    assert_allclose(at_once.matrix, in_turn.matrix, atol=1e-12 * np.abs(in_turn.matrix).max())


@given(seeds)
def test_a_body_of_point_masses_has_no_negative_energy_and_keeps_the_triangle(seed: int) -> None:
    body = random_body(np.random.default_rng(seed))

    assert body.least_eigenvalue > 0.0
    assert body.triangle_excess < 0.0
    assert 0.0 < body.radius_of_gyration_m < 0.3 * np.sqrt(3.0)


def test_a_body_without_mass_keeps_its_moment_of_inertia_when_it_is_seen_from_elsewhere() -> None:
    rotor = SpatialInertia(0.0, np.zeros(3), np.diag([1.0, 2.0, 3.0]))
    turned = Placement(random_rotation(np.random.default_rng(1)), np.ones(3))

    assert_allclose(np.linalg.eigvalsh(rotor.seen_from(turned).rotational_kg_m2), [1.0, 2.0, 3.0])


REVOLUTE = TreeJoint(
    "elbow", JointKind.REVOLUTE, Placement.identity(), np.array([0.0, 0.0, 1.0]), SpatialInertia.zero(), 0.1, -1.0, 1.0
)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"axis": np.array([0.0, 0.0, 2.0])}, "axis"),
        ({"axis": np.array([np.nan, 0.0, 1.0])}, "axis"),
        ({"rotor_inertia_kg_m2": -0.1}, "rotor_inertia"),
        ({"rotor_inertia_kg_m2": float("nan")}, "rotor_inertia"),
        ({"lower": 1.0, "upper": -1.0}, "limits"),
        ({"lower": 0.0, "upper": 0.0}, "limits"),
        ({"lower": float("-inf")}, "limits"),
        ({"upper": float("nan")}, "limits"),
    ],
)
def test_a_joint_that_is_none_is_refused_by_name(change: dict, field: str) -> None:
    with pytest.raises(InputError, match=f"elbow: {field}"):
        replace(REVOLUTE, **change)


@pytest.mark.parametrize("rotation", [np.diag([1.0, 1.0, -1.0]), 1.1 * np.eye(3), np.full((3, 3), np.nan)])
def test_a_placement_that_is_no_rotation_is_refused(rotation: np.ndarray) -> None:
    with pytest.raises(InputError, match="placement"):
        Placement(rotation, np.zeros(3))


def test_a_chain_without_joints_and_coordinates_of_another_number_are_refused() -> None:
    with pytest.raises(InputError, match="joints: got none"):
        KinematicTree("empty", (), Placement.identity(), np.zeros(3))
    with pytest.raises(InputError, match="coordinates"):
        KinematicTree("one", (REVOLUTE,), Placement.identity(), np.zeros(3)).inertia([0.0, 0.0])


def test_a_joint_with_limits_that_span_a_turn_is_a_full_circle() -> None:
    assert replace(REVOLUTE, lower=-np.pi, upper=np.pi).is_full_circle
    assert replace(REVOLUTE, kind=JointKind.CONTINUOUS).is_full_circle
    assert not REVOLUTE.is_full_circle
    assert not replace(REVOLUTE, kind=JointKind.PRISMATIC, lower=-4.0, upper=4.0).is_full_circle
