"""Trajectories: time law, paths, inverse kinematics, the quintic fit, refusals and files."""

import itertools
import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from quasilpv.documents.canonical import canonical_json, with_hash
from quasilpv.errors import InputError
from quasilpv.systems.robots.arm_parameters import OperatingDomain
from quasilpv.systems.robots.registry import robot
from quasilpv.trajectories import (
    TaskPath,
    Trajectory,
    plan,
    read_path,
    read_trajectory,
    serial_circle,
    serial_square,
    write_trajectory,
)
from quasilpv.trajectories.library import CIRCLE, SQUARE
from quasilpv.trajectories.paths import MAX_DURATION_S, ArcSegment, LineSegment, Segment, septic
from quasilpv.trajectories.planned import MIN_SINGULARITY, joint_motion
from quasilpv.trajectories.quintics import quintic_hermite

ARM = robot("arm3").model
L1, L2, L3 = 1.0, 0.9, 0.8
DEFAULTS = {"square": (SQUARE, serial_square(ARM)), "circle": (CIRCLE, serial_circle(ARM))}


def tool(theta: np.ndarray) -> np.ndarray:
    """Pose (X, Y, Phi) of the 3-DoF arm, written from its geometry: theta = 0 hangs, angles counter-clockwise."""
    alpha = np.cumsum(theta, axis=-1)
    lengths = np.array([L1, L2, L3])
    return np.stack([np.sin(alpha) @ lengths, -np.cos(alpha) @ lengths, alpha[..., -1]], axis=-1)


def path_of(*segments: Segment, start: tuple[float, float] = (1.3, -1.75), angle: float = math.pi / 4) -> TaskPath:
    return TaskPath(name="test", tool_angle_rad=angle, start=start, segments=segments)


def line(x: float, y: float, duration: float = 1.0) -> Segment:
    return Segment(line=LineSegment(to=(x, y), duration_s=duration))


def test_when_the_septic_is_compared_with_its_polynomial_expect_value_and_two_derivatives() -> None:
    s = sp.symbols("s")
    q = 35 * s**4 - 84 * s**5 + 70 * s**6 - 20 * s**7
    for order in (1, 2, 3):
        assert sp.diff(q, s, order).subs(s, 0) == sp.diff(q, s, order).subs(s, 1) == 0
    for value in np.linspace(0.0, 1.0, 41):
        exact = [float(sp.diff(q, s, order).subs(s, sp.Rational(value))) for order in range(3)]
        np.testing.assert_allclose(septic(float(value)), exact, rtol=0, atol=1e-13)


@pytest.mark.parametrize("path", [SQUARE, CIRCLE])
def test_when_a_path_is_differentiated_numerically_expect_its_velocity_and_acceleration(path: TaskPath) -> None:
    h = 1e-5
    for time in np.linspace(0.01, path.duration_s - 0.01, 57):
        before, here, after = (path.evaluate(time + step) for step in (-h, 0.0, h))
        np.testing.assert_allclose((after.position - before.position) / (2 * h), here.velocity, atol=1e-8)
        np.testing.assert_allclose((after.velocity - before.velocity) / (2 * h), here.acceleration, atol=2e-7)


def test_when_the_square_is_drawn_expect_its_corners_at_rest_and_the_speed_of_the_septic() -> None:
    corners = [(1.3, -1.75), (1.7, -1.75), (1.7, -1.35), (1.3, -1.35), (1.3, -1.75)]
    assert SQUARE.segment_times_s == (0.0, 0.75, 1.5, 2.25, 3.0)
    for time, corner in zip(SQUARE.segment_times_s, corners, strict=True):
        motion = SQUARE.evaluate(time)
        np.testing.assert_allclose(motion.position, corner, atol=1e-15)
        np.testing.assert_array_equal(motion.velocity, [0.0, 0.0])
        np.testing.assert_array_equal(motion.acceleration, [0.0, 0.0])
    # q' is largest at s = 1/2: 35/16; q'' where its derivative vanishes: s = (5 - sqrt(5))/10, 84 sqrt(5)/25.
    motions = [SQUARE.evaluate(time) for time in np.linspace(0, 3, 6001)]
    speed = max(float(np.hypot(*motion.velocity)) for motion in motions)
    acceleration = max(float(np.hypot(*motion.acceleration)) for motion in motions)
    assert speed == pytest.approx(0.4 / 0.75 * 35 / 16, rel=1e-6)
    assert speed <= 1.17
    assert acceleration == pytest.approx(0.4 / 0.75**2 * 84 * math.sqrt(5) / 25, rel=1e-5)
    assert acceleration <= 5.35


