"""``design simulate``: a general system in closed loop with its own equations."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from quasilpv.cli.console import JsonOption, print_json, print_note, print_table
from quasilpv.cli.options import FormatOption, formats_of
from quasilpv.cli.system_options import (
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
    artifact_of_system,
    code_of,
    notes_of,
    rows_of,
)
from quasilpv.files import claim_folder


def simulate_command(
    artifact: Annotated[Path, typer.Argument(metavar="ARTIFACT", help="Of a system: design synth SYSTEM.")],
    *,
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
        Path | None,
        typer.Option("-o", "--out", metavar="DIR", help="Write figures and the log of the run into this folder."),
    ] = None,
    figure_formats: FormatOption = None,
    json: JsonOption = False,
) -> int:
    """Run a controller of a system against its nonlinear equations, sampled and held as on a real plant.

    Exit code 1 if the run began inside the region and V rose above its start (with --noise, --quantisation or
    --disturbance: above 1), or a state left its domain.

    \b
    Example:
      design simulate out/cart_pole/artifact.json --start th=0.2 -o out/cart_pole
    """
    from quasilpv.experiments.system_run import simulate

    formats = formats_of(figure_formats)
    if out is not None:
        claim_folder(out)
    read = artifact_of_system(artifact, "design track")
    options = SystemOptions(start, parameter, duration_s, delay_s, rk4_steps, noise, quantisation, seed, disturbance)
    run = simulate(read, options.experiment(), str(artifact))
    if json:
        print_json(run.to_document())
    else:
        print_table(read.name, ("", ""), rows_of(run), left_columns=2)
        for note in notes_of(run):
            print_note(note)
    if out is not None:
        from quasilpv.experiments.system_logged import write_log
        from quasilpv.figures.systems import draw_system_run
        from quasilpv.telemetry import LOG_NAME

        for path in [*draw_system_run(run, out, formats), write_log(out / LOG_NAME, run)]:
            print_note(f"wrote {path}")
    return code_of(run)
