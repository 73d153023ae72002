"""`dob-moving` for robots in space: how fast an inertia changes, the circle that contracts, and what is refused."""

from copy import deepcopy
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from flint import arb, ctx, fmpq

from quasilpv.artifact import Artifact
from quasilpv.certificate import gate
from quasilpv.certificate.exact.chain import ChainJoint, ChainProof
from quasilpv.certificate.exact.matrices import matrix, rational
from quasilpv.certificate.exact.rate_chain import RateForm, prove_rate
from quasilpv.certificate.gate.motion import satisfies_circle_criterion
from quasilpv.certificate.gate.proof import RobustGate
from quasilpv.certificate.gate.tree_motion import contraction_of
from quasilpv.errors import InputError
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import write_run_files
from quasilpv.release import checked_artifact
from quasilpv.scenarios import TrackingExperiment
from quasilpv.synthesis import DesignRequest, specification_for, synthesise
from quasilpv.synthesis.acceleration import tree_law
from quasilpv.synthesis.acceleration.search import Grid
from quasilpv.synthesis.rate_storages import RateStorages, find_rate
from quasilpv.systems.robots.spatial_robot import SpatialRobot
from quasilpv.systems.robots.tree import KinematicTree
from quasilpv.systems.robots.ur5 import ur5
from quasilpv.trajectories import Trajectory
from reference.gated_arms import multiple_pole_loop
from reference.random_trees import random_tree
from reference.tree_artifacts import small_robot


def prove(tree: KinematicTree, speeds: np.ndarray, found: RateStorages, *, factor: float = 1.0) -> ChainProof:
    joints = [
        ChainJoint(
            joint.turns,
            joint.placement.rotation.tolist(),
            joint.placement.translation_m.tolist(),
            joint.axis.tolist(),
            joint.lower,
            joint.upper,
        )
        for joint in tree.joints
    ]
    form = RateForm(
        [matrix(joint.inertia.matrix.tolist()) for joint in tree.joints],
        [rational(float(rotor)) for rotor in tree.rotor_inertias],
        rational(factor * found.rate_per_s),
        [rational(float(speed)) for speed in speeds],
    )
    return prove_rate(joints, form, [matrix(storage.tolist()) for storage in found.matrices])


def sampled_rate(tree: KinematicTree, speeds: np.ndarray, count: int = 300) -> float:
    """Largest eigenvalue of ``M^-1 dM/dt`` at random postures and the vertices of the speeds, by differences."""
    rng = np.random.default_rng(5)
    lower, upper = np.array([(joint.lower, joint.upper) for joint in tree.joints]).T
    q = rng.uniform(lower, upper, (count, tree.order))
    inverse = np.linalg.inv(np.linalg.cholesky(tree.inertia(q)))
    largest = 0.0
    for signs in product((-1.0, 1.0), repeat=tree.order - 1):
        step = 1e-6 * speeds * np.array([1.0, *signs])
        slope = (tree.inertia(q + step) - tree.inertia(q - step)) / 2e-6
        largest = max(largest, float(np.linalg.eigvalsh(inverse @ slope @ inverse.transpose(0, 2, 1)).max()))
    return largest


@pytest.mark.parametrize(("n", "sliding"), [(1, 0.0), (2, 0.0), (3, 0.5), pytest.param(4, 0.3, marks=pytest.mark.full)])
def test_when_a_rate_is_proved_expect_no_sample_above_it_and_a_smaller_one_or_more_speed_refused(
    n: int, sliding: float
) -> None:
    rng = np.random.default_rng(10 * n)
    drawn = random_tree(rng, n, sliding=sliding)
    tree = replace(
        drawn,
        joints=tuple(replace(joint, rotor_inertia_kg_m2=0.05, lower=-0.8, upper=0.9) for joint in drawn.joints),
    )
    speeds = rng.uniform(0.5, 1.5, n)
    found = find_rate(tree, speeds)
    assert found is not None
    assert prove(tree, speeds, found).holds
    if n == 1:
        return  # its inertia does not change
    sampled = sampled_rate(tree, speeds)
    assert sampled < found.rate_per_s < 2.5 * sampled
    assert not prove(tree, speeds, found, factor=0.98 * sampled / found.rate_per_s).holds
    assert not prove(tree, 1.3 * speeds, found).holds


def test_when_a_storage_is_not_concave_or_not_symmetric_expect_no_proof() -> None:
    drawn = random_tree(np.random.default_rng(3), 3, sliding=0.0)
    tree = replace(drawn, joints=tuple(replace(joint, lower=-0.3, upper=0.3) for joint in drawn.joints))
    speeds = np.ones(3)
    found = find_rate(tree, speeds)
    assert found is not None
    assert prove(tree, speeds, found).holds
    convex, lopsided = found.matrices[1].copy(), found.matrices[1].copy()
    convex[6:, 6:] *= -1.0
    lopsided[0, 1] += 1e-3
    for broken in (convex, lopsided):
        assert not prove(tree, speeds, replace(found, matrices=(found.matrices[0], broken))).holds
    with pytest.raises(ValueError, match="storage 1 is not 12 x 12"):
        prove(tree, speeds, replace(found, matrices=(found.matrices[0], np.eye(6))))


