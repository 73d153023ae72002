"""Scenarios: what the registry builds, and the rules of the format."""

import copy
import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quasilpv import _runtime
from quasilpv.artifact import write_artifact
from quasilpv.documents.canonical import canonical_json, parse_strict_json
from quasilpv.documents.mechanism import LinkParameters
from quasilpv.documents.plants import FiveBarPlant, SerialArmPlant, SpringDiscPlant
from quasilpv.errors import InputError
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import track
from quasilpv.release import release
from quasilpv.scenarios import (
    OPTIONAL,
    IdaIntegrator,
    Rk4Integrator,
    Scenario,
    Sensors,
    TrackingExperiment,
    build_scenario,
    read_scenario,
    tracking_experiment,
    tracking_experiments,
    write_scenario,
)
from quasilpv.synthesis import DesignRequest, Specification
from quasilpv.systems.robots.registry import robot
from quasilpv.trajectories import Trajectory, rest
from quasilpv.trajectories.document import write_trajectory

ARM3 = robot("arm3")
TRAJECTORIES = {one.name: one.trajectory for one in tracking_experiments() if one.robot.id == "arm3"}
SQUARE = TRAJECTORIES["serial-square"]
DISTURBED = build_scenario(ARM3, SQUARE, external_torque=tracking_experiment("serial-square").external_torque)
FORMATS = Path(__file__).parents[2] / "docs" / "reference" / "formats.md"


def arm_of(scenario: Scenario) -> SerialArmPlant:
    assert isinstance(scenario.plant, SerialArmPlant)
    return scenario.plant


def test_when_the_registry_is_listed_expect_two_paths_of_the_serial_arm_and_one_of_the_five_bar_robot() -> None:
    assert list(TRAJECTORIES) == ["serial-square", "serial-circle"]
    spirals = {one.name: one for one in tracking_experiments() if one.robot.id == "fivebar"}
    assert list(spirals) == ["fivebar-spiral", "fivebar-spiral-fast", "fivebar-spiral-strong"]
    for name, frequency, amplitude in (("fivebar-spiral", 5.0, 15.0), ("fivebar-spiral-strong", 50.0, 100.0)):
        first, second = spirals[name].external_torque
        assert (first.joint, second.joint) == (0, 1)
        assert (first.frequency_rad_s, second.frequency_rad_s) == (50.0, frequency)
        assert first.amplitude_nm == second.amplitude_nm == amplitude
    assert all(trajectory.name == name for name, trajectory in TRAJECTORIES.items())


def test_when_a_scenario_is_unknown_expect_the_known_ones_in_the_error() -> None:
    assert tracking_experiment("serial-circle").name == "serial-circle"
    with pytest.raises(InputError, match="got spiral, expected one of serial-square, serial-circle, fivebar-spiral"):
        tracking_experiment("spiral")


@pytest.mark.parametrize("name", TRAJECTORIES)
def test_when_a_scenario_is_built_expect_the_plant_to_start_at_rest_on_the_reference(name: str) -> None:
    scenario = build_scenario(ARM3, TRAJECTORIES[name])
    assert scenario.name == name
    assert scenario.duration_s == 3.0
    x, y, phi = ARM3.model.forward_kinematics(scenario.initial.angle_rad)
    start = {"serial-square": (1.3, -1.75), "serial-circle": (1.7, -1.55)}[name]
    np.testing.assert_allclose((x, y, phi), (*start, np.pi / 4), atol=1e-12)
    assert scenario.initial.speed_rad_s == (0.0, 0.0, 0.0)


def test_when_the_plant_is_nominal_expect_table_i_4_and_hanging_equilibrium() -> None:
    plant = arm_of(build_scenario(ARM3, SQUARE, plant="nominal"))
    assert (plant.kind, plant.label, plant.gravity_m_s2) == ("serial-arm", "nominal", 9.81)
    assert [link.length_m for link in plant.links] == [1.0, 0.9, 0.8]
    assert [link.mass_kg for link in plant.links] == [5.0, 4.9, 4.2]
    assert [link.inertia_kg_m2 for link in plant.links] == pytest.approx([2.0, 1.9, 1.3], rel=1e-15)
    assert [link.friction_nm_s for link in plant.links] == [0.0, 0.0, 0.0]


