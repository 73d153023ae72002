"""``design synth``: from a robot and a specification to an artifact."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from quasilpv.cli.console import JsonOption, print_json, print_note, print_table, progress
from quasilpv.cli.options import (
    SHORT_NAMES,
    ActivityOption,
    EncoderOption,
    RateOption,
    SpareOption,
    requested,
    require_controller,
    robot_named,
)
from quasilpv.files import claim_folder
from quasilpv.synthesis import CONTROLLERS, DEFAULT_CONTROLLER, DesignRequest


def synth_command(
    robot_id: Annotated[
        str, typer.Argument(metavar="ROBOT", help="Robot id, see design list, or a robot.toml: design robot show.")
    ],
    *,
    controller: Annotated[
        str,
        typer.Option("--design", help=f"Controller: {', '.join(CONTROLLERS)}; for short {' or '.join(SHORT_NAMES)}."),
    ] = DEFAULT_CONTROLLER,
    rate_hz: RateOption = None,
    encoder_bits: EncoderOption = None,
    margin_spare: SpareOption = None,
    torque_activity: ActivityOption = None,
    allow_unverified: Annotated[
        bool,
        typer.Option(
            "--allow-unverified", help="Write a design that fails its certificate or its gate; the artifact says so."
        ),
    ] = False,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="DIR", help="Folder for both twins.  [default: out/ID]")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Design a controller, check what it claims, and write its artifact, as JSON and as CBOR.

    Exit code 1, and nothing written, if no design meets the specification, if an inequality does not hold in exact
    arithmetic, if the robust gate is not passed, or if the torque or slew limits cannot deliver what the design needs.

    \b
    Example:
      design synth arm3 --rate-hz 2000 -o out/arm3-2khz
    """
    source = robot_named(robot_id)
    wanted = requested(
        source,
        require_controller(controller),
        rate_hz,
        encoder_bits,
        margin_spare=margin_spare,
        torque_activity=torque_activity,
    )
    folder = out or Path("out") / source.id
    claim_folder(folder)
    answer = write_released(wanted, folder, allow_unverified=allow_unverified)
    if json:
        print_json(answer)
    else:
        print_released(answer)


def write_released(request: DesignRequest, out: Path, *, allow_unverified: bool = False) -> dict[str, Any]:
    """Design a controller, have it checked, and write both twins of its artifact into a folder; what --json prints.

    Raises:
        InputError: unknown names, or the folder cannot be written.
        InfeasibleError: no design meets the specification, or what it claims does not hold.
    """
    from quasilpv.artifact import write_artifact
    from quasilpv.release import release
    from quasilpv.scenarios import motions_of

    with progress(1) as steps:
        steps.begin(f"{request.controller} for {request.robot.id}")
        made = release(request, motions_of=motions_of, allow_unverified=allow_unverified, progress=steps.parts)
        steps.end()
    paths = write_artifact(out, made.artifact)
    return {
        "artifact": {path.suffix.removeprefix("."): str(path) for path in paths},
        "name": made.artifact.name,
        "hash": made.artifact.hash,
        "report": dict(made.report),
        "verification": {name: found for name, found in (made.artifact.verification or {}).items() if name != "report"},
    }


def print_released(answer: dict[str, Any]) -> None:
    """Print what `write_released` found, as tables."""
    evidence = answer["verification"]
    tables = {
        answer["name"]: answer["report"],
        **{name: evidence[name] for name in ("certificate", "gate") if evidence},
    }
    for title, members in tables.items():
        print_table(title, ("", ""), [(name, _text(value)) for name, value in members.items()], 2)
    if "released_unverified" in evidence:
        print_note("released although not verified: the artifact says so")
    for path in answer["artifact"].values():
        print_note(f"wrote {path}")


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_text, value)) + "]"
    if isinstance(value, dict):
        return ", ".join(f"{name} {_text(member)}" for name, member in value.items())
    return str(value)
