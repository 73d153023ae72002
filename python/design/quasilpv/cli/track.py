"""``design track``: scenarios in closed loop, in this process; a table and figures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from quasilpv.cli.console import JsonOption, print_json, progress
from quasilpv.cli.options import (
    ArtifactOption,
    EncoderOption,
    FormatOption,
    LogOption,
    PlantOption,
    RateOption,
    formats_of,
    plant_kind,
    require_controller,
    robot_named,
    sensors_of,
)
from quasilpv.defaults import ENCODER_BITS
from quasilpv.errors import InputError
from quasilpv.files import write_readable_json
from quasilpv.synthesis import DEFAULT_CONTROLLER

if TYPE_CHECKING:
    from quasilpv.artifact import Artifact
    from quasilpv.cli.gallery import Gallery
    from quasilpv.cli.session import Session
    from quasilpv.experiments.result import TrackResult, Variant
    from quasilpv.scenarios import TrackingExperiment
    from quasilpv.systems.robots.registry import AnyRobot

DEFAULT_CONTROLLERS = (
    "pid",
    "pid-tuned",
    "ctc",
    "ctc-tuned",
    "ctc-dob",
    "ctc-dob-tuned",
    "dob-torque",
    "dob-acceleration",
)
CONTROLLERS_IN_SPACE = ("pd-tuned", "pid-tuned", "ctc-tuned", "ctc-dob-tuned", "dob-acceleration")
COARSE_ENCODER_BITS = 17


def track_command(
    scenarios: Annotated[
        list[str] | None,
        typer.Argument(metavar="SCENARIO...", help="Scenario ids, see design list.", show_default=False),
    ] = None,
    *,
    controllers: Annotated[
        list[str] | None,
        typer.Option(
            "--controller",
            metavar="ID",
            help=f"May be repeated.  [default: {', '.join(DEFAULT_CONTROLLERS)};"
            f" in space {', '.join(CONTROLLERS_IN_SPACE)}]",
        ),
    ] = None,
    artifact: ArtifactOption = None,
    rate_hz: RateOption = None,
    trajectory: Annotated[
        Path | None,
        typer.Option("--trajectory", metavar="FILE", help="Follow the waypoints and arcs of this file as well."),
    ] = None,
    robot_id: Annotated[
        str | None,
        typer.Option(
            "--robot",
            metavar="ID",
            help="Which robot follows --trajectory: an id, or a robot.toml.  [default: that of --artifact]",
        ),
    ] = None,
    encoder_bits: EncoderOption = None,
    plant: PlantOption = "perturbed",
    no_compensation: Annotated[
        bool, typer.Option("--no-compensation", help="Observe the disturbance, do not compensate it.")
    ] = False,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="Folder for run files and figures.")] = Path(
        "out/track"
    ),
    figures: Annotated[
        bool | None, typer.Option("--figures/--no-figures", help="Draw figures.  [default: not with --json]")
    ] = None,
    figure_formats: FormatOption = None,
    log: LogOption = True,
    json: JsonOption = False,
) -> None:
    """Run scenarios in closed loop: every controller, one table, figures of every run.

    By default that of an arm in a plane also runs with 17-bit encoders, designed for them. Designs of the built-in
    ur5 are shipped and verified anew; all others are kept in out/cache and made again when anything they depend on
    changes.

    \b
    Examples:
      design track serial-square serial-circle --controller dob-acceleration
      design track --trajectory path.json --robot fivebar
    """
    from quasilpv.cli.gallery import Gallery
    from quasilpv.cli.results import print_results, print_warnings
    from quasilpv.cli.session import Session
    from quasilpv.scenarios import TrackingExperiment, tracking_experiment

    formats = formats_of(figure_formats)
    given = None if artifact is None else _given(artifact, controllers, rate_hz, no_compensation)
    experiments = [tracking_experiment(name) for name in dict.fromkeys(scenarios or [])]
    if trajectory is not None:
        experiments.append(TrackingExperiment.from_path_file(trajectory, _follower(given, robot_id)))
    elif robot_id is not None:
        raise InputError("command line", "--robot", robot_id, "nothing without --trajectory: a scenario has its robot")
    if not experiments:
        raise InputError("command line", "SCENARIO", "nothing", "at least one scenario id or --trajectory FILE")
    planned = [
        (
            experiment,
            _variants(given, controllers, encoder_bits, no_compensation, in_space=experiment.robot.in_space),
        )
        for experiment in experiments
    ]
    session = Session(given, rate_hz, plant_kind(plant, experiments), out, log)
    wanted = formats if figures or (figures is None and not json) else ()
    with Gallery(out, wanted, sum(len(variants) for _, variants in planned)) as gallery:
        results = run_all(session, planned, gallery)
        gallery.finish()
    if json:
        print_json([result.row() for result in results])
    else:
        print_results(results)
    for result in results:
        print_warnings(result)


def run_all(
    session: Session, planned: Sequence[tuple[TrackingExperiment, Sequence[Variant]]], gallery: Gallery
) -> list[TrackResult]:
    """Run experiments, each with its variants; their rows are kept in ``results.json`` of the session's folder."""
    results = []
    with progress(sum(len(variants) for _, variants in planned)) as steps:
        for experiment, variants in planned:
            for variant in variants:
                steps.begin(f"{experiment.name}: {variant.label}")
                results.append(session.run(experiment, variant, steps))
                gallery.add(results[-1])
                steps.end()
    write_readable_json(session.out / "results.json", [result.row() for result in results])
    return results