def test_when_the_plant_is_perturbed_expect_chapter_iv_with_inertias_about_the_centres_of_mass_unchanged() -> None:
    nominal = arm_of(build_scenario(ARM3, SQUARE, plant="nominal")).links
    perturbed = arm_of(build_scenario(ARM3, SQUARE)).links
    for before, after, factor in zip(nominal, perturbed, (1.4, 1.4, 2.2), strict=True):
        assert after.mass_kg == pytest.approx(factor * before.mass_kg)
        assert after.com_m == pytest.approx(factor * before.com_m)
        about_com = before.inertia_kg_m2 - before.mass_kg * before.com_m**2
        assert after.inertia_kg_m2 - after.mass_kg * after.com_m**2 == pytest.approx(about_com)
    # 2 - 5 (.5)^2 + 7 (.7)^2 = 4.18 and 1.3 - 4.2 (.4)^2 + 9.24 (.88)^2 = 7.783456 by hand.
    assert perturbed[0].inertia_kg_m2 == pytest.approx(4.18)
    assert perturbed[2].inertia_kg_m2 == pytest.approx(7.783456)


def test_the_scenarios_of_the_arm_have_the_disturbance_of_the_thesis_and_the_default_sensors_are_its_too() -> None:
    scenario = build_scenario(ARM3, SQUARE, external_torque=tracking_experiment("serial-square").external_torque)
    terms = [(t.joint, t.amplitude_nm, t.frequency_rad_s, t.phase_rad) for t in scenario.external_torque]
    assert terms == [(0, 450.0, 15.0, 0.0), (1, 375.0, 15.0, 0.0), (2, 300.0, 15.0, 0.0)]
    assert (scenario.sensors.encoder_bits, scenario.sensors.velocity_noise_rad_s) == (20, 0.05)
    assert scenario.transport_delay_s == 0.0
    assert isinstance(scenario.integrator, IdaIntegrator)


def test_when_a_scenario_is_built_twice_expect_the_same_noise_seed() -> None:
    seeds = {build_scenario(ARM3, trajectory).sensors.seed for trajectory in TRAJECTORIES.values()}
    assert len(seeds) == 1


def test_when_robot_and_trajectory_have_different_joints_expect_input_error() -> None:
    one_joint = Trajectory("still", np.array([0.0, 1.0]), np.zeros((1, 1, 6)))
    with pytest.raises(InputError, match="still: joints: got 1, expected 3, as arm3 has"):
        build_scenario(ARM3, one_joint)


@pytest.mark.parametrize("integrator", [IdaIntegrator(), IdaIntegrator(relative_tolerance=1e-10), Rk4Integrator()])
def test_when_a_scenario_is_written_expect_the_same_one_back(
    integrator: IdaIntegrator | Rk4Integrator, tmp_path: Path
) -> None:
    scenario = build_scenario(
        ARM3, SQUARE, sensors=Sensors(encoder_bits=17, seed=1), integrator=integrator, transport_delay_s=5e-4
    )
    assert read_scenario(write_scenario(tmp_path / "scenario.json", scenario)) == scenario


def five_bar_document() -> dict[str, Any]:
    active = LinkParameters(length_m=0.165, mass_kg=0.0825, com_m=0.0825, inertia_kg_m2=0.0011, friction_nm_s=0.0)
    passive = active.model_copy(update={"inertia_kg_m2": 0.0007})
    plant = FiveBarPlant(label="legs", gravity_m_s2=9.81, active=active, passive=passive)
    return {
        **DISTURBED.to_document(),
        "plant": plant.model_dump(mode="json"),
        "external_torque": [],
        "initial": {"angle_rad": [-0.8, 0.8], "speed_rad_s": [0.0, 0.0]},
    }


def spring_disc_document() -> dict[str, Any]:
    plant = SpringDiscPlant(
        label="disc",
        mass_kg=0.1,
        radius_m=2.0,
        inertia_kg_m2=4.0,
        inertia_uncertainty_per_kg=3.0,
        stiffness_n_m=1.0,
        cubic_stiffness_n_m3=1.0,
        damping_n_s_m=2.0,
    )
    return {
        **DISTURBED.to_document(),
        "plant": plant.model_dump(mode="json"),
        "external_torque": [],
        "initial": {"angle_rad": [-2.5], "speed_rad_s": [5.0]},
    }


@pytest.mark.parametrize(("make", "joints"), [(five_bar_document, 2), (spring_disc_document, 1)])
def test_when_another_plant_is_written_expect_the_same_scenario_back_and_its_plant_in_the_runtime(
    make: Callable[[], dict[str, Any]], joints: int, tmp_path: Path
) -> None:
    scenario = Scenario.from_document(make())
    path = write_scenario(tmp_path / "scenario.json", scenario)
    assert read_scenario(path) == scenario
    assert scenario.plant.joints == joints
    assert _runtime.Plant(_runtime.Scenario.load(str(path))).joints == joints


