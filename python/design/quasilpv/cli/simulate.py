"""``design simulate``: a general system in closed loop with its own equations."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from quasilpv.cli.console import JsonOption, print_json, print_note, print_table
from quasilpv.cli.options import FormatOption, formats_of
from quasilpv.cli.systems import numbers_by_name
from quasilpv.errors import InputError
from quasilpv.files import claim_folder


def simulate_command(
    artifact: Annotated[Path, typer.Argument(metavar="ARTIFACT", help="Of a system: design synth SYSTEM.")],
    *,
    start: Annotated[
        list[str] | None,
        typer.Option("--start", metavar="NAME=VALUE", help="A state at t = 0; may be repeated.  [default: its trim]"),
    ] = None,
    parameter: Annotated[
        list[str] | None,
        typer.Option(
            "--parameter", metavar="NAME=VALUE", help="True value of a parameter.  [default: middle of its interval]"
        ),
    ] = None,
    duration_s: Annotated[
        float | None, typer.Option("--duration", help="Length of the run, s.  [default: six times 1 / decay rate]")
    ] = None,
    delay_s: Annotated[float, typer.Option("--delay", help="Until an input acts, s; at most one sample.")] = 0.0,
    rk4_steps: Annotated[
        int, typer.Option("--rk4", min=0, max=1000, help="Runge-Kutta steps per sample; 0 for SUNDIALS IDA.")
    ] = 0,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="DIR", help="Draw figures of the run into this folder.")
    ] = None,
    figure_formats: FormatOption = None,
    json: JsonOption = False,
) -> int:
    """Run a controller of a system against its nonlinear equations, sampled and held as on a real plant.

    Exit code 1 if the run began inside the region and V rose above its start, or a state left its domain.

    \b
    Example:
      design simulate out/cart_pole/artifact.json --start th=0.2 -o out/cart_pole
    """
    from quasilpv.artifact.system_store import read_system_artifact
    from quasilpv.experiments.system_run import SystemExperiment, simulate

    formats = formats_of(figure_formats)
    if out is not None:
        claim_folder(out)
    read = read_system_artifact(artifact)
    if read is None:
        raise InputError(str(artifact), "schema", "a controller of a robot", "one of a system; robots: design track")
    experiment = SystemExperiment(
        numbers_by_name("--start", start),
        numbers_by_name("--parameter", parameter),
        duration_s,
        delay_s,
        rk4_steps,
    )
    run = simulate(read, experiment, str(artifact))
    answer = run.to_document()
    if json:
        print_json(answer)
    else:
        states = ", ".join(f"{name} {value:.4g}" for name, value in answer["final_state"].items())
        inputs = ", ".join(f"{name} {value:.4g}" for name, value in answer["largest_input"].items())
        rows = [
            ("samples", f"{answer['samples']}, {answer['duration_s']:.6g} s"),
            ("V", f"{answer['level_at_start']:.4g} at the start, {answer['final_level']:.4g} at the end"),
            ("largest V", f"{answer['largest_level']:.4g}"),
            ("final state", states),
            ("largest input", inputs),
            ("flags", ", ".join(answer["flags"]) or "none"),
        ]
        if run.exit is not None:
            rows.append(("left its domain", f"{run.exit[1]} at {run.exit[0]:.6g} s"))
        print_table(answer["artifact"], ("", ""), rows, left_columns=2)
        if answer["level_at_start"] > 1.0:
            print_note("the start is outside the region: nothing is proved of this run")
    if out is not None:
        from quasilpv.figures.systems import draw_system_run

        for path in draw_system_run(run, out, formats):
            print_note(f"wrote {path}")
    return 0 if run.stayed or answer["level_at_start"] > 1.0 else 1