def test_when_the_arc_is_drawn_expect_three_quarters_of_the_circle_within_the_stated_speed() -> None:
    motions = [CIRCLE.evaluate(time) for time in np.linspace(0, 3, 3001)]
    offsets = np.array([motion.position for motion in motions]) - [1.5, -1.55]
    np.testing.assert_allclose(np.hypot(*offsets.T), 0.2, rtol=1e-13)
    turned = np.unwrap(np.arctan2(offsets[:, 1], offsets[:, 0]))
    assert turned[0] == pytest.approx(0.0, abs=1e-15)
    assert turned[-1] == pytest.approx(1.5 * math.pi)
    assert (np.diff(turned) >= 0).all()
    assert max(np.hypot(*motion.velocity) for motion in motions) == pytest.approx(0.687, abs=0.003)
    assert max(np.hypot(*motion.acceleration) for motion in motions) == pytest.approx(2.36, abs=0.005)


@pytest.mark.parametrize(
    ("name", "lowest", "highest", "speed", "acceleration"),
    [
        ("square", (-0.166, 1.060, -1.027), (0.264, 1.944, -0.540), (1.18, 1.35, 1.30), (5.6, 7.0, 6.2)),
        ("circle", (-0.166, 1.309, -1.026), (0.237, 1.836, -0.578), (0.69, 0.81, 0.75), None),
    ],
)
def test_when_the_default_trajectories_are_planned_expect_the_ranges_of_an_earlier_independent_study(
    name: str, lowest: tuple, highest: tuple, speed: tuple, acceleration: tuple | None
) -> None:
    trajectory = DEFAULTS[name][1]
    assert trajectory.duration_s == 3.0
    reference = trajectory.evaluate(np.linspace(0, 3, 6001))
    np.testing.assert_allclose(reference.angle.min(axis=0), lowest, atol=1e-3)
    np.testing.assert_allclose(reference.angle.max(axis=0), highest, atol=1e-3)
    np.testing.assert_allclose(np.abs(reference.speed).max(axis=0), speed, atol=6e-3)
    if acceleration is not None:
        np.testing.assert_allclose(np.abs(reference.acceleration).max(axis=0), acceleration, atol=0.06)


def test_when_the_square_is_driven_expect_the_torques_of_an_earlier_independent_study() -> None:
    reference = DEFAULTS["square"][1].evaluate(np.linspace(0, 3, 3001))
    torque = np.array([ARM.inverse_dynamics(*state) for state in zip(*reference, strict=True)])
    np.testing.assert_allclose(torque.min(axis=0), [19.6, 34.0, 5.3], atol=0.1)
    np.testing.assert_allclose(torque.max(axis=0), [143.7, 108.7, 18.0], atol=0.1)


@pytest.mark.parametrize("name", DEFAULTS)
def test_when_the_arm_follows_the_reference_expect_the_tool_on_the_path_within_a_nanometre(name: str) -> None:
    path, trajectory = DEFAULTS[name]
    times = np.random.default_rng(3).uniform(0, 3, 2000)
    poses = tool(trajectory.evaluate(times).angle)
    positions = np.array([path.evaluate(time).position for time in times])
    assert np.hypot(*(poses[:, :2] - positions).T).max() < 1e-9
    assert np.abs(poses[:, 2] - math.pi / 4).max() < 1e-9
    assert 0.0 < trajectory.task["fit_error_m"] < 1e-9


@pytest.mark.parametrize("name", DEFAULTS)
def test_when_the_path_is_differentiated_through_the_arm_expect_joint_speed_and_acceleration(name: str) -> None:
    path, _ = DEFAULTS[name]
    h = 1e-4
    times = np.linspace(0.05, 2.95, 59)
    before, here, after = (joint_motion(ARM, path, times + step, "path") for step in (-h, 0.0, h))
    np.testing.assert_allclose((after.angle - before.angle) / (2 * h), here.speed, atol=2e-6)
    np.testing.assert_allclose((after.speed - before.speed) / (2 * h), here.acceleration, atol=2e-5)