def default_variants(*, in_space: bool = False) -> list[Variant]:
    """The controllers that run if none is chosen."""
    from quasilpv.experiments.result import Variant

    if in_space:
        return [Variant(name, ENCODER_BITS) for name in CONTROLLERS_IN_SPACE]
    coarse = Variant(DEFAULT_CONTROLLER, COARSE_ENCODER_BITS)
    return [*(Variant(name, ENCODER_BITS) for name in DEFAULT_CONTROLLERS), coarse]


def _given(path: Path, controllers: Sequence[str] | None, rate_hz: float | None, no_compensation: bool) -> Artifact:
    """The controller of --artifact, which leaves nothing to choose."""
    from quasilpv.artifact import read_artifact

    chosen = {"--controller": controllers, "--rate-hz": rate_hz, "--no-compensation": no_compensation or None}
    for option, value in chosen.items():
        if value:
            raise InputError("command line", option, value, "nothing beside --artifact, which fixes the controller")
    return read_artifact(path)


def _follower(given: Artifact | None, robot_id: str | None) -> AnyRobot:
    """The robot that follows a path: that of the controller, or the one that is named. None is assumed.

    Raises:
        InputError: there is neither, they differ, or nobody knows the robot.
    """
    from quasilpv.experiments.track import require_robot_of, robot_of

    if given is None and robot_id is None:
        raise InputError("command line", "--robot", "nothing", "who follows --trajectory, or --artifact FILE")
    if given is None:
        return robot_named(str(robot_id))
    if robot_id is not None and robot_id.endswith(".toml"):
        return require_robot_of(given, robot_named(robot_id))
    if robot_id not in (None, given.robot.id):
        raise InputError("command line", "--robot", robot_id, f"{given.robot.id}, which --artifact is for")
    return robot_of(given)


def _variants(
    given: Artifact | None,
    controllers: Sequence[str] | None,
    encoder_bits: int | None,
    no_compensation: bool,
    *,
    in_space: bool,
) -> list[Variant]:
    from quasilpv.experiments.result import Variant
    from quasilpv.experiments.setup import variant_of

    bits = ENCODER_BITS if encoder_bits is None else encoder_bits
    sensors = sensors_of(bits)
    if given is not None:
        return [variant_of(given, sensors)]
    if no_compensation:
        return [Variant(require_controller(name), bits, False) for name in controllers or [DEFAULT_CONTROLLER]]
    if not controllers and encoder_bits is None:
        return default_variants(in_space=in_space)
    usual = CONTROLLERS_IN_SPACE if in_space else DEFAULT_CONTROLLERS
    return [Variant(require_controller(name), bits) for name in controllers or usual]
