"""Robots from description files: what is read, what is refused, and what a robot.toml adds."""

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

from quasilpv.cli import run
from quasilpv.descriptions.inertia_range import proved_inertia_range
from quasilpv.descriptions.plausibility import concerns, require_bodies
from quasilpv.descriptions.robot_file import read_description, read_robot_file
from quasilpv.errors import InputError
from quasilpv.systems.robots.tree import JointKind

DATA = Path(__file__).parents[1] / "data" / "robots"
URDF, MJCF, TOML = DATA / "two_links.urdf", DATA / "two_links.xml", DATA / "two_links.toml"

Edited = Callable[..., Path]


@pytest.fixture
def edited(tmp_path: Path) -> Edited:
    """A file of `tests/data/robots` with some text replaced, in a folder of its own beside the description."""

    def write(path: Path, *changes: tuple[str, str]) -> Path:
        for name in (URDF, MJCF):
            if not (tmp_path / name.name).exists():
                (tmp_path / name.name).write_bytes(name.read_bytes())
        text = path.read_text(encoding="utf-8")
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / path.name).write_text(text, encoding="utf-8")
        return tmp_path / path.name

    return write


def postures(seed: int, n: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-2.0, 2.0, (5, n))


def test_a_urdf_moves_as_pinocchio_moves_it_with_its_fingers_held() -> None:
    described = read_description(URDF)
    tree = described.chain("flange", {"slide": 0.03, "copy": 0.01})
    model = pin.buildModelFromUrdf(str(URDF))
    held = pin.neutral(model)
    for name, place in (("slide", 0.03), ("copy", 0.01)):
        held[model.joints[model.getJointId(name)].idx_q] = place
    reduced = pin.buildReducedModel(model, [model.getJointId("slide"), model.getJointId("copy")], held)
    data = reduced.createData()
    assert [joint.kind for joint in tree.joints] == [JointKind.REVOLUTE, JointKind.CONTINUOUS]
    for q in postures(1, 2):
        at = np.array([q[0], np.cos(q[1]), np.sin(q[1])])  # Pinocchio's coordinates of a continuous joint
        M = pin.crba(reduced, data, at)
        assert_allclose(tree.inertia(q), np.triu(M) + np.triu(M, 1).T, atol=1e-13)
        assert_allclose(tree.gravity(q), pin.computeGeneralizedGravity(reduced, data, at), atol=1e-12)


def test_an_mjcf_without_its_meshes_moves_as_mujoco_moves_it(tmp_path: Path) -> None:
    tree = read_description(MJCF).chain("flange", {})
    without = MJCF.read_text().replace('<asset><mesh name="rod" file="nowhere.stl"/></asset>', "")
    model = mujoco.MjModel.from_xml_string(
        without.replace('<geom type="mesh" mesh="rod" contype="0" conaffinity="0"/>', "")
    )
    data = mujoco.MjData(model)
    for q in postures(2, 2):
        data.qpos[:], data.qvel[:] = q, q[::-1]
        mujoco.mj_forward(model, data)
        M = np.zeros((2, 2))
        mujoco.mj_fullM(model, data, M)
        assert_allclose(tree.inertia(q), M, atol=1e-12)
        assert_allclose(tree.inverse_dynamics(q, q[::-1], np.zeros(2)), data.qfrc_bias, atol=1e-11)


def test_both_formats_of_one_robot_agree() -> None:
    urdf = read_description(URDF)
    bare = urdf.chain("flange", {"slide": 0.0, "copy": 0.0})
    fingers = 0.2  # kg at the flange, in the URDF only
    same = read_description(MJCF).chain("flange", {})
    q = np.array([0.3, 0.7])
    J = same.tool_jacobian(q)[:3]
    spin = same.tool_jacobian(q)[3:]
    added = fingers * J.T @ J + 0.0002 * spin.T @ spin
    assert_allclose(bare.inertia(q) + np.diag([0.3, 0.2]), same.inertia(q) + added, atol=1e-12)


def test_what_a_file_says_of_limits_and_drives_is_taken_only_where_it_says_something() -> None:
    shoulder, elbow = read_description(URDF).joints[:2]
    assert (shoulder.speed, shoulder.torque, shoulder.rotor_inertia_kg_m2) == (3.0, 50.0, None)
    assert (shoulder.damping_nm_s, shoulder.friction_nm) == (0.5, 0.1)
    assert (elbow.speed, elbow.torque) == (None, None)  # 1e6 rad/s and 0 N m are ways to say nothing
    shoulder, elbow = read_description(MJCF).joints
    assert (shoulder.torque, shoulder.rotor_inertia_kg_m2, shoulder.damping_nm_s) == (50.0, 0.3, 200.0)
    assert (elbow.kind, elbow.friction_nm, elbow.torque) == (JointKind.CONTINUOUS, 0.1, None)