@pytest.mark.parametrize(
    ("make", "change", "field"),
    [
        (five_bar_document, lambda d: d["plant"].update(links=[]), "plant.links"),
        (five_bar_document, lambda d: d["plant"].update(formulation="index3"), "plant.formulation"),
        (five_bar_document, lambda d: d["plant"].update(baumgarte_per_s=-1), "plant.baumgarte_per_s"),
        (five_bar_document, lambda d: d["plant"].update(spring_rest_rad=[0.1]), "plant.spring_rest_rad[1]"),
        (five_bar_document, lambda d: d["plant"].pop("spring_nm_rad"), "plant.spring_nm_rad"),
        (five_bar_document, lambda d: d["plant"]["passive"].update(inertia_kg_m2=1e-4), "plant.passive.inertia_kg_m2"),
        (five_bar_document, lambda d: d["initial"].update(angle_rad=[0, 0, 0]), "initial.angle_rad"),
        (spring_disc_document, lambda d: d["plant"].update(mass_kg=0), "plant.mass_kg"),
        (spring_disc_document, lambda d: d["plant"].update(damping_n_s_m=-1), "plant.damping_n_s_m"),
        (spring_disc_document, lambda d: d["initial"].update(angle_rad=[0, 0]), "initial.angle_rad"),
    ],
)
def test_when_another_plant_breaks_a_rule_expect_its_field_in_both_languages(
    make: Callable[[], dict[str, Any]], change: Callable[[dict[str, Any]], None], field: str
) -> None:
    document = make()
    change(document)
    with pytest.raises(InputError) as error:
        Scenario.from_document(document, "scenario.json")
    assert error.value.field == field
    with pytest.raises(InputError) as error:
        _runtime.Scenario.parse(json.dumps(document).encode(), "scenario.json")
    assert error.value.field.startswith(field.removesuffix("[1]").removesuffix(".links"))


def test_when_a_scenario_is_written_expect_exactly_the_members_the_format_documents() -> None:
    table = FORMATS.read_text().split("## Scenario")[1].split("### ")[0]
    documented = set(re.findall(r"^\| `(\w+)` \|", table, flags=re.MULTILINE))
    everything = build_scenario(ARM3, SQUARE, torque_limit_nm=(10.0, 10.0, 10.0)).to_document()
    assert set(everything) == documented | {"schema", "schema_version"}
    assert (
        set(everything) - set(build_scenario(ARM3, SQUARE).to_document())
        == {"torque_limit_nm"}
        == {member for member in OPTIONAL if "." not in member}
    )


def run_with(scenario: Scenario) -> dict[str, np.ndarray]:
    """The first 0.1 s in closed loop with the printed PID gains."""
    artifact, short = release(DesignRequest.of("arm3", "pid")).artifact, {**scenario.to_document(), "duration_s": 0.1}
    return _runtime.run_closed_loop(
        _runtime.Artifact.parse(canonical_json(artifact.to_document())),
        _runtime.Trajectory.parse(canonical_json(SQUARE.to_document())),
        _runtime.Scenario.parse(json.dumps(short).encode()),
    )


def test_when_the_actuators_are_weaker_than_the_controller_believes_expect_the_plant_to_feel_their_limits() -> None:
    """Acceleration times true inertia is the delivered torque less gravity and Coriolis torque."""
    limit, arm = np.array([60.0, 40.0, 5.0]), ARM3.model
    exact = Sensors(encoder_bits=0, velocity_noise_rad_s=0.0)
    scenario = build_scenario(
        ARM3, SQUARE, plant="nominal", sensors=exact, external_torque=(), torque_limit_nm=tuple(limit.tolist())
    )
    columns = run_with(scenario)
    commanded = columns["torque_applied_nm"]
    assert np.any(np.abs(commanded) > limit)
    for k in range(1, len(commanded)):
        angle, speed, acceleration = (
            columns[f"{name}"][k] for name in ("angle_rad", "speed_rad_s", "acceleration_rad_s2")
        )
        delivered = arm.inverse_dynamics(angle, speed, acceleration)
        np.testing.assert_allclose(delivered, np.clip(commanded[k - 1], -limit, limit), atol=1e-6)


