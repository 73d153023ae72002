"""The front door for robots: the chain from a robot to a run, artifacts also as files, results that show themselves."""

from __future__ import annotations

import doctest
import io
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

import quasilpv as ql
from quasilpv import chain
from quasilpv.artifact import write_artifact
from quasilpv.chain import ArtifactLike, Design, Simulation
from quasilpv.scenarios import TrackingExperiment, read_scenario, sine_torques, tracking_experiment
from quasilpv.synthesis import CONTROLLERS
from quasilpv.systems.robots.arms import PlanarSerialArm
from quasilpv.systems.robots.registry import robots
from quasilpv.trajectories import TaskPath, plan, rest, write_trajectory
from quasilpv.trajectories.paths import LineSegment, Segment

MOST_LINES, MOST_CHARACTERS = 10, 1000
RAY = TaskPath(name="ray", start=(0.0, -0.22), segments=(Segment(line=LineSegment(to=(0.02, -0.22), duration_s=0.3)),))


@pytest.fixture(scope="module")
def made() -> Design:
    """Of the default law, which claims something and has a gate."""
    return ql.design("arm2")


@pytest.fixture(scope="module")
def proved(made: Design) -> ql.Artifact:
    return made.release()


@pytest.fixture(scope="module")
def simple() -> ql.Artifact:
    return ql.design("fivebar", law="pid").release()


@pytest.fixture(scope="module")
def run(simple: ql.Artifact) -> Simulation:
    return ql.simulate(simple, RAY)


@pytest.fixture(params=["object", "json", "cbor", "text"])
def given(request: pytest.FixtureRequest, proved: ql.Artifact, tmp_path: Path) -> ArtifactLike:
    """The artifact in every form in which it may be given."""
    json, cbor = write_artifact(tmp_path, proved)
    forms: dict[str, ArtifactLike] = {"object": proved, "json": json, "cbor": cbor, "text": str(json)}
    return forms[request.param]


def test_the_examples_of_the_docstrings_run() -> None:
    found = doctest.testmod(chain)
    assert found.attempted > 8
    assert found.failed == 0


# ---- the chain -------------------------------------------------------------------------------------------------------


def test_a_design_is_for_its_robot_its_law_and_its_rate() -> None:
    artifact = ql.design(ql.robot("arm3"), law="ctc", rate_hz=2000).release()
    assert (artifact.robot.id, artifact.law.kind, artifact.sample_period_s) == ("arm3", "ctc", 1 / 2000)
    assert ql.design("arm3", law="pid").tracking.sample_period_s == 1.0 / CONTROLLERS["pid"].rate_hz


def test_what_is_released_is_checked(proved: ql.Artifact, given: ArtifactLike) -> None:
    stated = proved.verification
    assert stated is not None
    assert ql.verify(given).findings() == stated["certificate"]
    found = ql.gate(given)
    assert found.passed
    assert found.to_document() == stated["gate"]


def test_a_gate_asks_for_the_delay_it_is_given(proved: ql.Artifact) -> None:
    margin_s = ql.gate(proved).delay_margin_s
    assert margin_s is not None
    samples = margin_s / proved.sample_period_s
    assert ql.gate(proved, delay_samples=0.99 * samples).passed
    assert not ql.gate(proved, delay_samples=1.01 * samples).passed


@pytest.mark.parametrize(
    ("asked", "mention"),
    [
        (lambda: ql.robot("arm9"), "did you mean arm3?"),
        (lambda: ql.design("arm9"), "did you mean arm3?"),
        (lambda: ql.design("arm3", law="lqr"), "controller: got lqr"),
        (lambda: ql.design("arm3", rate_hz=-1.0), "rate_hz: got -1.0"),
        (lambda: ql.design("arm3", law="pid", disturbance_compensation=False), "disturbance_compensation"),
        (lambda: ql.verify("missing.json"), "missing.json: file"),
        (lambda: ql.gate("missing.json"), "missing.json: file"),
        (lambda: ql.simulate("missing.json", "serial-square"), "missing.json: file"),
    ],
)
def test_when_something_does_not_exist_expect_one_line(asked: Callable[[], object], mention: str) -> None:
    with pytest.raises(ql.InputError) as refused:
        asked()
    assert mention in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("asked", "mention"),
    [
        (lambda own: ql.simulate(own, "serial-squar"), "did you mean serial-square?"),
        (lambda own: ql.simulate(own, "serial-square"), "robot.id: got fivebar, expected arm3"),
        (lambda own: ql.simulate(own, "missing.json"), "missing.json"),
        (lambda own: ql.simulate(own, rest("rest", 3, 1.0)), "joints: got 3, expected 2"),
        (lambda own: ql.simulate(own, RAY, plant="broken"), "plant: got broken"),
        (lambda own: ql.simulate(own, rest("rest", 3, 1.0), robot=ql.robot("arm3")), "got fivebar, expected arm3"),
    ],
)
def test_when_controller_and_reference_do_not_fit_expect_one_line(
    simple: ql.Artifact, asked: Callable[[ql.Artifact], object], mention: str
) -> None:
    with pytest.raises(ql.InputError) as refused:
        asked(simple)
    assert mention in str(refused.value)


def test_a_gate_refuses_a_delay_that_is_none(proved: ql.Artifact) -> None:
    for delay in (-0.1, 4.1, float("nan"), float("inf")):
        with pytest.raises(ql.InputError, match="delay_samples"):
            ql.gate(proved, delay_samples=delay)


# ---- runs ------------------------------------------------------------------------------------------------------------