def test_when_the_circle_contracts_expect_roots_inside_it_and_a_limit_between_them() -> None:
    loop = multiple_pole_loop(40, 900, 8e-4, 1e-3)
    centre, radius = fmpq(1), fmpq(1, 10)
    assert satisfies_circle_criterion(loop, centre, radius, fmpq(1, 2), contraction_of(fmpq(1, 50)))
    # exp(-beta T / 2) beyond the slowest root, at exp(-40 T): no quadratic function falls that fast.
    assert not satisfies_circle_criterion(loop, centre, radius, fmpq(1, 2), contraction_of(fmpq(1, 8)))
    with ctx.workprec(128):
        for rate in (fmpq(1, 1000), fmpq(1, 50), fmpq(3)):
            exact = (arb(-rate / 2)).exp()
            assert exact - arb(2) ** -38 < contraction_of(rate)
            assert arb(contraction_of(rate)) < exact


def moving_robot() -> SpatialRobot:
    """The small robot with friction; its proof in motion is for less than its range."""
    robot = small_robot(coulomb_nm=0.3)
    boxes = ((-3.0, 3.0), (-1.2, 1.4), (-2.0, 2.0))
    joints = zip(robot.joints, boxes, strict=True)
    return replace(
        robot, joints=tuple(replace(joint, motion_angle_rad=box, motion_speed_rad_s=1.5) for joint, box in joints)
    )


@cache
def released() -> Artifact:
    robot = moving_robot()
    with patch.object(tree_law, "GRID", Grid((0.03, 0.06), (0.8, 1.2), (0.6,))):  # near the best point of the whole one
        return checked_artifact(synthesise(DesignRequest(robot, "dob-moving", specification_for(robot))))


def content() -> dict[str, Any]:
    return deepcopy(dict(released().content()))


def verdict(document: dict[str, Any]) -> RobustGate:
    found = gate(document)
    assert isinstance(found, RobustGate)
    return found


def test_when_a_robot_in_space_moves_expect_a_conditional_proof_that_states_its_condition() -> None:
    found = verdict(content())
    assert found.passed
    answer = found.to_document()
    assert answer["proved_in_motion"] is True
    assert answer["motion_box_rad"] == [[-3.0, 3.0], [-1.2, 1.4], [-2.0, 2.0]]
    assert answer["motion_speed_limit_rad_s"] == [1.5, 1.5, 1.5]
    joints = zip(moving_robot().tree.joints, answer["motion_box_rad"], strict=True)
    tree = replace(moving_robot().tree, joints=tuple(replace(j, lower=low, upper=high) for j, (low, high) in joints))
    assert sampled_rate(tree, np.full(3, 1.5)) < answer["beta_per_s"]


def test_when_the_robot_moves_and_its_load_changes_expect_the_function_to_fall_at_every_sample() -> None:
    """A P of the contracted loop, made here; V = s' (P x M_n(q)) s along random motions within the limits."""
    found, robot = verdict(content()), moving_robot()
    assert found.needed is not None
    assert found.condition is not None
    scale = released().verification["report"]["inertia_scale"]  # type: ignore[index]
    loop, T = found.loop, found.loop.sample_period_s
    low, high = found.needed.to_floats()
    centre, radius = (1.0 / low + 1.0 / high) / 2.0, (1.0 / low - 1.0 / high) / 2.0
    A, b, k = plain_loop(loop)
    contraction = np.exp(-found.condition.rate_per_s * T / 2.0)
    P = common_function((A + centre * b @ k) / contraction, b / contraction, k, radius)
    rng = np.random.default_rng(2)
    lower, upper = np.array(found.condition.limits.angle_rad).T
    speeds = np.array(found.condition.limits.speed_rad_s)
    loads = [robot.lightest(), *robot.heaviest(), robot.loaded(0.4)]
    for _ in range(60):
        q = rng.uniform(lower, upper)
        following = np.clip(q + T * speeds * rng.choice([-1.0, 1.0], 3), lower, upper)
        design, later = scale * robot.tree.inertia(q), scale * robot.tree.inertia(following)
        X = np.linalg.solve(loads[rng.integers(len(loads))].inertia(q), design)
        s = rng.normal(size=(len(A), 3))
        s = s / np.sqrt(np.trace(P @ s @ design @ s.T))
        moved = A @ s + b @ (k @ s) @ X.T
        assert np.trace(P @ moved @ later @ moved.T) < 1.0