def test_when_the_sensor_filters_speeds_expect_the_recursion_of_the_format() -> None:
    noiseless = {"encoder_bits": 0, "velocity_noise_rad_s": 0.0}
    scenario = build_scenario(
        ARM3, SQUARE, sensors=Sensors(**noiseless, velocity_filter_time_constant_s=5e-3), external_torque=()
    )
    columns = run_with(scenario)
    true, measured, q = columns["speed_rad_s"], columns["measured_speed_rad_s"], np.exp(-1e-3 / 5e-3)
    expected = true[0]
    for k, speed in enumerate(true):
        expected = speed if k == 0 else q * expected + (1.0 - q) * speed
        np.testing.assert_allclose(measured[k], expected, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (lambda d: d.update(schema="quasilpv.artifact"), "schema"),
        (lambda d: d.update(schema_version=2), "schema_version"),
        (lambda d: d.update(comment="no"), "comment"),
        (lambda d: d.update(duration_s=0), "duration_s"),
        (lambda d: d["plant"].update(kind="five-link"), "plant"),
        (lambda d: d["plant"].update(links=[]), "plant.links"),
        (lambda d: d["plant"]["links"][1].update(mass_kg=-1), "plant.links[1].mass_kg"),
        (lambda d: d["plant"]["links"][2].update(inertia_kg_m2=1.3), "plant.links[2].inertia_kg_m2"),
        (lambda d: d["plant"]["links"][0].update(friction_nm_s=-0.1), "plant.links[0].friction_nm_s"),
        (lambda d: d["integrator"].update(kind="euler"), "integrator"),
        (lambda d: d["integrator"].update(relative_tolerance=0), "integrator.relative_tolerance"),
        (lambda d: d.update(integrator={"kind": "rk4", "steps_per_sample": 2.5}), "integrator.steps_per_sample"),
        (lambda d: d["external_torque"][2].update(joint=3), "external_torque[2].joint"),
        (lambda d: d["external_torque"][0].update(amplitude_nm="450"), "external_torque[0].amplitude_nm"),
        (lambda d: d["sensors"].update(encoder_bits=33), "sensors.encoder_bits"),
        (lambda d: d["sensors"].update(seed=-1), "sensors.seed"),
        (
            lambda d: d["sensors"].update(velocity_filter_time_constant_s=-1),
            "sensors.velocity_filter_time_constant_s",
        ),
        (lambda d: d.update(torque_limit_nm=[1, 1]), "torque_limit_nm"),
        (lambda d: d.update(torque_limit_nm=[1, 1, 0]), "torque_limit_nm[2]"),
        (lambda d: d.update(transport_delay_s=-1e-3), "transport_delay_s"),
        (lambda d: d["initial"].update(angle_rad=[0, 0]), "initial.angle_rad"),
        (lambda d: d["initial"].pop("speed_rad_s"), "initial.speed_rad_s"),
    ],
)
def test_when_a_scenario_breaks_a_rule_expect_one_line_with_its_field(change: Callable, field: str) -> None:
    document = json.loads(json.dumps(DISTURBED.to_document()))
    change(document)
    with pytest.raises(InputError) as error:
        Scenario.from_document(document, "scenario.json")
    assert (error.value.source, error.value.field) == ("scenario.json", field)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("text", ['{"name": "a", "name": "b"}', '{"duration_s": NaN}', "[]", "", '{"name": '])
def test_when_a_scenario_file_is_not_strict_json_expect_input_error_with_its_name(text: str, tmp_path: Path) -> None:
    path = tmp_path / "scenario.json"
    path.write_text(text)
    with pytest.raises(InputError) as error:
        read_scenario(path)
    assert error.value.source == str(path)


@pytest.mark.parametrize(
    ("path", "field"),
    [
        (("sensors", "seed"), "sensors.seed"),
        (("integrator", "absolute_tolerance"), "integrator.absolute_tolerance"),
        (("external_torque", 1, "phase_rad"), "external_torque[1].phase_rad"),
    ],
)
def test_when_a_member_with_a_default_is_missing_in_a_file_expect_it_refused(path: tuple, field: str) -> None:
    document = DISTURBED.to_document()
    parent = document
    for key in path[:-1]:
        parent = parent[key]
    del parent[path[-1]]
    with pytest.raises(InputError, match="got nothing, expected this member") as error:
        Scenario.from_document(document)
    assert error.value.field == field


# ---- both languages refuse the same documents ------------------------------------------------------------------------

