"""Meshes of a description: where the links are, only files that it names, only below the folders that are stated."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import trimesh

from quasilpv.cli import run
from quasilpv.descriptions.meshes import body_meshes, located
from quasilpv.descriptions.robot_file import read_robot_file
from quasilpv.errors import InputError
from quasilpv.systems.robots.tree_mechanism import TreeMechanism
from quasilpv.view.page import Page
from quasilpv.view.playback import Motion, Playback

UR5 = Path(__file__).parents[2] / "examples/ur5"
LINKS = ("base", "upper_arm", "wrist_3_link", "flange")
ORIGIN = '<origin xyz="0.1 0.2 0.3" rpy="0.4 -0.5 0.6"/>'
CORNER_M = np.array([0.05, 0.1, 0.15])
"""Of the box in the file, in mm there."""


def with_visuals(folder: Path, names: dict[str, str]) -> Path:
    """The UR5 with a mesh in some links. Returns the robot file."""
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(UR5 / "ur5.toml", folder)
    text = (UR5 / "ur5.urdf").read_text(encoding="utf-8")
    for link, name in names.items():
        visual = f'<visual>{ORIGIN}<geometry><mesh filename="{name}" scale="0.001 0.001 0.001"/></geometry></visual>'
        empty, full = f'<link name="{link}"/>', f'<link name="{link}">'
        text = text.replace(empty, f"{full}{visual}</link>").replace(f"{full}\n", f"{full}{visual}\n")
    assert text.count("<visual>") == len(names)
    (folder / "ur5.urdf").write_text(text, encoding="utf-8")
    return folder / "ur5.toml"


def write_box(path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    trimesh.creation.box(2e3 * CORNER_M).export(path)


def test_every_mesh_is_where_pinocchio_has_its_link(tmp_path: Path) -> None:
    file = with_visuals(tmp_path, {link: "meshes/box.stl" for link in LINKS})
    write_box(tmp_path / "meshes/box.stl")
    source = read_robot_file(file)
    found, missing = body_meshes(source)
    assert missing == []
    assert sorted(mesh.link for mesh in found) == sorted(LINKS)
    model = pin.buildModelFromUrdf(str(tmp_path / "ur5.urdf"))
    data, angle = model.createData(), np.array([0.3, -1.0, 1.2, -0.4, 0.9, 2.0])
    pin.framesForwardKinematics(model, data, angle)
    frames = [(np.eye(3), np.zeros(3)), *source.robot().tree.frames(angle)]
    own = pin.SE3(pin.rpy.rpyToMatrix(0.4, -0.5, 0.6), np.array([0.1, 0.2, 0.3]))
    corners = np.array(np.meshgrid(*([-1.0, 1.0],) * 3)).reshape(3, -1).T * CORNER_M
    for mesh in found:
        rotation, origin = frames[mesh.joint + 1]
        shown = mesh.vertices_m @ rotation.T + origin
        place = data.oMf[model.getFrameId(mesh.link)] * own
        expected = np.array([place.act(corner) for corner in corners])
        distance = np.linalg.norm(shown[:, None] - expected[None], axis=2).min(axis=0)
        assert distance.max() < 1e-6, mesh.link  # STL holds single precision


@pytest.mark.parametrize("name", ["../../box.stl", "/etc/passwd", "file:///etc/passwd", "package://../../box.stl"])
def test_when_a_name_leads_out_of_the_folders_expect_it_refused_whether_or_not_there_is_a_file(
    name: str, tmp_path: Path
) -> None:
    write_box(tmp_path / "box.stl")
    file = with_visuals(tmp_path / "a/b", {"upper_arm": name})
    with pytest.raises(InputError, match=r"mesh: got .*expected a file below"):
        body_meshes(read_robot_file(file))


def test_when_a_link_of_the_file_system_leads_out_expect_it_refused(tmp_path: Path) -> None:
    write_box(tmp_path / "box.stl")
    (tmp_path / "a").mkdir()
    (tmp_path / "a/box.stl").symlink_to(tmp_path / "box.stl")
    with pytest.raises(InputError, match="below"):
        located(tmp_path / "a/ur5.urdf", "box.stl", [])


def test_a_package_is_found_in_a_stated_folder_by_its_name_or_as_the_folder_itself(tmp_path: Path) -> None:
    write_box(tmp_path / "packages/arm/meshes/box.stl")
    urdf, name = tmp_path / "a/ur5.urdf", "package://arm/meshes/box.stl"
    expected = (tmp_path / "packages/arm/meshes/box.stl").resolve()
    assert located(urdf, name, [tmp_path / "packages"]) == expected
    assert located(urdf, name, [tmp_path / "packages/arm"]) == expected
    assert located(urdf, name, []) is None
    assert located(urdf, "../packages/arm/meshes/box.stl", [tmp_path / "packages"]) == expected


def test_what_is_not_there_or_in_another_format_is_named(tmp_path: Path) -> None:
    (tmp_path / "arm.dae").write_text("<COLLADA/>")
    file = with_visuals(tmp_path, {"upper_arm": "arm.dae", "wrist_3_link": "meshes/none.stl"})
    assert body_meshes(read_robot_file(file)) == ([], ["arm.dae", "meshes/none.stl"])


@pytest.mark.parametrize("content", [b"", b"solid nothing\nendsolid nothing\n", b"\x00" * 84, b"v 1e999 0 0\n"])
def test_when_a_mesh_is_damaged_expect_a_line(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "box.stl").write_bytes(content)
    file = with_visuals(tmp_path, {"upper_arm": "box.stl"})
    with pytest.raises(InputError, match=r"box\.stl: mesh"):
        body_meshes(read_robot_file(file))


def test_when_folders_are_stated_without_a_robot_expect_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["view", "--log", str(tmp_path / "none.lcmlog"), "--meshes", str(tmp_path)]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_the_page_shows_the_bodies_in_place_of_bars_and_moves_them_with_their_joints(tmp_path: Path) -> None:
    file = with_visuals(tmp_path, {"wrist_3_link": "box.stl"})
    write_box(tmp_path / "box.stl")
    source = read_robot_file(file)
    tree = source.robot().tree
    angle = np.array([[0.0] * 6, [0.3, -1.0, 1.2, -0.4, 0.9, 2.0]])
    nothing, flags = np.zeros((2, 6)), np.zeros(2, dtype=np.int64)
    motion = Motion(
        time_s=np.array([0.0, 1.0]),
        reference_angle_rad=angle,
        angle_rad=angle,
        torque_nm=nothing,
        estimate=nothing,
        disturbance=nothing,
        weight=np.zeros((2, 0)),
        lyapunov_rad2=np.full(2, np.nan),
        state=flags,
        flags=flags,
        step_us=np.zeros(2),
    )
    meshes = tuple(body_meshes(source)[0])
    page = Page(Playback("arm", motion, TreeMechanism(tree, (0.0,) * 6, (0.0,) * 6), "N m", "", meshes), 0)
    try:
        assert not page.scene.robot.root.visible
        page.player.seek(1.0)
        page.step(0.0)
        [(joint, body)] = page.scene.bodies
        rotation, origin = tree.frames(angle[1])[joint]
        np.testing.assert_allclose(body.position, origin, atol=1e-6)
        turned = pin.Quaternion(*body.wxyz).toRotationMatrix()
        np.testing.assert_allclose(turned, rotation, atol=1e-6)
    finally:
        page.close()
