"""``design synth``: from a robot and a specification to an artifact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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
from quasilpv.cli.parameters import SetOption
from quasilpv.cli.systems import names_a_system, numbers_by_name, premise_fault_of, print_system, write_system
from quasilpv.errors import ClaimError, InfeasibleError, InputError
from quasilpv.files import claim_folder
from quasilpv.synthesis import CONTROLLERS, DEFAULT_CONTROLLER, DesignRequest, default_controller

if TYPE_CHECKING:
    from quasilpv.systems.robots.registry import AnyRobot


def synth_command(
    robot_id: Annotated[
        str,
        typer.Argument(
            metavar="ROBOT|SYSTEM",
            help="A robot of design list, or a robot.toml: design robot show. Or a system: of design list, FILE.json,"
            " or FILE.py:NAME, which executes the code in FILE.py.",
        ),
    ],
    *,
    controller: Annotated[
        str | None,
        typer.Option(
            "--design",
            "--law",
            help=f"Controller: {', '.join(CONTROLLERS)}; for short {' or '.join(SHORT_NAMES)}."
            f"  [default: {DEFAULT_CONTROLLER}; of an arm with elastic joints, by its class]",
        ),
    ] = None,
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
    objective: Annotated[
        str | None,
        typer.Option(
            "--objective",
            help="Of a system: largest-region, fastest, least-gain or least-l2-gain.  [default: largest-region]",
        ),
    ] = None,
    decay: Annotated[
        float | None,
        typer.Option("--decay", help="Of a system: decay rate, 1/s.  [default: a tenth of its own rate]"),
    ] = None,
    input_limit: Annotated[
        list[str] | None,
        typer.Option(
            "--input-limit", metavar="NAME=VALUE", help="Of a system: largest deviation of an input; may be repeated."
        ),
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option("--speed", help="Of a system: bound of the closed loop, 1/s.  [default: what the rate allows]"),
    ] = None,
    share: Annotated[
        float | None,
        typer.Option(
            "--share", help="Of a system: part of the domain that all but largest-region cover.  [default: 0.5]"
        ),
    ] = None,
    disturbance: Annotated[
        list[str] | None,
        typer.Option(
            "--disturbance",
            metavar="NAME=VALUE",
            help="For least-l2-gain: the input, or the state to whose rate, a disturbance of this size is added.",
        ),
    ] = None,
    performance: Annotated[
        list[str] | None,
        typer.Option(
            "--performance",
            metavar="NAME=VALUE",
            help="For least-l2-gain: a state or an input, and which deviation of it counts as 1.",
        ),
    ] = None,
    premise_policy: Annotated[
        str | None,
        typer.Option(
            "--premise-policy",
            metavar="clamp|fault|S",
            help="Of a system, where a premise leaves its box: clamp it, a fault, or a fault after so many seconds."
            "  [default: 1]",
        ),
    ] = None,
    measured: Annotated[
        str | None,
        typer.Option(
            "--measured",
            metavar="NAME,...",
            help="Of a system: the states that the law reads, or outputs; an observer estimates the others."
            "  [default: all states]",
        ),
    ] = None,
    start_estimate: Annotated[
        list[str] | None,
        typer.Option(
            "--start-estimate",
            metavar="NAME=VALUE",
            help="First estimate of a state that is not measured; may be repeated.  [default: its trim]",
        ),
    ] = None,
    set_: SetOption = None,
    allow_unproved_rate: Annotated[
        bool,
        typer.Option("--allow-unproved-rate", help="Of a system: release a sampling rate that is not proved."),
    ] = False,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="DIR", help="Folder for both twins.  [default: out/ID]")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Design a controller, check what it claims, and write its artifact, as JSON and as CBOR.

    Exit code 1, and nothing written, if no design meets the specification, if an inequality does not hold in exact
    arithmetic, if the robust gate is not passed, or if the torque or slew limits cannot deliver what the design needs.

    Of a system the controller comes with the largest region inside its domain and its input limits that no solution
    leaves, exact; exit code 1 too if the sampling rate is not proved to keep it. With --measured the law reads these
    states only: what is proved then holds for the state and the error of the estimates together.

    \b
    Examples:
      design synth arm3 --rate-hz 2000 -o out/arm3-2khz
      design synth examples/systems/cart_pole.py:cart_pole --decay 1 --input-limit u=60 -o out/cart_pole
    """
    of_systems = {
        "--objective": objective,
        "--decay": decay,
        "--input-limit": input_limit,
        "--speed": speed,
        "--share": share,
        "--disturbance": disturbance,
        "--performance": performance,
        "--premise-policy": premise_policy,
        "--measured": measured,
        "--start-estimate": start_estimate,
        "--set": set_,
        "--allow-unproved-rate": allow_unproved_rate or None,
    }
    if names_a_system(robot_id):
        of_robots = {
            "--encoder-bits": encoder_bits,
            "--margin-spare": margin_spare,
            "--torque-activity": torque_activity,
            "--allow-unverified": allow_unverified or None,
            "--design": controller,
        }
        _refuse(of_robots, robot_id, "a robot")
        wanted = {
            "objective": objective,
            "decay_rate": decay,
            "input_limits": numbers_by_name("--input-limit", input_limit) or None,
            "rate_hz": rate_hz,
            "speed": speed,
            "share": share,
            "disturbance": numbers_by_name("--disturbance", disturbance) or None,
            "performance": numbers_by_name("--performance", performance) or None,
            "measured": None if measured is None else tuple(part.strip() for part in measured.split(",")),
            "start_estimate": numbers_by_name("--start-estimate", start_estimate) or None,
        }
        made = write_system(
            robot_id,
            out,
            parameters=numbers_by_name("--set", set_),
            allow_unproved_rate=allow_unproved_rate,
            **{name: value for name, value in wanted.items() if value is not None},
            **premise_fault_of(premise_policy),
        )
        if json:
            print_json(made)
        else:
            print_system(made)
        return
    _refuse(of_systems, robot_id, "a system")
    source = robot_named(robot_id)
    chosen = default_controller(source) if controller is None else require_controller(controller)
    if controller is None and getattr(source, "arm_class", "rigid") != "rigid":
        print_note(_why(source, chosen))
    request = requested(
        source,
        chosen,
        rate_hz,
        encoder_bits,
        margin_spare=margin_spare,
        torque_activity=torque_activity,
    )
    folder = out or Path("out") / source.id
    claim_folder(folder)
    answer = write_released(request, folder, allow_unverified=allow_unverified)
    if json:
        print_json(answer)
    else:
        print_released(answer)


