"""Paths in joint space and in three dimensions, and planar arms without a formula: by identities of the results."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import BPoly

from quasilpv.errors import InputError
from quasilpv.systems.robots.arm_parameters import Link, OperatingDomain
from quasilpv.systems.robots.arms import PlanarSerialArm
from quasilpv.systems.robots.spatial import Placement, SpatialInertia
from quasilpv.systems.robots.tree import JointKind, KinematicTree, TreeJoint
from quasilpv.trajectories import SpatialPath, TaskPath, Trajectory, plan, plan_in_space, read_spatial_path
from quasilpv.trajectories.inverse import rotation_vector
from quasilpv.trajectories.paths import LineSegment, Segment
from quasilpv.trajectories.quintics import least_jerk
from quasilpv.trajectories.spatial_paths import SpatialArc, SpatialLine, SpatialSegment
from reference.random_trees import coordinates, random_tree

DUST = SpatialInertia.about_com(1.0, [0.0, 0.0, 0.1], 0.01 * np.eye(3))


def joint(k: int, axis: list[float], offset: list[float]) -> TreeJoint:
    return TreeJoint(
        f"j{k}", JointKind.REVOLUTE, Placement(np.eye(3), np.array(offset)), np.array(axis), DUST, 0.0, -6.0, 6.0
    )


def elbow_arm(extra: bool = False) -> KinematicTree:
    """An arm with a shoulder of two axes, an elbow and a wrist of three; with one more joint in the upper arm."""
    axes = [[0, 0, 1], [0, 1, 0], [0, 1, 0], [0, 0, 1], [0, 1, 0], [0, 0, 1]]
    offsets = [[0, 0, 0.2], [0, 0.1, 0], [0, 0, 0.4], [0, -0.1, 0.1], [0, 0, 0.3], [0, 0.0, 0.1]]
    if extra:
        axes.insert(2, [0, 0, 1])
        offsets.insert(2, [0, 0, 0.1])
    joints = tuple(joint(k, axis, offset) for k, (axis, offset) in enumerate(zip(axes, offsets, strict=True)))
    return KinematicTree("elbow", joints, Placement.turned([1, 0, 0], 0.3), np.array([0.0, 0.0, -9.81]))


START = (0.2, 0.4, 1.1, 0.3, 0.9, -0.4)
SQUARE = tuple(
    SpatialSegment(line=SpatialLine(by=by, duration_s=0.5))
    for by in ((0.0, 0.1, 0.0), (0.0, 0.0, 0.1), (0.0, -0.1, 0.0), (0.0, 0.0, -0.1))
)
CIRCLE = SpatialSegment(
    arc=SpatialArc(centre_by=(0.0, 0.06, 0.0), axis=(1.0, 0.0, 0.5), angle_rad=2.0 * np.pi, duration_s=1.0),
    turn_rad=(0.0, 0.3, -0.2),
)


def path(*segments: SpatialSegment, **members: object) -> SpatialPath:
    return SpatialPath(name="test", start_posture_rad=START, segments=segments or SQUARE, **members)  # type: ignore[arg-type]


# ---- waypoints ------------------------------------------------------------------------------------------------------


def test_when_two_waypoints_are_joined_expect_the_quintic_at_rest_at_both_ends() -> None:
    made = Trajectory.through([[0.0, 1.0], [2.0, -1.0]], [0.0, 4.0])
    s = np.linspace(0.0, 1.0, 41)
    expected = 10 * s**3 - 15 * s**4 + 6 * s**5
    found = made.evaluate(4.0 * s)
    np.testing.assert_allclose(found.angle, np.stack([2.0 * expected, 1.0 - 2.0 * expected], axis=1), atol=1e-14)
    np.testing.assert_allclose(found.speed[[0, -1]], 0.0, atol=1e-14)
    np.testing.assert_allclose(found.acceleration[[0, -1]], 0.0, atol=1e-14)


def test_when_waypoints_lie_between_the_ends_expect_them_passed_with_four_continuous_derivatives() -> None:
    rng = np.random.default_rng(4)
    times, points = np.array([0.0, 0.7, 1.1, 2.6, 3.0]), rng.normal(size=(5, 3))
    made = Trajectory.through(points, times)
    np.testing.assert_allclose(made.evaluate(times).angle, points, atol=1e-12)
    spacing = np.diff(times)
    for order in range(5):  # of the polynomials themselves, from both sides
        for k in range(3):
            left = [np.polynomial.Polynomial(c).deriv(order)(spacing[k]) for c in made.coefficients[k]]
            right = [np.polynomial.Polynomial(c).deriv(order)(0.0) for c in made.coefficients[k + 1]]
            np.testing.assert_allclose(left, right, rtol=1e-9, atol=1e-9 * (1 + np.abs(left).max()))


def test_when_the_motion_at_inner_waypoints_is_another_one_expect_more_jerk() -> None:
    rng = np.random.default_rng(5)
    times, points = np.array([0.0, 0.5, 1.2, 2.0]), rng.normal(size=(4, 1))

    def jerk(speed: np.ndarray, acceleration: np.ndarray) -> float:
        values = np.stack([points, speed, acceleration], axis=1)
        third = BPoly.from_derivatives(times, values[:, :, 0]).derivative(3)
        nodes, weights = np.polynomial.legendre.leggauss(4)
        return sum(
            (b - a) / 2 * float(weights @ third((a + b) / 2 + nodes * (b - a) / 2) ** 2)
            for a, b in itertools.pairwise(times)
        )

    _, speed, acceleration = least_jerk(times, points)
    best = jerk(speed, acceleration)
    for row in (1, 2):
        for change in (-0.05, 0.05):
            other_speed, other_acceleration = speed.copy(), acceleration.copy()
            other_speed[row] += change
            other_acceleration[row] += 5.0 * change
            assert jerk(other_speed, acceleration) > best
            assert jerk(speed, other_acceleration) > best


@pytest.mark.parametrize(
    ("angles", "times", "field"),
    [
        ([[0.0]], [0.0], "angles"),
        ([[0.0], [np.nan]], [0.0, 1.0], "angles"),
        ([[0.0], [1.0]], [0.0], "times_s"),
        ([[0.0], [1.0]], [0.0, 0.0], "times_s"),
        ([[0.0], [1.0]], [1.0, 2.0], "times_s"),
    ],
)
def test_when_waypoints_are_none_expect_a_refusal(angles: list, times: list, field: str) -> None:
    with pytest.raises(InputError, match=field):
        Trajectory.through(angles, times)


# ---- in space -------------------------------------------------------------------------------------------------------


def test_when_a_chain_moves_expect_the_drift_of_its_tool_to_be_the_change_of_its_jacobian() -> None:
    rng = np.random.default_rng(6)
    for n in (2, 5, 7):
        tree = random_tree(rng, n, sliding=0.4)
        q, w, h = coordinates(tree, rng, 1)[0], rng.normal(size=n), 1e-6
        change = (tree.tool_jacobian(q + h * w) - tree.tool_jacobian(q - h * w)) @ w / (2.0 * h)
        np.testing.assert_allclose(tree.tool_drift(q, w), change, atol=1e-8)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 0.7, np.pi - 1e-7, np.pi])
def test_when_a_rotation_is_written_as_a_vector_expect_the_rotation_back(angle: float) -> None:
    axis = np.array([0.6, -0.48, 0.64])
    vector = rotation_vector(Placement.turned(axis, angle).rotation)
    size = float(np.linalg.norm(vector))
    back = Placement.turned(vector / size, size).rotation if size else np.eye(3)
    np.testing.assert_allclose(back, Placement.turned(axis, angle).rotation, atol=1e-7 if angle > 3.0 else 1e-12)
    assert size == pytest.approx(angle, abs=1e-7)


@pytest.mark.parametrize("segments", [SQUARE, (CIRCLE,)], ids=["square", "turning circle"])
def test_when_a_path_in_space_is_planned_expect_forward_kinematics_to_give_it_back(segments: tuple) -> None:
    tree, wanted = elbow_arm(), path(*segments)
    made = plan_in_space(tree, wanted)
    course = wanted.from_pose(tree.tool_pose(START))
    np.testing.assert_array_equal(made.evaluate(0.0).angle, START)
    h = 1e-5
    for time in np.linspace(0.05, made.duration_s - 0.05, 9):
        tool, own = course.evaluate(float(time)), tree.tool_pose(made.evaluate(time).angle)
        np.testing.assert_allclose(own.translation_m, tool.position, atol=1e-9)
        np.testing.assert_allclose(own.rotation, tool.rotation, atol=1e-9)
        # Speeds are those of the path, and the path's own derivatives are.
        reference = made.evaluate(time)
        twist = tree.tool_jacobian(reference.angle) @ reference.speed
        np.testing.assert_allclose(twist, [*tool.velocity, *tool.angular_velocity], atol=1e-6)
        ahead, behind = course.evaluate(float(time + h)), course.evaluate(float(time - h))
        np.testing.assert_allclose((ahead.position - behind.position) / (2 * h), tool.velocity, atol=1e-8)
        np.testing.assert_allclose((ahead.velocity - behind.velocity) / (2 * h), tool.acceleration, atol=1e-7)
        turned = rotation_vector(ahead.rotation @ behind.rotation.T) / (2 * h)
        np.testing.assert_allclose(turned, tool.angular_velocity, atol=1e-7)
    before, after = made.evaluate(0.3 - h), made.evaluate(0.3 + h)
    np.testing.assert_allclose((after.angle - before.angle) / (2 * h), made.evaluate(0.3).speed, atol=1e-6)
    np.testing.assert_allclose((after.speed - before.speed) / (2 * h), made.evaluate(0.3).acceleration, atol=1e-4)


def test_when_an_arm_has_a_joint_to_spare_expect_a_closed_path_to_bring_all_joints_back() -> None:
    tree = elbow_arm(extra=True)
    start = (*START[:2], 0.2, *START[2:])
    wanted = SpatialPath(name="test", start_posture_rad=start, segments=SQUARE)
    made = plan_in_space(tree, wanted)
    np.testing.assert_allclose(made.evaluate(made.duration_s).angle, start, atol=1e-9)
    course = wanted.from_pose(tree.tool_pose(start))
    np.testing.assert_allclose(
        tree.tool_pose(made.evaluate(0.6).angle).translation_m, course.evaluate(0.6).position, atol=1e-9
    )


def test_when_the_orientation_is_free_expect_the_position_alone_to_follow() -> None:
    tree, wanted = elbow_arm(), path(orientation="free")
    made = plan_in_space(tree, wanted)
    course = wanted.from_pose(tree.tool_pose(START))
    own, tool = tree.tool_pose(made.evaluate(0.75).angle), course.evaluate(0.75)
    np.testing.assert_allclose(own.translation_m, tool.position, atol=1e-9)
    assert np.abs(own.rotation - tool.rotation).max() > 1e-3


def test_when_a_path_in_space_cannot_be_followed_expect_a_refusal_with_place_and_time() -> None:
    tree = elbow_arm()
    far = SpatialSegment(line=SpatialLine(to=(3.0, 0.0, 0.5), duration_s=1.0))
    with pytest.raises(InputError, match=r"segments\[0\] at t = .* s, \(X, Y, Z\) = .*(away|singular values)"):
        plan_in_space(tree, path(far))
    box = OperatingDomain(tuple((a - 0.1, a + 0.1) for a in START), ((-5.0, 5.0),) * 6)
    with pytest.raises(InputError, match=r"segments\[\d\] at t = .*theta_\d = .*modelling box"):
        plan_in_space(tree, path(), box)
    singular = path().model_copy(update={"start_posture_rad": (0.2, 0.4, 0.0, 0.3, 0.9, -0.4)})  # stretched
    straight = (0.2, 0.4, 1.1, 0.0, 0.0, 0.0)  # two axes of the wrist in line
    for posture in (singular.start_posture_rad, straight):
        with pytest.raises(InputError, match="singular"):
            plan_in_space(tree, path().model_copy(update={"start_posture_rad": posture}))
    with pytest.raises(InputError, match="start_posture_rad: got 5 coordinates, expected 6"):
        plan_in_space(tree, path().model_copy(update={"start_posture_rad": START[:5]}))


def test_when_a_path_in_space_is_read_from_a_file_expect_the_same_or_a_refusal_by_field(tmp_path: Path) -> None:
    file = tmp_path / "path.json"
    document = json.loads(path(*SQUARE, CIRCLE).model_dump_json(exclude_none=True))
    file.write_text(json.dumps(document), encoding="utf-8")
    assert read_spatial_path(file) == path(*SQUARE, CIRCLE)
    both = {**document, "segments": [{"line": {"by": [0, 0, 1], "to": [0, 0, 1], "duration_s": 1.0}}]}
    file.write_text(json.dumps(both), encoding="utf-8")
    with pytest.raises(InputError, match=r"segments\[0\].line.to: got to and by, expected exactly one of to, by"):
        read_spatial_path(file)
    file.write_text(json.dumps({**document, "orientation": "free"}), encoding="utf-8")
    with pytest.raises(InputError, match=r"segments\[4\].turn_rad"):
        read_spatial_path(file)
    none = {
        **document,
        "segments": [{"arc": {"centre_by": [0, 0, 1], "axis": [0, 0, 1], "angle_rad": 1, "duration_s": 1}}],
    }
    file.write_text(json.dumps(none), encoding="utf-8")
    with pytest.raises(InputError, match=r"segments\[0\].arc.centre"):
        read_spatial_path(file).from_pose(Placement.identity())


# ---- planar arms without a formula ----------------------------------------------------------------------------------


def planar(n: int) -> PlanarSerialArm:
    return PlanarSerialArm("arm", tuple(Link(0.5, 6.0, 0.25, 0.55) for _ in range(n)))


@pytest.mark.parametrize(("joints", "stated"), [(2, False), (4, False), (5, True), (7, True)])
def test_when_a_planar_arm_of_any_number_of_joints_is_planned_expect_its_tool_on_the_path(
    joints: int, stated: bool
) -> None:
    arm, posture = planar(joints), np.full(joints, 0.4)
    x, y, phi = arm.forward_kinematics(posture)
    to = (float(x) + 0.1, float(y) + 0.12)
    wanted = TaskPath(
        name="test",
        tool_angle_rad=float(phi) if stated else None,
        start=(float(x), float(y)),
        segments=(Segment(line=LineSegment(to=to, duration_s=1.0)),),
    )
    box = OperatingDomain(tuple((a - 1.0, a + 1.0) for a in posture), ((-9.0, 9.0),) * joints)
    made = plan(arm, wanted, box)  # from the middle of the domain
    for time in (0.0, 0.3, 0.7, 1.0):
        pose = arm.forward_kinematics(made.evaluate(time).angle)
        np.testing.assert_allclose(pose[:2], wanted.evaluate(time).position, atol=1e-9)
        if stated:
            assert pose[2] == pytest.approx(float(phi), abs=1e-9)


def test_when_elbow_or_reach_of_a_planar_arm_are_wrong_expect_the_branch_of_the_posture_or_a_refusal() -> None:
    arm = planar(2)
    wanted = TaskPath(
        name="test", start=(0.5, -0.5), segments=(Segment(line=LineSegment(to=(0.4, -0.5), duration_s=1.0)),)
    )
    for posture in ((0.1, 1.2), (1.4, -1.2)):
        elbow = plan(arm, wanted, posture_rad=posture).evaluate(0.5).angle[1]
        assert np.sign(elbow) == np.sign(posture[1])
    with pytest.raises(InputError, match="posture_rad"):
        plan(arm, wanted)
    far = TaskPath(name="test", start=(2.0, 0.0), segments=wanted.segments)
    with pytest.raises(InputError, match=r"segments\[0\] at t = 0 s, \(X, Y\) = \(2, 0\) m: got the tool .* away"):
        plan(arm, far, posture_rad=(0.1, 1.2))
    turned = TaskPath(name="test", tool_angle_rad=0.3, start=wanted.start, segments=wanted.segments)
    with pytest.raises(InputError, match="tool_angle_rad"):
        plan(arm, turned, posture_rad=(0.1, 1.2))