def test_a_robot_file_adds_what_the_description_lacks_and_loads_are_bounded_by_their_corners() -> None:
    robot = read_robot_file(TOML).robot()
    assert robot.payload is not None
    assert [joint.torque_nm for joint in robot.joints] == [50.0, 30.0]
    assert robot.tree.rotor_inertias.tolist() == [0.3, 0.2]
    assert robot.lightest().rotor_inertias.tolist() == pytest.approx([0.3, 0.18])
    assert len(robot.heaviest()) == 8
    w = np.array([0.4, -1.0])
    energies = [w @ heavy.inertia([0.2, 1.0]) @ w for heavy in robot.heaviest()]
    for share in (0.0, 0.4, 1.0):
        assert w @ robot.loaded(share).inertia([0.2, 1.0]) @ w < max(energies)
        assert w @ robot.loaded(share).inertia([0.2, 1.0]) @ w > w @ robot.lightest().inertia([0.2, 1.0]) @ w


def test_the_range_of_inertias_is_proved_and_holds_what_random_postures_show() -> None:
    found = proved_inertia_range(read_robot_file(TOML).robot())
    assert found.needed_range is not None
    (c1, c2), (low, high) = found.needed_range, found.sampled_range
    assert c1 < low < 1.0 < high < c2
    assert c1 > 0.98 * low
    assert c2 < 1.02 * high


@pytest.mark.parametrize(
    ("orientation", "down"),
    [
        ('"floor"', (0.0, 0.0, -9.81)),
        ('"ceiling"', (0.0, 0.0, 9.81)),
        ('"wall"', (9.81, 0.0, 0.0)),
        ("[0.0, 0.0, 1.0]", (0.0, 0.0, -9.81)),
        ("[1.5707963267948966, 0.0, 0.3]", (0.0, -9.81, 0.0)),
    ],
)
def test_the_base_may_stand_otherwise(edited: Edited, orientation: str, down: tuple[float, ...]) -> None:
    path = edited(TOML, ("[locked]", f"[base]\norientation = {orientation}\n\n[locked]"))
    assert_allclose(read_robot_file(path).robot().tree.gravity_m_s2, down, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (("rotor_inertia = 0.3\n", ""), "joints.shoulder.rotor_inertia: got nothing"),
        (
            ("rigid = true\n\n[joints.elbow]", "\n[joints.elbow]"),
            "joints.shoulder.stiffness: got nothing, expected .*torsional stiffness",
        ),
        (
            ("rotor_inertia = 0.3\nrigid = true", "rotor_inertia = 0.3\nrigid = false"),
            "joints.shoulder.stiffness: got nothing",
        ),
        (("torque = 30.0\n", ""), "joints.elbow.torque: got nothing"),
        (("speed = 4.0\n", ""), "joints.elbow.speed: got nothing"),
        (("rotor_inertia = 0.3", "rotor_inertia = -0.3"), "joints.shoulder.rotor_inertia"),
        (("rotor_inertia = 0.3", "rotor_inertia = nan"), "not finite|finite"),
        (
            ("rotor_inertia = 0.3", "rotor_inertia = 0.3\nangle = [-2.5, 1.0]"),
            r"joints.shoulder.angle: got \[-2.5, 1.0\]",
        ),
        (("rotor_inertia = 0.3", "rotor_inertia = 0.3\nangle = [1.0, -1.0]"), "joints.shoulder.angle"),
        (("rotor_inertia = 0.3", "rotor_inertia = 0.3\ncolour = 1"), "joints.shoulder.colour"),
        (("[joints.shoulder]", "[joints.sholder]"), "joints.sholder: got sholder, expected one of shoulder, elbow"),
        (('tip_link = "flange"', 'tip_link = "flang"'), "tip_link: got flang.*did you mean flange"),
        (('tip_link = "flange"\n', ""), "tip_link: got nothing, expected the link to control"),
        (("slide = 0.02", "slid = 0.02"), "locked.slid: got slid"),
        (("slide = 0.02", "slide = inf"), "locked.slide|finite"),
        (("copy = 0.02\n", ""), "joint copy: got a joint that moves aside"),
        (("inertia = 0.01", ""), "payload.inertia: got nothing"),
        (("mass = 1.0", "mass = 0.0"), "payload.mass"),
        (("[-0.02, 0.02], [0.0", "[0.02, -0.02], [0.0"), "payload.com_box"),
        (("links = 0.05", "links = 1.0"), "uncertainty.links"),
        (('tip_link = "flange"', 'tip_link = "flange"\nlag = [2e-3, 1e-3]'), r"lag: got \[0.002, 0.001\]"),
        (("two_links.urdf", "missing.urdf"), "missing.urdf: file: got No such file"),
        (("[payload]", "[payload"), "file: got .*, expected TOML"),
    ],
)
def test_what_is_missing_or_wrong_in_a_robot_file_is_one_line(
    edited: Edited, change: tuple[str, str], expected: str
) -> None:
    path = edited(TOML, change)
    with pytest.raises(InputError, match=expected) as caught:
        read_robot_file(path).robot()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("file", "change", "expected"),
    [
        (
            URDF,
            ('<robot name="two_links">', '<!DOCTYPE r [<!ENTITY e SYSTEM "/etc/passwd">]><robot name="&e;">'),
            "DOCTYPE",
        ),
        (URDF, ("<robot", "<robt"), "line 61: got mismatched tag"),
        (URDF, ('name="two_links"', ""), "No name given"),
        (URDF, ('value="1"', 'value="${mass}"'), "file: got xacro macros"),
        (URDF, ('value="1"', 'value="one"'), "file: got"),
        (URDF, ('ixx="0.001"', 'ixx="0,001"'), "file: got"),
        (URDF, ('xyz="0.25 0 0"', 'xyz="0.25 0"'), "file: got"),
        (URDF, ('xyz="0 1 0"', 'xyz="0 ${y} 0"'), "file: got xacro macros"),
        (URDF, ('<link name="base"/>', '<xacro:macro xmlns:xacro="http://x" name="m"/>'), "file: got xacro macros"),
        (MJCF, ("<worldbody>", '<include file="../../etc/passwd"/><worldbody>'), "include: got"),
        (
            MJCF,
            ('<compiler angle="radian"', '<include file="two_links.xml"/><compiler angle="radian"'),
            "each file once",
        ),
        (MJCF, ('<inertial pos="0.25 0 0" mass="1" diaginertia="0.001 0.0213 0.0213"/>', ""), "need no mesh"),
        (MJCF, ("<mujoco", "<mojoco"), "mismatched tag|line"),
    ],
)
def test_descriptions_that_cannot_be_trusted_or_read_are_one_line(
    edited: Edited, capfd: pytest.CaptureFixture[str], file: Path, change: tuple[str, str], expected: str
) -> None:
    path = edited(file, change)
    with pytest.raises(InputError, match=expected) as caught:
        read_description(path)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")  # what a library prints on its own is in the line


