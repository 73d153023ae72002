"""``design synth``: from a robot and a specification to an artifact."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from quasilpv.artifact import write_artifact
from quasilpv.cli.console import JsonOption, print_json, print_note, print_table, progress
from quasilpv.cli.options import EncoderOption, RateOption, require_controller, specification
from quasilpv.release import release
from quasilpv.synthesis import CONTROLLERS, DEFAULT_CONTROLLER
from quasilpv.systems.registry import robot


def synth_command(
    robot_id: Annotated[str, typer.Argument(metavar="ROBOT", help="Robot id, see design list.")],
    *,
    controller: Annotated[
        str, typer.Option("--design", help=f"Controller: {', '.join(CONTROLLERS)}.")
    ] = DEFAULT_CONTROLLER,
    rate_hz: RateOption = None,
    encoder_bits: EncoderOption = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="DIR", help="Folder for both twins.  [default: out/ROBOT]")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Design a controller and write its artifact, as JSON and as CBOR.

    \b
    Example:
      design synth arm3 --rate-hz 2000 -o out/arm3-2khz
    """
    robot(robot_id)
    require_controller(controller)
    wanted = specification(rate_hz, encoder_bits)
    with progress(1) as steps:
        steps.begin(f"{controller} for {robot_id}")
        made = release(robot_id, controller, wanted, progress=steps.parts)
        steps.end()
    paths = write_artifact(out or Path("out") / robot_id, made.artifact)
    answer: dict[str, Any] = {
        "artifact": {path.suffix.removeprefix("."): str(path) for path in paths},
        "name": made.artifact.name,
        "hash": made.artifact.hash,
        "report": dict(made.report),
    }
    if json:
        print_json(answer)
        return
    print_table(made.artifact.name, ("", ""), [(name, _text(value)) for name, value in made.report.items()], 2)
    for path in paths:
        print_note(f"wrote {path}")


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_text, value)) + "]"
    if isinstance(value, dict):
        return ", ".join(f"{name} {_text(member)}" for name, member in value.items())
    return str(value)