@pytest.mark.parametrize("name", DEFAULTS)
def test_when_the_reference_is_differentiated_numerically_expect_its_own_speed_and_acceleration(name: str) -> None:
    trajectory = DEFAULTS[name][1]
    h = 1e-5
    times = np.random.default_rng(4).uniform(h, 3 - h, 500)
    before, here, after = (trajectory.evaluate(times + step) for step in (-h, 0.0, h))
    np.testing.assert_allclose((after.angle - before.angle) / (2 * h), here.speed, atol=1e-8)
    np.testing.assert_allclose((after.speed - before.speed) / (2 * h), here.acceleration, atol=1e-6)


@pytest.mark.parametrize("name", DEFAULTS)
def test_when_a_knot_is_approached_from_both_sides_expect_equal_angle_speed_and_acceleration(name: str) -> None:
    trajectory = DEFAULTS[name][1]
    powers = np.polynomial.polynomial
    for s, joint in itertools.product(range(len(trajectory.coefficients) - 1), range(3)):
        left, right = trajectory.coefficients[s : s + 2, joint]
        h = trajectory.knots_s[s + 1] - trajectory.knots_s[s]
        for order in range(3):
            end = powers.polyval(h, powers.polyder(left, order))
            assert end == pytest.approx(math.factorial(order) * right[order], rel=1e-12, abs=1e-12)


def test_when_time_is_before_the_start_or_after_the_end_expect_rest_at_the_first_and_last_angles() -> None:
    trajectory = Trajectory(
        "drift", np.array([0.0, 1.0, 3.0]), np.array([[[1.0, 2, 0, 0, 0, 0]], [[3.0, 2, 0, 0, 0, 0]]])
    )
    times = [-1.0, 0.0, 1.0, 3.0, 3.5]
    reference = trajectory.evaluate(times)
    assert reference.angle[:, 0].tolist() == [1.0, 1.0, 3.0, 7.0, 7.0]
    assert reference.speed[:, 0].tolist() == [0.0, 2.0, 2.0, 2.0, 0.0]
    for i, time in enumerate(times):
        np.testing.assert_array_equal(trajectory.evaluate(time).angle, reference.angle[i])


@given(st.lists(st.floats(-10, 10), min_size=6, max_size=6), st.floats(1e-3, 2.0))
def test_when_states_of_a_quintic_are_interpolated_expect_that_quintic(coefficients: list[float], h: float) -> None:
    quintic = np.polynomial.Polynomial(coefficients)
    knots = np.array([0.0, h])
    motion = [np.array([[quintic.deriv(order)(t) if order else quintic(t)] for t in knots]) for order in range(3)]
    found = np.polynomial.Polynomial(quintic_hermite(knots, motion)[0, 0])
    for order in range(3):
        expected = quintic.deriv(order)(h / 3) if order else quintic(h / 3)
        value = found.deriv(order)(h / 3) if order else found(h / 3)
        # The states are doubles: their rounding divided by h^order is what the middle cannot do better than.
        assert value == pytest.approx(expected, rel=1e-9, abs=1e-11 / h**order)


@settings(max_examples=30)
@given(st.floats(1.1, 1.6), st.floats(-1.8, -1.2), st.floats(0.5, 1.0), st.floats(0.3, 3.0))
def test_when_a_line_inside_the_workspace_is_planned_expect_the_tool_on_it(
    x: float, y: float, angle: float, duration: float
) -> None:
    path = path_of(line(x, y, duration), start=(1.2, -1.3), angle=angle)
    trajectory = plan(ARM, path)
    times = np.linspace(0, duration, 50)
    poses = tool(trajectory.evaluate(times).angle)
    positions = np.array([path.evaluate(time).position for time in times])
    np.testing.assert_allclose(poses[:, :2], positions, rtol=0, atol=1e-9)


def test_when_a_path_is_too_fast_for_the_first_knots_expect_them_refined() -> None:
    slow, fast = (plan(ARM, path_of(line(1.7, -1.75, duration))) for duration in (0.75, 0.05))
    assert slow.task["knot_spacing_s"] == 0.01
    assert fast.task["knot_spacing_s"] < 0.01
    assert fast.task["fit_error_m"] < 1e-9


def test_when_a_duration_is_no_multiple_of_the_spacing_expect_knots_at_segment_boundaries() -> None:
    trajectory = plan(ARM, path_of(line(1.5, -1.7, 0.333), line(1.4, -1.5, 0.5)))
    assert 0.333 in trajectory.knots_s
    assert trajectory.duration_s == 0.833
    assert np.diff(trajectory.knots_s).max() <= 0.01 * (1 + 1e-9)


