"""Animations: what is drawn is the plant, what moves moves, and the texts can be read."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose
from PIL import Image

from quasilpv.arrays import FloatArray
from quasilpv.cli import run
from quasilpv.errors import InputError
from quasilpv.experiments.result import TrackResult, Variant
from quasilpv.figures.animation import FRAMES_PER_SECOND, LAST_FRAME_S, Film, write_animation
from quasilpv.systems.robots.mechanism import PlanarMechanism
from quasilpv.systems.robots.registry import any_robot, robot
from quasilpv.systems.robots.tree_mechanism import TreeMechanism
from reference.random_trees import pinocchio_tree
from reference.readable import assert_readable
from reference.runs import result_of_motion, synthetic_run

ROBOTS = ("arm2", "arm2-upright", "arm3", "fivebar")
POSTURE = {"fivebar": np.array([-0.8, 0.7])}


def motion(mechanism: PlanarMechanism | TreeMechanism, name: str) -> FloatArray:
    """Angles (samples, n) about a regular posture of a robot."""
    centre = POSTURE.get(name, np.full(mechanism.joints, 0.4))
    return centre + 0.2 * np.sin(np.linspace(0.0, 2.0, 1000))[:, None]


def pair_of_results(name: str, error_rad: float = 1e-4) -> list[TrackResult]:
    """Two runs of a second, the second one with a hundredth of the error of the first."""
    mechanism = any_robot(name).model
    reference = motion(mechanism, name)

    def result(compensated: bool, error: float) -> TrackResult:
        true = reference + error * np.sin(30 * reference)
        record = replace(synthetic_run(1000, mechanism.joints), reference_angle_rad=reference, true_angle_rad=true)
        return result_of_motion(mechanism, record, Variant("dob-acceleration", compensated=compensated))

    return [result(False, error_rad), result(True, 0.01 * error_rad)]


@pytest.mark.parametrize("name", ROBOTS)
def test_when_a_robot_is_drawn_expect_links_of_its_lengths_that_end_at_the_tool(name: str) -> None:
    plant = robot(name).with_payload_fraction(1.0)
    links = plant.parameters_document().get("links")
    lengths = [link["length_m"] for link in links] if links else [0.165] * 4
    for theta in motion(plant, name)[::100]:
        points = plant.skeleton(theta)
        assert_allclose(np.linalg.norm(np.diff(points, axis=0), axis=1), lengths, rtol=1e-12)
        assert_allclose(points[0], 0.0, atol=1e-15)
        tool = points[-1] if links else points[2]
        assert_allclose(tool, plant.forward_kinematics(theta)[:2], atol=1e-14)


def test_when_a_robot_in_space_is_drawn_expect_its_joints_where_pinocchio_has_them() -> None:
    mechanism = any_robot("ur5").model
    model = pinocchio_tree(mechanism.tree)
    data = model.createData()
    for theta in motion(mechanism, "ur5")[::200]:
        points = mechanism.skeleton(theta)
        pin.forwardKinematics(model, data, theta)
        assert_allclose(points[0], 0.0, atol=1e-15)
        assert_allclose(points[1:-1], [data.oMi[k].translation for k in range(1, 7)], atol=1e-12)
        assert_allclose(mechanism.tool_path(theta[None]), points[-1:], atol=1e-15)


@pytest.mark.parametrize("name", [*ROBOTS, "ur5"])
def test_when_an_animation_is_drawn_expect_no_text_cut_or_over_another(name: str) -> None:
    film = Film(pair_of_results(name))
    film.draw(0.5)
    assert_readable(film.figure)


def test_when_an_animation_is_written_expect_real_time_and_motion_in_every_panel(tmp_path: Path) -> None:
    drawn: list[tuple[int, int]] = []
    path = tmp_path / "new" / "arm.gif"
    frames = write_animation(pair_of_results("arm3"), path, lambda *step: drawn.append(step))
    with Image.open(path) as image:
        assert image.n_frames == frames == len(drawn) == drawn[-1][1]
        assert image.info["loop"] == 0
        pixels, durations_ms = [], []
        for frame in range(frames):
            image.seek(frame)
            durations_ms.append(image.info["duration"])
            pixels.append(np.asarray(image.convert("L"), dtype=float))
    assert frames == 1 + round(0.999 * FRAMES_PER_SECOND)
    assert sum(durations_ms) == 1000 * (frames - 1) // FRAMES_PER_SECOND + 1000 * LAST_FRAME_S
    change = np.abs(pixels[-1] - pixels[0])
    height, width = change.shape
    upper, lower = change[: 2 * height // 3], change[2 * height // 3 :]
    assert lower.max() > 50
    assert all(panel.max() > 50 for panel in np.array_split(upper[height // 8 :], 4, axis=1)), width


@pytest.mark.parametrize("name", ["arm3", "ur5"])
def test_when_a_run_has_no_error_expect_the_moving_arm_drawn(name: str) -> None:
    film = Film(pair_of_results(name, error_rad=0.0))
    early, late = (np.asarray(film.draw(time_s).convert("L"), dtype=float) for time_s in (0.2, 0.4))
    height = len(early)
    assert np.abs(late - early)[height // 8 : 2 * height // 3].max() > 50  # below the title, which tells the time


def test_when_an_animation_cannot_be_written_expect_an_input_error(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="file"):
        write_animation(pair_of_results("arm2"), tmp_path / "file" / "arm.gif")


@pytest.mark.full
def test_when_animated_from_the_command_line_expect_both_runs_and_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["animate", "fivebar-spiral", "--no-figures", "--rate-hz", "2000"]) == 0
    table = capsys.readouterr().out
    assert table.count("dob-acceleration") == 2
    assert "no compensation" in table
    assert (tmp_path / "out/animate/fivebar-spiral/animation.gif").stat().st_size > 100_000
