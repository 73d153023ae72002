"""Figures and scene of a robot in space: what is drawn is where the robot is, and can be read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from quasilpv.experiments.result import TrackResult, Variant
from quasilpv.figures import comparison_figure, error_figure, path_figure, torque_figure
from quasilpv.figures.gallery import figures_of
from quasilpv.figures.robot import MARKS, robot_figure, way_of
from quasilpv.figures.space import Viewpoint
from quasilpv.systems.robots.registry import any_robot
from quasilpv.telemetry.codes import AT_LIMIT
from quasilpv.view.page import Page
from quasilpv.view.playback import Motion, Playback
from quasilpv.view.robot_scene import in_space, turned_from_x
from reference.readable import assert_readable, texts_with_boxes
from reference.runs import result_of_motion, synthetic_run

UR5 = any_robot("ur5").model
POSTURE = np.array([0.2, -1.7, 2.0, -1.87, -1.57, 0.3])


def result_in_space(error_rad: float = 1e-4, posture: np.ndarray = POSTURE) -> TrackResult:
    """A UR5 about a regular posture."""
    run = synthetic_run(1000, 6)
    reference = posture + 0.15 * run.reference_angle_rad
    true = reference + error_rad * np.sin(30.0 * reference)
    run = replace(run, reference_angle_rad=reference, true_angle_rad=true)
    return result_of_motion(UR5, run, Variant("dob-acceleration"))


@pytest.mark.parametrize("draw", [robot_figure, path_figure, error_figure, torque_figure])
def test_when_a_figure_in_space_is_drawn_expect_no_text_cut_or_over_another(
    draw: Callable[[TrackResult], Figure],
) -> None:
    assert_readable(draw(result_in_space()))


def test_when_a_tall_arm_is_drawn_expect_the_labels_of_its_axes_above_the_error() -> None:
    boxes = texts_with_boxes(robot_figure(result_in_space(posture=np.array([0.0, -1.7, 0.3, -0.4, -1.57, 0.3]))))
    [title] = [box for text, box in boxes if text.startswith("error of the tool")]
    assert all(box[1] > title[3] for text, box in boxes if text in {"X (m)", "Y (m)"})


def test_when_runs_in_space_are_compared_expect_no_text_cut_or_over_another() -> None:
    names = ("pid-tuned", "ctc-tuned", "dob-acceleration")
    assert_readable(comparison_figure([replace(result_in_space(), variant=Variant(name)) for name in names]))


def test_only_a_run_in_space_has_a_figure_of_the_robot() -> None:
    flat = replace(result_in_space(), reference_position_m=result_in_space().reference_position_m[:, :2])
    assert "robot" in figures_of(result_in_space())
    assert "robot" not in figures_of(flat)


def test_when_the_robot_is_drawn_expect_its_joints_its_path_and_the_tool_error_in_mm_along_it() -> None:
    result = result_in_space()
    space, errors = robot_figure(result).axes
    lines = {str(line.get_label()): line for line in space.lines}
    assert_allclose(np.transpose(lines["tool"].get_data_3d()), result.tool_position_m)
    drawn = [np.transpose(line.get_data_3d()) for line in space.lines]
    start = result.robot.skeleton(result.run.true_angle_rad[0])
    assert any(points.shape == start.shape and np.allclose(points, start) for points in drawn)

    way, error_mm = errors.lines[0].get_data()
    length = np.linalg.norm(np.diff(result.reference_position_m, axis=0), axis=1).sum()
    assert (way[0], way[-1]) == (0.0, pytest.approx(length))
    distance_mm = 1e3 * np.linalg.norm(result.tool_position_m - result.reference_position_m, axis=1)
    assert_allclose(error_mm, distance_mm)
    assert errors.get_ylabel() == "tool error (mm)"
    assert f"rms {np.sqrt(np.mean(distance_mm**2)):.3g} mm" in errors.get_title(loc="left")


def test_marks_stand_at_the_quarters_of_the_way_and_of_a_tool_that_stands_of_the_time() -> None:
    result = result_in_space()
    way, marks = way_of(result)
    assert_allclose(way[marks] / way[-1], np.arange(len(MARKS)) / len(MARKS), atol=0.01)

    still = replace(result, reference_position_m=np.tile(result.reference_position_m[:1], (1000, 1)))
    way, marks = way_of(still)
    assert marks == [0, 250, 500, 750]
    assert robot_figure(still).axes[1].get_xlabel() == "time (s)"


@pytest.mark.parametrize("joints", [1, 3, 6, 7])
def test_every_torque_stands_between_its_limits_and_the_share_at_a_limit_above(joints: int) -> None:
    result = result_in_space()
    run = replace(synthetic_run(1000, joints), flags=np.where(np.arange(1000) < 25, AT_LIMIT, 0))
    metrics = replace(result.metrics, share_at_limit=0.025)
    limits = np.linspace(400.0, 350.0, joints)
    figure = torque_figure(replace(result, run=run, metrics=metrics, torque_limit_nm=limits))
    *panels, increments = figure.axes
    assert len(panels) == joints
    for joint, axes in enumerate(panels):
        lower, upper, torque = axes.lines
        assert (lower.get_ydata()[0], upper.get_ydata()[0]) == (-limits[joint], limits[joint])
        assert_allclose(torque.get_ydata(), run.torque_nm[:, joint])
        low, high = axes.get_ylim()
        assert low < -limits[joint] < limits[joint] < high
    assert len(increments.lines) == joints
    assert "at a limit in 2.5 % of the samples" in figure.get_suptitle()


@given(st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3))
def test_a_bar_is_turned_along_its_link(direction: list[float]) -> None:
    length = float(np.linalg.norm(direction))
    along = np.array(direction) / length if length > 1e-3 else np.array([-1.0, 0.0, 0.0])
    w, x, y, z = turned_from_x(along)
    assert_allclose(Rotation.from_quat([x, y, z, w]).apply([1.0, 0.0, 0.0]), along, atol=1e-7)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_one_looks_at_a_path_from_before_it(axis: int) -> None:
    """A circle about an axis through a point in front of the base."""
    phase = np.linspace(0.0, 2.0 * np.pi, 50)
    circle = np.roll(np.column_stack([np.zeros(50), np.cos(phase), np.sin(phase)]), axis, axis=1)
    centre = np.array([2.0, 2.0, 1.5])
    towards = Viewpoint.of_path(circle + centre).direction
    assert np.linalg.norm(towards) == pytest.approx(1.0)
    assert abs(towards[axis]) > 0.5  # not edge-on
    assert towards @ centre > 0.0  # from outside
    assert towards[2] > 0.0


def motion_of(result: TrackResult) -> Motion:
    run = result.run
    none = np.zeros(run.time_s.size)
    return Motion(
        time_s=run.time_s,
        reference_angle_rad=run.reference_angle_rad,
        angle_rad=run.true_angle_rad,
        torque_nm=run.torque_nm,
        estimate=run.filtered_disturbance,
        disturbance=np.full_like(run.torque_nm, np.nan),
        weight=np.zeros((run.time_s.size, 0)),
        lyapunov_rad2=np.full_like(none, np.nan),
        state=none.astype(np.int64),
        flags=run.flags,
        step_us=none,
    )


def test_the_page_shows_a_robot_in_space_where_it_is_at_its_time() -> None:
    result = result_in_space()
    page = Page(Playback("drawn", motion_of(result), UR5, "rad/s²"), 0)
    try:
        page.player.playing = False
        page.player.seek(0.5)
        page.step(0.0)
        bars = page.scene.robot
        skeleton = UR5.skeleton(result.run.true_angle_rad[500])
        assert_allclose([joint.position for joint in bars.joints], skeleton, atol=1e-6)
        middles = 0.5 * (skeleton[1:] + skeleton[:-1])
        assert_allclose([bar.position for bar in bars.links], middles, atol=1e-6)
        lengths = np.linalg.norm(np.diff(skeleton, axis=0), axis=1)
        assert_allclose([np.atleast_1d(bar.scale)[0] for bar in bars.links], np.maximum(lengths, 1e-6), atol=1e-6)
    finally:
        page.close()


def test_points_of_a_plane_stand_upright_in_the_scene() -> None:
    assert_allclose(in_space(np.array([[1.0, 2.0]])), [[1.0, 0.0, 2.0]])
    assert_allclose(in_space(np.array([[1.0, 2.0, 3.0]])), [[1.0, 2.0, 3.0]])