def test_when_the_first_joint_passes_half_a_turn_expect_no_jump() -> None:
    # The third joint, 0.8 m behind the tool, goes round the base: from the right over the top to the lower side.
    wrist = 0.8 * np.array([math.sin(0.7), -math.cos(0.7)])
    around = Segment(arc=ArcSegment(centre=(wrist[0], wrist[1]), angle_rad=1.5 * math.pi, duration_s=4.0))
    trajectory = plan(ARM, path_of(around, start=(wrist[0] + 1.3, wrist[1]), angle=0.7))
    angle = trajectory.evaluate(np.linspace(0, 4, 401)).angle
    assert np.abs(np.diff(angle, axis=0)).max() < 0.1
    assert angle[-1, 0] - angle[0, 0] == pytest.approx(1.5 * math.pi)
    np.testing.assert_allclose(np.hypot(*(tool(angle)[:, :2] - wrist).T), 1.3)


@pytest.mark.parametrize(
    ("path", "domain", "field", "got", "expected"),
    [
        (
            path_of(line(4.0, -1.75)),
            None,
            "segments[0] at t = ",
            "third joint at",
            "a distance strictly between 0.1 and 1.9 m",
        ),
        (
            path_of(line(1.3, -1.35), line(0.8 * math.sin(0.7) + 0.104, -0.8 * math.cos(0.7)), angle=0.7),
            None,
            "segments[1] at t = ",
            "|sin(theta_2)| = 0.0",
            f"at least {MIN_SINGULARITY}",
        ),
        (
            SQUARE,
            OperatingDomain(((-1, 1), (1.1, 3), (-2, 2)), ((-9, 9),) * 3),
            "segments[0] at t = ",
            "theta_2 = 1.0",
            "within [1.1, 3] rad, the modelling box",
        ),
        (
            SQUARE,
            OperatingDomain(((-3, 3),) * 3, ((-9, 9), (-9, 9), (-1, 1))),
            "segments[1] at t = ",
            "omega_3 = ",
            "within [-1, 1] rad/s, the modelling box",
        ),
    ],
    ids=["unreachable", "singular", "outside the angle box", "outside the speed box"],
)
def test_when_a_path_cannot_be_followed_expect_the_reason_the_time_and_the_place(
    path: TaskPath, domain: OperatingDomain | None, field: str, got: str, expected: str
) -> None:
    with pytest.raises(InputError) as error:
        plan(ARM, path, domain, source="path.json")
    assert error.value.source == "path.json"
    assert error.value.field.startswith(field)
    assert "(X, Y) = (" in error.value.field
    assert got in error.value.got
    assert expected in error.value.expected


@pytest.mark.parametrize("name", DEFAULTS)
def test_when_the_default_trajectories_are_planned_in_the_modelling_box_of_the_arm_expect_them_accepted(
    name: str,
) -> None:
    path, trajectory = DEFAULTS[name]
    assert plan(ARM, path, robot("arm3").domain).hash == trajectory.hash


PATH_FILE = {
    "name": "mine",
    "tool_angle_rad": 0.7,
    "start": [1.3, -1.75],
    "segments": [
        {"line": {"to": [1.5, -1.75], "duration_s": 0.5}},
        {"arc": {"centre": [1.5, -1.55], "angle_rad": -1.0, "duration_s": 1}},
    ],
}