def test_one_reference_in_every_form_gives_one_run(simple: ql.Artifact, run: Simulation, tmp_path: Path) -> None:
    source = ql.robot("fivebar")
    planned = TrackingExperiment("ray", source, plan(source.model, RAY))
    (tmp_path / "ray.json").write_text(RAY.model_dump_json(exclude_none=True), encoding="utf-8")
    files = [write_trajectory(tmp_path / f"planned{suffix}", planned.trajectory) for suffix in (".json", ".cbor")]
    for reference in (tmp_path / "ray.json", str(tmp_path / "ray.json"), planned.trajectory, planned, *files):
        assert ql.simulate(simple, reference).run.first_difference(run.run) is None


def test_a_run_keeps_its_files_where_it_is_told_and_nowhere_else(
    simple: ql.Artifact, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    ql.simulate(simple, RAY)
    assert not list(tmp_path.iterdir())
    ql.simulate(simple, RAY, folder="kept", external_torque=sine_torques((5.0, 15.0)), plant="nominal")
    assert {path.name for path in (tmp_path / "kept").iterdir()} >= {"artifact.json", "scenario.json", "run.lcmlog"}
    scenario = read_scenario(tmp_path / "kept" / "scenario.json")
    assert (scenario.plant.kind, scenario.plant.label) == ("five-bar", "nominal")
    assert scenario.external_torque == sine_torques((5.0, 15.0))


def test_the_disturbance_of_a_scenario_is_its_own_unless_another_is_stated(tmp_path: Path) -> None:
    artifact = ql.design("arm3", law="ctc").release()
    registered = tracking_experiment("serial-circle")
    for torque, expected in ((None, registered.external_torque), ((), ())):
        ql.simulate(artifact, "serial-circle", external_torque=torque, folder=tmp_path)
        assert read_scenario(tmp_path / "scenario.json").external_torque == expected


def test_a_robot_the_registry_does_not_know_is_never_taken_for_one_it_knows() -> None:
    known = ql.robot("arm2")
    assert isinstance(known.model, PlanarSerialArm)
    links = tuple(replace(link, mass_kg=1.01 * link.mass_kg) for link in known.model.links)
    heavier = replace(known, model=replace(known.model, links=links))
    for own, field in ((heavier, "robot.parameters"), (replace(known, id="mine"), "robot.id")):
        artifact = ql.design(own, law="pid").release()
        with pytest.raises(ql.InputError, match=field):
            ql.simulate(artifact, rest("rest", 2, 0.1))
        assert ql.simulate(artifact, rest("rest", 2, 0.1), robot=own).run.joints == 2


# ---- what people see -------------------------------------------------------------------------------------------------


def test_descriptions_have_a_few_lines_and_say_what_they_describe(
    made: Design, proved: ql.Artifact, simple: ql.Artifact, run: Simulation
) -> None:
    shown = {
        "arm2-dob-acceleration": [proved, str(proved), ql.gate(proved)],
        "dob-acceleration": [made],
        "fivebar-pid": [simple],
        "verified": [ql.verify(proved)],
        "ray": [run, run.result, plan(ql.robot("fivebar").model, RAY)],
        "samples": [run.run],
        "passed=True": [ql.gate(proved).found],
        "Robot(": [*robots()],
    }
    for word, objects in shown.items():
        for one in objects:
            text = one if isinstance(one, str) else repr(one)
            assert word in text
            assert text.count("\n") < MOST_LINES
            assert len(text) < MOST_CHARACTERS


@pytest.mark.parametrize("name", ["path", "errors", "torques", "velocity"])
def test_every_figure_of_a_run_is_drawn_when_it_is_asked_for_and_a_notebook_shows_it(
    run: Simulation, name: str
) -> None:
    assert name in run.figures
    figure = run.plot(name)
    with Image.open(io.BytesIO(figure._repr_png_())) as image:  # type: ignore[attr-defined]
        assert len(image.convert("L").getcolors(1 << 16) or []) > 2  # not blank


@pytest.mark.parametrize("name", ["path", "errors", "torques"])
def test_a_figure_of_one_plot_is_drawn_where_the_reader_says(run: Simulation, name: str) -> None:
    figure, axes = plt.subplots(1, 2)
    before = dict(plt.rcParams)
    assert run.plot(name, ax=axes[1]) is figure
    assert not axes[0].lines
    drawn = np.asarray(axes[1].lines[-1].get_xdata())
    np.testing.assert_array_equal(drawn, run.result.tool_position_m[:, 0] if name == "path" else run.run.time_s)
    assert dict(plt.rcParams) == before
    plt.close(figure)


def test_when_a_figure_does_not_exist_or_does_not_fit_expect_one_line(run: Simulation) -> None:
    figure, ax = plt.subplots()
    with pytest.raises(ql.InputError, match="figure: got disturbance, expected one of path"):
        run.plot("disturbance")  # of a law that observes none
    with pytest.raises(ql.InputError, match="ax: got one plot for velocity"):
        run.plot("velocity", ax=ax)
    assert not ax.lines
    plt.close(figure)


def test_a_notebook_is_shown_numbers_and_nothing_is_drawn_for_it(
    run: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("matplotlib.figure.Figure.__init__", lambda *_, **__: pytest.fail("a figure is made"))
    shown = run._repr_html_()
    assert f"{1e3 * run.metrics.rms_tool_m:.3g} mm" in shown
    assert "<table>" in shown
    assert not hasattr(run, "_repr_png_")


def test_the_figure_of_a_gate_is_drawn_over_its_delays(proved: ql.Artifact) -> None:
    found = ql.gate(proved)
    figure = found.plot()
    assert any("delay" in axes.get_xlabel() for axes in figure.axes)
    own = Figure()
    assert found.plot(ax=own.add_subplot()) is own
    assert "delay" in own.axes[0].get_xlabel()
    assert "enclosed" in found._repr_html_()