def _why(robot: AnyRobot, chosen: str) -> str:
    """Why the law of a class was chosen, and what else there is by name."""
    from quasilpv.synthesis.elastic.classes import reason_of
    from quasilpv.systems.robots.spatial_robot import SpatialRobot

    if not isinstance(robot, SpatialRobot):
        return f"{robot.id}: {chosen}"
    others = [name for name, kind in CONTROLLERS.items() if robot.arm_class in kind.arm_classes and name != chosen]
    instead = f"; --law {' or '.join(others)} is there too" if others else ""
    return f"{robot.id} is {robot.arm_class}, {reason_of(robot)}: {chosen}{instead}"


def _refuse(options: Mapping[str, object], name: str, kind: str) -> None:
    """InputError if an option is given that the other kind of thing has."""
    for option, value in options.items():
        if value is not None:
            raise InputError("command line", option, value, f"nothing: {name} is not {kind}, which it is for")


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
        try:
            made = release(request, motions_of=motions_of, allow_unverified=allow_unverified, progress=steps.parts)
        except (ClaimError, InfeasibleError) as error:
            faster = _least_rate(request)
            raise error if faster is None else type(error)(f"{error}; --rate-hz {faster:g} would be released") from None
        steps.end()
    paths = write_artifact(out, made.artifact)
    return {
        "artifact": {path.suffix.removeprefix("."): str(path) for path in paths},
        "name": made.artifact.name,
        "hash": made.artifact.hash,
        "report": dict(made.report),
        "verification": {name: found for name, found in (made.artifact.verification or {}).items() if name != "report"},
    }


def _least_rate(request: DesignRequest) -> float | None:
    """The least of 1, 2, 5, 10, ... Hz above what was asked for, up to the controller's own rate, that is released."""
    from quasilpv.release import release
    from quasilpv.scenarios import motions_of

    asked, usual = request.specification.rate_hz, CONTROLLERS[request.controller].rate_hz
    rates = [step * 10.0**power for power in range(1, 5) for step in (1.0, 2.0, 5.0)]
    for rate in (rate for rate in rates if asked < rate <= usual):
        try:
            release(replace(request, specification=replace(request.specification, rate_hz=rate)), motions_of=motions_of)
        except (ClaimError, InfeasibleError):
            continue
        return rate
    return None


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
