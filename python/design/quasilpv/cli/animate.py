"""``design animate``: robots in motion, with and without compensation of the disturbance."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from quasilpv.cli.console import JsonOption, Steps, print_json, print_note, progress
from quasilpv.cli.options import EncoderOption, FormatOption, LogOption, RateOption, formats_of, plant_kind
from quasilpv.cli.system_options import (
    ARTIFACT_SUFFIXES,
    DelayOption,
    DisturbanceOption,
    DurationOption,
    NoiseOption,
    ParameterOption,
    QuantisationOption,
    Rk4Option,
    SeedOption,
    StartOption,
    SystemOptions,
    animate_system,
    refuse,
)
from quasilpv.defaults import ENCODER_BITS
from quasilpv.errors import InputError
from quasilpv.synthesis import DEFAULT_CONTROLLER

if TYPE_CHECKING:
    from quasilpv.cli.session import Session
    from quasilpv.experiments.result import TrackResult
    from quasilpv.scenarios import TrackingExperiment

DEFAULT_SCENARIOS = ("serial-square", "serial-circle", "fivebar-spiral")
FILE_NAME = "animation.gif"


def animate_command(
    scenarios: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="SCENARIO...",
            help=f"Scenario ids, see design list, or ARTIFACT of a system.  [default: {', '.join(DEFAULT_SCENARIOS)}]",
            show_default=False,
        ),
    ] = None,
    *,
    rate_hz: RateOption = None,
    encoder_bits: EncoderOption = None,
    plant: Annotated[
        str | None,
        typer.Option("--plant", metavar="PLANT", help="nominal, perturbed or mujoco.  [default: perturbed]"),
    ] = None,
    start: StartOption = None,
    parameter: ParameterOption = None,
    duration_s: DurationOption = None,
    delay_s: DelayOption = None,
    rk4_steps: Rk4Option = None,
    noise: NoiseOption = None,
    quantisation: QuantisationOption = None,
    seed: SeedOption = None,
    disturbance: DisturbanceOption = None,
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="DIR", help="Folder for animations, run files and figures.")
    ] = Path("out/animate"),
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw the figures of every run too.")] = True,
    figure_formats: FormatOption = None,
    log: LogOption = True,
    json: JsonOption = False,
) -> int:
    """Run scenarios with the default controller, with and without compensation of the disturbance it observes.

    Writes an animation (GIF, real time) per scenario that shows both runs side by side, and the figures of every run.
    Of a system, the phase portraits of one run, as design simulate makes it.

    \b
    Examples:
      design animate serial-square fivebar-spiral --rate-hz 2000
      design animate out/cart_pole/artifact.json --start th=0.2
    """
    from quasilpv.cli.gallery import Gallery
    from quasilpv.cli.results import print_results
    from quasilpv.cli.session import Session
    from quasilpv.experiments.result import Variant
    from quasilpv.scenarios import tracking_experiment

    formats = formats_of(figure_formats)
    own = SystemOptions(start, parameter, duration_s, delay_s, rk4_steps, noise, quantisation, seed, disturbance)
    artifacts = [name for name in scenarios or () if name.endswith(ARTIFACT_SUFFIXES)]
    if artifacts:
        robots = {"--rate-hz": rate_hz, "--encoder-bits": encoder_bits, "--plant": plant}
        given = [name for name, value in robots.items() if value is not None]
        refuse(given, "nothing beside the artifact of a system")
        if len(scenarios or ()) > 1:
            raise InputError("command line", "SCENARIO", ", ".join(scenarios or ()), "one artifact of a system alone")
        return animate_system(Path(artifacts[0]), own, out=out, formats=formats if figures else (), log=log, json=json)
    refuse(own.given(), "nothing beside scenarios of robots")
    plant = plant or "perturbed"
    experiments = [tracking_experiment(name) for name in dict.fromkeys(scenarios or DEFAULT_SCENARIOS)]
    bits = ENCODER_BITS if encoder_bits is None else encoder_bits
    variants = [Variant(DEFAULT_CONTROLLER, bits, compensated) for compensated in (False, True)]
    session = Session(None, rate_hz, plant_kind(plant, experiments), out, log)
    results: list[TrackResult] = []
    made: list[dict[str, Any]] = []
    with Gallery(out, formats if figures else (), len(experiments) * len(variants)) as gallery:
        with progress(len(experiments) * (len(variants) + 1)) as steps:
            for experiment in experiments:
                pair = []
                for variant in variants:
                    steps.begin(f"{experiment.name}: {variant.label}")
                    pair.append(session.run(experiment, variant, steps))
                    gallery.add(pair[-1])
                    steps.end()
                made.append(_animate(session, experiment, pair, steps))
                results += pair
        gallery.finish()
    if json:
        print_json(made)
        return 0
    print_results(results)
    for entry in made:
        print_note(f"wrote {entry['animation']}")
    return 0


def _animate(session: Session, experiment: TrackingExperiment, pair: list[TrackResult], steps: Steps) -> dict[str, Any]:
    """Write the animation of a scenario; its entry of ``--json``."""
    from quasilpv.figures.animation import write_animation

    steps.begin(f"{experiment.name}: animation")
    path = session.out / experiment.name / FILE_NAME
    frames = write_animation(pair, path, steps.parts)
    steps.end()
    return {"animation": str(path), "frames": frames, "runs": [result.row() for result in pair]}
