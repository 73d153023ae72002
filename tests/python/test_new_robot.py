"""The documentation's example of a robot of one's own, from its links to a tracked trajectory."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import re
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from quasilpv.artifact import read_artifact
from quasilpv.certificate import verify
from quasilpv.errors import InputError
from quasilpv.systems.robots.arm_parameters import OperatingDomain
from quasilpv.trajectories import plan

EXAMPLE = Path(__file__).parents[2] / "examples" / "four_link_arm.py"
LARGEST_RMS_M = 2e-5


def loaded() -> ModuleType:
    """The example as a module."""
    specification = importlib.util.spec_from_file_location(EXAMPLE.stem, EXAMPLE)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    sys.modules[EXAMPLE.stem] = module  # where dataclasses look up annotations
    specification.loader.exec_module(module)
    return module


example = loaded()
posture = st.tuples(st.floats(-1, 1), st.floats(0.2, 1.5), st.floats(-1, 1)).map(
    lambda angles: np.array([angles[0], angles[1], angles[1], angles[2]])
)
speed = st.lists(st.floats(-1, 1), min_size=4, max_size=4).map(np.array)


def difference(function: object, theta: object, along: object) -> object:
    """Central difference of a function of the joint angles in a direction."""
    step = 1e-5
    return (function(theta + step * along) - function(theta - step * along)) / (2 * step)  # type: ignore[operator]


@given(posture)
def test_inverse_kinematics_inverts_forward_kinematics(theta: np.ndarray) -> None:
    arm = example.ARM
    assert_allclose(arm.inverse_kinematics(arm.forward_kinematics(theta)), theta, atol=1e-12)


@given(posture, speed)
def test_jacobian_and_its_rate_are_derivatives_of_the_pose(theta: np.ndarray, omega: np.ndarray) -> None:
    arm = example.ARM
    assert_allclose(arm.jacobian(theta) @ omega, difference(arm.forward_kinematics, theta, omega), atol=1e-8)
    rate = difference(arm.jacobian, theta, omega)
    assert_allclose(arm.jacobian_rate_times_speed(theta, omega), rate @ omega, atol=1e-8)


@given(posture)
def test_the_drawing_ends_at_the_tool_beside_the_last_link(theta: np.ndarray) -> None:
    arm = example.ARM
    sides = np.diff(arm.skeleton(theta), axis=0)
    assert_allclose(np.linalg.norm(sides, axis=1), [*arm.length_m, arm.crank_m], rtol=1e-12)
    assert sides[-1] @ sides[-2] == pytest.approx(0.0, abs=1e-15)
    assert_allclose(sides.sum(axis=0), arm.forward_kinematics(theta)[:2], atol=1e-15)


def test_on_the_whole_seam_both_elbows_bend_alike_and_the_tool_is_horizontal() -> None:
    reference = plan(example.ARM, example.SEAM).evaluate(np.linspace(0.0, example.SEAM.duration_s, 300))
    poses = np.array([example.ARM.forward_kinematics(angle) for angle in reference.angle])
    assert_allclose(poses[:, 2], np.pi / 2, atol=1e-9)
    assert_allclose(poses[:, 3], 0.0, atol=1e-9)


def test_when_the_path_says_too_little_for_the_robot_expect_what_is_missing() -> None:
    path = example.SEAM.model_copy(update={"tool_angle_rad": None})
    with pytest.raises(InputError, match="3 coordinates of four-link-arm"):
        plan(example.ARM, path)


def test_when_the_tool_is_out_of_reach_expect_the_place() -> None:
    with pytest.raises(InputError, match="joint 4 at"):
        example.ARM.inverse_kinematics([3.0, 0.0, 0.0, 0.0])


def test_a_domain_around_a_motion_is_its_box_widened() -> None:
    domain = OperatingDomain.around([[0.0, 1.0], [2.0, -1.0]], [[0.5, -2.0], [-1.0, 1.0]], 0.25, 2.0)
    assert domain.angle_rad == ((-0.25, 2.25), (-1.25, 1.25))
    assert domain.speed_rad_s == ((-2.0, 2.0), (-4.0, 4.0))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    """What the example writes, and the lines it prints."""
    folder = tmp_path_factory.mktemp("four-link-arm")
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        example.main(folder)
    return folder, printed.getvalue().splitlines()


def test_the_controller_is_proved_for_every_posture_and_payload(run: tuple[Path, list[str]]) -> None:
    artifact = read_artifact(run[0] / "with" / "artifact.json")
    gate = (artifact.verification or {})["gate"]
    assert (gate["passed"], gate["proved"]) == (True, True)
    assert verify(artifact.content(), artifact.name).verified


def test_the_loaded_arm_follows_the_seam_within_its_limits(run: tuple[Path, list[str]], tmp_path: Path) -> None:
    result = example.tracked(example.robot(), read_artifact(run[0] / "with" / "artifact.json"), tmp_path)
    assert np.all(result.run.flags == 0)
    assert max(result.metrics.rms_x_m, result.metrics.rms_y_m) <= LARGEST_RMS_M
    assert np.all(np.abs(result.run.torque_nm).max(axis=0) < example.robot().limits.torque_nm)


def test_compensation_improves_the_printed_accuracy_tenfold(run: tuple[Path, list[str]]) -> None:
    without, compensated = ([float(number) for number in re.findall(r"([\d.]+) um", line)] for line in run[1])
    assert len(without) == 2
    assert all(a > 10 * b for a, b in zip(without, compensated, strict=True))


def test_figures_and_animation_are_written(run: tuple[Path, list[str]]) -> None:
    assert {"path.png", "errors.png", "animation.gif"} <= {path.name for path in run[0].iterdir()}