def test_when_a_path_file_is_read_expect_the_path_it_describes(tmp_path: Path) -> None:
    file = tmp_path / "path.json"
    file.write_text(json.dumps(PATH_FILE, indent=2))
    path = read_path(file)
    end = (1.5 + 0.2 * math.cos(-math.pi / 2 - 1.0), -1.55 + 0.2 * math.sin(-math.pi / 2 - 1.0))
    np.testing.assert_allclose(path.evaluate(0.5).position, (1.5, -1.75), atol=1e-15)
    np.testing.assert_allclose(path.evaluate(1.5).position, end, atol=1e-15)
    assert plan(ARM, path).task["path"] == PATH_FILE


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (lambda d: d.pop("start"), "start"),
        (lambda d: d.update(segments=[]), "segments"),
        (lambda d: d.update(speed=1), "speed"),
        (lambda d: d["segments"][0]["line"].update(duration_s=0), "segments[0].line.duration_s"),
        (lambda d: d["segments"][0]["line"].update(duration_s=MAX_DURATION_S), "segments"),
        (lambda d: d["segments"][0]["line"].update(to=[1.5]), "segments[0].line.to[1]"),
        (lambda d: d["segments"][0].update(arc=d["segments"][1]["arc"]), "segments[0].line"),
        (lambda d: d["segments"].append({}), "segments[2].line"),
        (lambda d: d["segments"].append({"spline": {}}), "segments[2].spline"),
        (lambda d: d["segments"][1]["arc"].update(centre=[1.5, -1.75]), "segments[1].arc.centre"),
        (lambda d: d["segments"][1]["arc"].update(angle_rad="90 degrees"), "segments[1].arc.angle_rad"),
    ],
)
def test_when_a_path_file_breaks_a_rule_expect_its_field(change: Callable, field: str, tmp_path: Path) -> None:
    document = json.loads(json.dumps(PATH_FILE))
    change(document)
    file = tmp_path / "path.json"
    file.write_text(json.dumps(document))
    with pytest.raises(InputError) as error:
        read_path(file)
    assert (error.value.source, error.value.field) == (str(file), field)


@pytest.mark.parametrize("extension", ["json", "cbor"])
def test_when_a_trajectory_is_written_expect_the_same_one_back(extension: str, tmp_path: Path) -> None:
    trajectory = DEFAULTS["square"][1]
    back = read_trajectory(write_trajectory(tmp_path / f"square.{extension}", trajectory))
    assert (back.name, back.task, back.hash) == (trajectory.name, trajectory.task, trajectory.hash)
    np.testing.assert_array_equal(back.knots_s, trajectory.knots_s)
    np.testing.assert_array_equal(back.coefficients, trajectory.coefficients)


def test_when_the_extension_is_unknown_expect_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"extension: got \.yaml, expected one of \.json, \.cbor"):
        write_trajectory(tmp_path / "square.yaml", DEFAULTS["square"][1])


@pytest.mark.parametrize("extension", ["json", "cbor"])
def test_when_bits_of_a_trajectory_file_are_flipped_expect_it_refused(extension: str, tmp_path: Path) -> None:
    path = write_trajectory(tmp_path / f"line.{extension}", plan(ARM, path_of(line(1.4, -1.7, 0.1))))
    data = path.read_bytes()
    rng = np.random.default_rng(5)
    for bit in rng.choice(8 * len(data), size=300, replace=False):
        damaged = bytearray(data)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        with pytest.raises(InputError):
            read_trajectory(path)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (lambda d: d["knots_s"].__setitem__(0, -0.01), "knots_s[0]"),
        (lambda d: d["knots_s"].__setitem__(2, d["knots_s"][1]), "knots_s[2]"),
        (lambda d: d["knots_s"].pop(), "coefficients"),
        (lambda d: d["coefficients"][3].pop(), "coefficients[3]"),
        (lambda d: d["coefficients"][3][1].pop(), "coefficients[3][1][5]"),
        (lambda d: d["coefficients"][4][2].__setitem__(0, d["coefficients"][4][2][0] + 1e-8), "coefficients[4][2]"),
        (lambda d: d["coefficients"][4][2].__setitem__(1, d["coefficients"][4][2][1] + 1e-8), "coefficients[4][2]"),
        (lambda d: d["coefficients"][4][2].__setitem__(2, d["coefficients"][4][2][2] + 2e-8), "coefficients[4][2]"),
        (lambda d: d.update(joints=3.5), "joints"),
        (lambda d: d.update(joints=2), "coefficients[0]"),
        (lambda d: d.update(knots_s=[0]), "knots_s"),
        (lambda d: d.update(unit="rad"), "unit"),
    ],
)
def test_when_a_hashed_trajectory_breaks_a_rule_expect_its_field(change: Callable, field: str, tmp_path: Path) -> None:
    document = DEFAULTS["square"][1].to_document()
    change(document)
    path = tmp_path / "broken.json"
    path.write_bytes(canonical_json(with_hash(document)))
    with pytest.raises(InputError) as error:
        read_trajectory(path)
    assert error.value.field == field


def test_when_a_trajectory_is_changed_in_place_expect_an_error() -> None:
    with pytest.raises(ValueError, match="read-only"):
        DEFAULTS["square"][1].coefficients[0, 0, 0] = 1.0