def test_a_file_of_another_kind_is_refused(tmp_path: Path) -> None:
    other = tmp_path / "page.xml"
    other.write_text("<html/>")
    with pytest.raises(InputError, match="root element: got html"):
        read_description(other)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (('<mass value="1"/>', '<mass value="0"/>'), "body of positive kinetic energy|without mass"),
        (('ixx="0.001" iyy="0.0213"', 'ixx="-0.001" iyy="0.0213"'), "smallest principal moment"),
        (('ixx="0.001" iyy="0.0213" izz="0.0213"', 'ixx="0.001" iyy="0.01" izz="0.0213"'), "principal moments"),
    ],
)
def test_inertias_that_no_body_has_are_refused_by_joint(edited: Edited, change: tuple[str, str], expected: str) -> None:
    tree = read_description(edited(URDF, change)).chain("flange", {"slide": 0.0, "copy": 0.0})
    with pytest.raises(InputError, match=expected):
        require_bodies(tree, "two_links")


def test_a_triangle_that_is_broken_can_be_accepted_and_a_negative_energy_cannot(edited: Edited) -> None:
    broken = ('ixx="0.001" iyy="0.0213" izz="0.0213"', 'ixx="0.001" iyy="0.01" izz="0.0213"')
    tree = read_description(edited(URDF, broken)).chain("flange", {"slide": 0.0, "copy": 0.0})
    require_bodies(tree, "two_links", accept_triangle=True)


def test_an_inertia_in_other_units_raises_a_doubt_with_numbers(edited: Edited) -> None:
    sound = read_robot_file(TOML).robot().tree
    assert not concerns(sound)
    path = edited(URDF, ('iyy="0.0213" izz="0.0213"', 'iyy="21.3" izz="21.3"'))
    doubted = concerns(read_description(path).chain("flange", {"slide": 0.0, "copy": 0.0}))
    assert any("radius of gyration 4.62 m" in doubt.text for doubt in doubted)
    assert any("rotor inertia 0" in doubt.text for doubt in doubted)


def test_the_file_to_start_from_asks_for_what_is_missing_and_is_complete_once_filled_in(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    start = tmp_path / "robot.toml"
    assert run(["robot", "show", str(MJCF), "-o", str(start)]) == 0
    assert run(["robot", "show", str(start)]) == 2
    assert "payload.mass: got nothing" in capsys.readouterr().err
    text = start.read_text()
    start.write_text("\n".join(line.removeprefix("# ? ") for line in text.splitlines()))
    assert run(["robot", "show", str(start), "--prove", "--json"]) == 0
    out = capsys.readouterr().out
    assert '"needed_range"' in out
    assert '"rotor_inertia": 0.3' in out


@pytest.mark.parametrize(
    "arguments",
    [
        ["robot", "show", str(URDF)],
        ["robot", "show", str(URDF), "--tip", "nothing"],
        ["robot", "show", str(MJCF), "--prove"],
        ["robot", "show", str(TOML), "--tip", "flange"],
        ["robot", "show", str(DATA)],
        ["robot", "look", str(TOML)],
    ],
)
def test_a_wrong_use_of_the_verb_is_one_line_and_exit_code_2(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(arguments) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert error.count("\n") == 1
