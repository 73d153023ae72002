"""What a ``robot.toml`` says of the drives of its joints: what is understood, and what is refused with which advice."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from quasilpv.descriptions.robot_file import read_robot_file
from quasilpv.errors import InputError
from quasilpv.systems.robots.joint_drive import ArmClass, ElasticDrive, arm_class
from quasilpv.systems.robots.spatial_robot import SpatialRobot

DATA = Path(__file__).parents[1] / "data" / "robots"
GEAR = 'stiffness = [5e3, 2e4]\ndamping_least = 1e-4\nencoder_side = "motor"'


def robot_with(tmp_path: Path, *drives: str) -> SpatialRobot:
    """The arm with two joints, its drives stated like this instead of as rigid."""
    text = (DATA / "two_links.toml").read_text(encoding="utf-8")
    before, middle, after = text.split("rigid = true")
    shoulder, elbow = (*drives, "rigid = true")[:2]
    text = before + shoulder + middle + elbow + after
    text = text.replace('"two_links.urdf"', f'"{DATA / "two_links.urdf"}"')
    path = tmp_path / "robot.toml"
    path.write_text(text, encoding="utf-8")
    return read_robot_file(path).robot()


def test_when_a_gear_gives_expect_its_drive_and_the_class_of_the_arm(tmp_path: Path) -> None:
    robot = robot_with(tmp_path, GEAR, GEAR)
    assert robot.joints[0].drive == ElasticDrive((5e3, 2e4), 1e-4, "motor", torque_sensor=False, torque_loop=False)
    assert robot.arm_class is ArmClass.MOTOR_ENCODERS
    document = robot.with_payload_fraction(1.0).plant_document("perturbed")
    assert (document["kind"], document["encoder_side"]) == ("elastic-tree", "motor")
    assert document["joints"][0]["stiffness_nm_rad"] == pytest.approx(1e4)
    assert document["joints"][0]["damping_nm_s"] == pytest.approx(1.0)


@pytest.mark.parametrize("drive", ["rigid = true", 'stiffness = "rigid"', 'rigid = true\nstiffness = "rigid"'])
def test_when_a_joint_is_called_rigid_expect_no_drive(tmp_path: Path, drive: str) -> None:
    robot = robot_with(tmp_path, drive, drive)
    assert robot.joints[0].drive is None
    assert robot.arm_class is ArmClass.RIGID


@pytest.mark.parametrize(
    ("side", "sensor", "loop", "expected"),
    [
        ("motor", "false", "false", ArmClass.MOTOR_ENCODERS),
        ("both", "true", "false", ArmClass.DUAL_ENCODERS),
        ("link", "false", "false", ArmClass.LINK_ENCODERS),
        ("both", "true", "true", ArmClass.TORQUE_CONTROLLED),
    ],
)
def test_when_encoders_and_torque_sensors_are_stated_expect_the_class(
    tmp_path: Path, side: str, sensor: str, loop: str, expected: ArmClass
) -> None:
    drive = GEAR.replace('"motor"', f'"{side}"') + f"\ntorque_sensor = {sensor}\ntorque_loop = {loop}"
    robot = robot_with(tmp_path, drive, drive)
    assert robot.arm_class is expected
    document = robot.with_payload_fraction(1.0).plant_document("perturbed")
    assert document["encoder_side"] == side
    assert document.get("torque_sensor", False) == (sensor == "true")
    assert document.get("torque_loop") == ({"gain": 4.0, "lag_s": 0.0} if loop == "true" else None)
    lagging = replace(robot, lag_s=(1e-3, 2e-3)).with_payload_fraction(0.5).plant_document("perturbed")
    assert lagging["torque_loop"] == {"gain": 4.0 if loop == "true" else 1.0, "lag_s": pytest.approx(1.5e-3)}
    assert "lag_s" not in lagging


def test_when_noise_and_resolution_of_torque_sensors_are_stated_expect_them_in_the_plant(tmp_path: Path) -> None:
    noisy = GEAR + "\ntorque_sensor = true\ntorque_noise = 0.2\ntorque_resolution = 0.05"
    exact = GEAR + "\ntorque_sensor = true"
    robot = robot_with(tmp_path, noisy, exact)
    shoulder, elbow = robot.with_payload_fraction(1.0).plant_document("perturbed")["joints"]
    assert (shoulder["torque_noise_nm"], shoulder["torque_quantum_nm"]) == (0.2, 0.05)
    assert not {"torque_noise_nm", "torque_quantum_nm"} & set(elbow)


def test_when_a_break_away_torque_is_stated_expect_plants_that_stick_and_nonsense_refused(tmp_path: Path) -> None:
    friction = "\nfriction_coulomb = 0.5\nfriction_breakaway = "
    for drive in (GEAR, "rigid = true"):
        robot = robot_with(tmp_path, drive + friction + "0.8", drive + friction + "0.0")
        first, second = robot.with_payload_fraction(0.0).plant_document("nominal")["joints"]
        assert first["stick_slip"]["breakaway_nm"] == 0.8
        assert "stick_slip" not in second
    for stated in (friction + "0.4", "\nfriction_breakaway = 0.4"):
        with pytest.raises(InputError, match=r"joints\.shoulder\.friction_breakaway: got 0\.4, expected at least fri"):
            robot_with(tmp_path, GEAR + stated, GEAR)


def test_when_joints_are_of_several_classes_expect_the_one_that_measures_least() -> None:
    motor, both = (ElasticDrive((1.0, 2.0), 0.0, side, True, False) for side in ("motor", "both"))
    loop = ElasticDrive((1.0, 2.0), 0.0, "both", True, True)
    assert arm_class([None, loop]) is ArmClass.TORQUE_CONTROLLED
    assert arm_class([loop, both]) is ArmClass.DUAL_ENCODERS
    assert arm_class([both, motor, None]) is ArmClass.MOTOR_ENCODERS


@pytest.mark.parametrize(
    ("drive", "expected"),
    [
        ("", r"joints\.shoulder\.stiffness: got nothing, expected .*harmonic.*unsafe"),
        ("rigid = false", r"joints\.shoulder\.stiffness: got nothing"),
        ("rigid = true\n" + GEAR, r"joints\.shoulder\.rigid: got true"),
        ('rigid = false\nstiffness = "rigid"', r"joints\.shoulder\.rigid: got false"),
        ('stiffness = "stiff"', r"joints\.shoulder\.stiffness"),
        ("stiffness = [0.0, 1e4]", r"joints\.shoulder\.stiffness"),
        (GEAR.replace("[5e3, 2e4]", "[2e4, 5e3]"), r"joints\.shoulder\.stiffness: got \[20000.0, 5000.0\]"),
        (GEAR.replace("damping_least = 1e-4\n", ""), r"joints\.shoulder\.damping_least: got nothing, .* 0 .*safe"),
        (GEAR.replace('encoder_side = "motor"', ""), r"joints\.shoulder\.encoder_side: got nothing, .*output encoder"),
        (GEAR.replace('"motor"', '"gear"'), r"joints\.shoulder\.encoder_side"),
        (GEAR + "\ntorque_loop = true", r"joints\.shoulder\.torque_sensor: got false"),
        (GEAR + "\ntorque_loop = true\ntorque_sensor = true", r"joints\.shoulder\.encoder_side: got motor"),
        ('rigid = true\nencoder_side = "motor"', r"joints\.shoulder\.encoder_side: got motor, expected nothing"),
        ("rigid = true\ntorque_loop = true", r"joints\.shoulder\.torque_loop: got true"),
        (
            GEAR + "\ntorque_noise = 0.1",
            r"joints\.shoulder\.torque_noise: got 0\.1, expected nothing without torque_sensor",
        ),
        ("rigid = true\ntorque_resolution = 0.1", r"joints\.shoulder\.torque_resolution: got 0\.1"),
        (GEAR, r"joints\.elbow\.stiffness: got joints of several kinds"),
    ],
)
def test_when_a_drive_is_not_stated_or_contradicts_itself_expect_one_line_that_says_what_to_look_for(
    tmp_path: Path, drive: str, expected: str
) -> None:
    with pytest.raises(InputError, match=expected) as caught:
        robot_with(tmp_path, drive)
    assert "\n" not in str(caught.value)


def test_when_a_gear_gives_and_its_rotor_has_no_inertia_expect_it_refused(tmp_path: Path) -> None:
    text = (DATA / "two_links.toml").read_text(encoding="utf-8").replace("rotor_inertia = 0.3", "rotor_inertia = 0.0")
    path = tmp_path / "robot.toml"
    path.write_text(text.replace('"two_links.urdf"', f'"{DATA / "two_links.urdf"}"').replace("rigid = true", GEAR))
    with pytest.raises(InputError, match=r"joints\.shoulder\.rotor_inertia: got 0.0, expected more than 0"):
        read_robot_file(path).robot()