def plain_loop(loop: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """``s+ = A s + b X k s`` of one joint without delay; time in samples, integral left out."""
    T = loop.sample_period_s
    l1, l2, l3, l4 = (gain * T**power for power, gain in enumerate(loop.observer))
    q = np.exp(-T / loop.filter_time_constant_s)
    rows = np.eye(7)
    angle, speed, p1, p2, p3, p4, filtered = rows
    innovation = angle - p1
    p1, p2, p3, p4 = p1 + l1 * innovation, p2 + l2 * innovation, p3 + l3 * innovation, p4 + l4 * innovation
    filtered = q * filtered + (1 - q) * p3
    k = loop.kp * T**2 * p1 + loop.kd * T * p2 - filtered
    applied = k + p3
    free = [angle + speed, speed, p1 + p2 + applied / 2 + p4 / 6, p2 + applied + p4 / 2, p3 + p4, p4, filtered]
    return np.array(free), np.array([[0.5], [1.0], *[[0.0]] * 5]), k[None]


def common_function(A: np.ndarray, b: np.ndarray, k: np.ndarray, radius: float) -> np.ndarray:
    """P with ``(A + b d k)' P (A + b d k) < P`` for |d| <= radius: the Riccati recursion of the bounded real lemma."""
    P = np.zeros_like(A)
    for _ in range(100_000):
        gain = 1.0 / radius**2 - float((b.T @ P @ b)[0, 0])
        assert gain > 0.0
        following = A.T @ P @ A + k.T @ k + A.T @ P @ b @ b.T @ P @ A / gain + 1e-9 * np.eye(len(A))
        if np.abs(following - P).max() < 1e-12 * np.abs(following).max():
            return following
        P = following
    raise AssertionError("the recursion does not converge")


@pytest.mark.parametrize(
    "change",
    [
        lambda d: d["law"]["motion_limits"].update(speed_rad_s=[1.5, 1.9, 1.5]),
        lambda d: d["witness"]["motion"]["storages"][0][0].__setitem__(0, 0.0),
        lambda d: d["witness"]["motion"].update(rate_per_s=0.9 * d["witness"]["motion"]["rate_per_s"]),
        lambda d: d["witness"]["motion"].update(rate_per_s=40.0 * d["witness"]["motion"]["rate_per_s"]),
        lambda d: d["law"].update(disturbance_compensation=False),
        lambda d: d["payloads"].update(lag_s=[0.0, 1e-6]),
    ],
)
def test_when_an_artifact_claims_more_than_its_witness_proves_expect_the_gate_not_passed(change: Any) -> None:
    document = content()
    change(document)
    found = verdict(document)
    assert not found.passed
    assert found.motion is False or found.needed is None


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (lambda d: d["law"].pop("motion_limits"), r"law\.motion_limits"),
        (lambda d: d["witness"].pop("motion"), r"witness\.motion"),
        (lambda d: d["law"]["motion_limits"]["angle_rad"].__setitem__(1, [-2.0, 1.0]), r"motion_limits.angle_rad\[1\]"),
        (lambda d: d["law"]["motion_limits"].update(speed_rad_s=[1.0, 0.0, 1.0]), r"motion_limits.speed_rad_s\[1\]"),
        (lambda d: d["law"]["motion_limits"].update(speed_rad_s=[1.0]), r"motion_limits.speed_rad_s"),
        (lambda d: d["law"].update(motion_limits=None), r"motion_limits"),
        (lambda d: d["witness"]["motion"]["storages"].pop(), r"witness\.motion\.storages"),
    ],
)
def test_when_limits_or_witness_are_malformed_expect_one_line_that_names_them(change: Any, field: str) -> None:
    document = content()
    change(document)
    with pytest.raises(InputError, match=field):
        gate(document)


def test_when_drives_lag_expect_dob_moving_refused_by_name() -> None:
    with pytest.raises(InputError, match=r"lag: .*dob-moving"):
        synthesise(DesignRequest.of(replace(moving_robot(), lag_s=(0.0, 1e-3)), "dob-moving"))


@pytest.mark.parametrize(
    ("goal", "duration_s", "expected"),
    [
        ([0.0, 1.0, 0.0], 3.0, None),
        (
            [0.0, 1.0, 0.0],
            0.5,
            r"law\.motion_limits of joint 1: got .* rad/s at .* s of waypoints, expected at most 1.5",
        ),
        ([0.0, 0.0, 2.1], 6.0, r"law\.motion_limits of joint 2: got .* rad at .*, expected an angle in \[-2, 2\]"),
    ],
)
def test_when_a_reference_leaves_the_motions_of_the_proof_expect_it_refused_with_place_and_time(
    tmp_path: Path, goal: list[float], duration_s: float, expected: str | None
) -> None:
    trajectory = Trajectory.through([[0.0, 0.0, 0.0], goal], [0.0, duration_s])
    setup = RunSetup(TrackingExperiment("waypoints", moving_robot(), trajectory), released())
    if expected is None:
        assert write_run_files(tmp_path, setup).artifact.is_file()
        return
    with pytest.raises(InputError, match=expected):
        write_run_files(tmp_path, setup)


@pytest.mark.full
def test_when_a_ur5_moves_over_its_whole_range_at_a_radian_a_second_expect_it_proved() -> None:
    robot = ur5()
    made = synthesise(DesignRequest(robot, "dob-moving", specification_for(robot, torque_activity=0.15)))
    found = verdict(dict(checked_artifact(made).content()))
    assert found.passed
    assert found.condition is not None
    assert sampled_rate(robot.tree, np.ones(6)) < found.condition.rate_per_s < 8.0