ODD_NUMBERS = (1e308, -1e308, 1e18, -1e18, 2e16, 1e16, -1.0, 0.0, 0.5, 1e-300, 7.0)


def numbers_of(tree: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where the numbers of a document are."""
    if isinstance(tree, dict | list):
        for key, member in tree.items() if isinstance(tree, dict) else enumerate(tree):
            yield from numbers_of(member, (*path, key))
    elif isinstance(tree, int | float) and not isinstance(tree, bool):
        yield path


def with_number(tree: dict[str, Any], path: tuple[Any, ...], value: float) -> dict[str, Any]:
    changed = copy.deepcopy(tree)
    *parents, last = path
    place: Any = changed
    for key in parents:
        place = place[key]
    place[last] = value
    return changed


def refused_by_both(data: bytes) -> bool:
    """Whether a scenario is refused; by both languages, each with a line, or by none."""
    messages = []
    for parse in (
        lambda: Scenario.from_document(parse_strict_json(data, "scenario.json"), "scenario.json"),
        lambda: _runtime.Scenario.parse(data, "scenario.json"),
    ):
        try:
            parse()
        except InputError as error:
            messages.append(str(error))
    assert len(messages) in (0, 2), messages
    assert all(message.startswith("scenario.json: ") and "\n" not in message for message in messages)
    return bool(messages)


@pytest.mark.parametrize(
    "make", [lambda: build_scenario(ARM3, SQUARE).to_document(), five_bar_document, spring_disc_document]
)
def test_when_any_number_is_odd_expect_both_languages_to_agree_and_no_large_one_accepted(
    make: Callable[[], dict[str, Any]],
) -> None:
    document = make()
    places = list(numbers_of(document))
    assert len(places) > 15
    for place in places:
        for value in ODD_NUMBERS:
            refused = refused_by_both(json.dumps(with_number(document, place, value)).encode())
            assert refused or abs(value) <= 1e16, (place, value)
    for place, most in {"duration_s": 86400, "transport_delay_s": 10}.items():
        assert not refused_by_both(json.dumps({**document, place: most}).encode())
        assert refused_by_both(json.dumps({**document, place: most * 1.01}).encode())


@pytest.mark.parametrize(
    "spelling", ["NaN", "Infinity", "-Infinity", "1e999", "0x10", "01", "+1", ".5", "1.", "1_0", "", "'1'", "1,"]
)
def test_when_a_number_is_spelt_as_json_does_not_expect_both_languages_to_refuse_it(spelling: str) -> None:
    text = json.dumps({**build_scenario(ARM3, SQUARE).to_document(), "duration_s": 123456789})
    assert not refused_by_both(text.replace("123456789", "12345").encode())
    assert refused_by_both(text.replace("123456789", spelling).encode())


@pytest.mark.parametrize(
    ("before", "after"),
    [(b"\xef\xbb\xbf", b""), (b"\xff\xfe", b""), (b"", b"\0"), (b"", b"{}"), (b"//\n", b""), (b"[", b"]")],
)
def test_when_something_stands_around_the_document_expect_both_languages_to_refuse_it(
    before: bytes, after: bytes
) -> None:
    data = json.dumps(build_scenario(ARM3, SQUARE).to_document()).encode()
    assert not refused_by_both(b" \n" + data + b"\n")
    assert refused_by_both(before + data + after)


@pytest.mark.parametrize("share", [1e-3, 0.4, 0.6, 0.999])
def test_when_the_run_is_shorter_than_a_sample_expect_both_languages_to_refuse_it(share: float, tmp_path: Path) -> None:
    artifact = release(DesignRequest.of("arm3", "pid", Specification())).artifact
    reference = rest("short", 3, share * artifact.sample_period_s)
    experiment = TrackingExperiment("short", ARM3, reference)
    with pytest.raises(InputError, match=r"short: duration_s: got .*, expected at least one sample"):
        track(RunSetup(experiment, artifact, plant="nominal", sensors=Sensors()), tmp_path)
    path, _ = write_artifact(tmp_path, artifact)
    trajectory = write_trajectory(tmp_path / "trajectory.json", reference)
    scenario = write_scenario(tmp_path / "scenario.json", build_scenario(ARM3, reference))
    with pytest.raises(InputError, match=r"duration_s: got .*, expected at least one sample"):
        _runtime.run_closed_loop(
            _runtime.Artifact.load(str(path)),
            _runtime.Trajectory.load(str(trajectory)),
            _runtime.Scenario.load(str(scenario)),
        )
