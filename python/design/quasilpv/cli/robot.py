"""``design robot``: a robot of one's own, from its description file."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from quasilpv.cli.console import JsonOption, print_json, print_note, print_table
from quasilpv.errors import InputError
from quasilpv.files import claim_file, write_atomically

if TYPE_CHECKING:
    from quasilpv.descriptions.described_tree import DescribedTree
    from quasilpv.descriptions.inertia_range import InertiaRange
    from quasilpv.systems.robots.spatial_robot import SpatialRobot


def robot_command(
    action: Annotated[Literal["show"], typer.Argument(metavar="show", help="What to do with the file.")],
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A robot.toml, or a URDF or MJCF description.")],
    *,
    tip: Annotated[str | None, typer.Option(metavar="LINK", help="Of a description: the link to control.")] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FILE", help="Of a description: a robot.toml to fill in."),
    ] = None,
    trust_xacro: Annotated[
        bool,
        typer.Option(
            "--trust-xacro", help="Evaluate a xacro file, which may run anything; with --out into a URDF beside."
        ),
    ] = False,
    prove: Annotated[bool, typer.Option("--prove", help="Prove the range of inertias over all postures.")] = False,
    accept_inertias: Annotated[
        bool, typer.Option("--accept-inertias", help="Take principal moments that no body has as they are.")
    ] = False,
    json: JsonOption = False,
) -> int:
    """Print what was understood of a robot's description, and what is doubtful in it.

    With --prove, bounds of the inertia with every load the file allows, relative to that of the robot with half the
    load, in exact arithmetic over the whole range of every joint. Exit code 1 if that was not proved.

    \b
    Examples:
      design robot show ur5.urdf -o robot.toml
      design robot show arm.urdf.xacro --trust-xacro -o robot.toml
      design robot show robot.toml --prove
    """
    from quasilpv.descriptions.robot_file import read_description
    from quasilpv.descriptions.xacro import expanded

    del action
    if file.suffix == ".toml":
        given = {"--tip": tip is not None, "--out": out is not None, "--trust-xacro": trust_xacro}
        for option in (name for name, is_given in given.items() if is_given):
            raise InputError("command line", option, option, "nothing with a robot.toml, which says it all")
        return _show_robot(file, prove=prove, accept_inertias=accept_inertias, json=json)
    if prove:
        expected = "a robot.toml, which states what a description lacks: design robot show FILE -o robot.toml"
        raise InputError("command line", "--prove", str(file), expected)
    if not trust_xacro:
        _show_description(file, read_description(file), tip, out, json=json)
        return 0
    with TemporaryDirectory() as nowhere:
        urdf = Path(nowhere) / "robot.urdf" if out is None else out.with_suffix(".urdf")
        write_atomically({urdf: expanded(file)})
        _show_description(urdf, read_description(urdf), tip, out, json=json)
    if out is not None:
        print_note(f"wrote {urdf}")
    return 0


def _show_description(file: Path, described: DescribedTree, tip: str | None, out: Path | None, *, json: bool) -> None:
    from quasilpv.descriptions.starting_file import starting_file

    if out is not None:
        claim_file(out)
    chosen = described.tip(tip)
    followers = {joint.name: 0.0 for joint in described.joints if joint.follows is not None}
    joints = described.moving(chosen, followers)
    if out is not None:
        text = starting_file(str(file.resolve()), chosen, joints)
        write_atomically({out: text.encode()})
        print_note(f"{out}: fill in the lines that begin with '# ?'")
    if json:
        print_json({"name": described.name, "tip_link": chosen, "joints": [_described_row(j) for j in joints]})
        return
    rows = [tuple(_cell(value) for value in _described_row(joint).values()) for joint in joints]
    columns = ("joint", "carries", "kind", "lower", "upper", "speed", "torque", "rotor inertia")
    print_table(f"{described.name or file.stem}, {len(joints)} joints to {chosen}", columns, rows, left_columns=3)


def _described_row(joint: Any) -> dict[str, Any]:
    return {
        "joint": joint.name,
        "carries": joint.body,
        "kind": joint.written_kind,
        "lower": joint.lower if abs(joint.lower) < float("inf") else None,
        "upper": joint.upper if abs(joint.upper) < float("inf") else None,
        "speed": joint.speed,
        "torque": joint.torque,
        "rotor_inertia": joint.rotor_inertia_kg_m2,
    }


def _show_robot(file: Path, *, prove: bool, accept_inertias: bool, json: bool) -> int:
    from quasilpv.descriptions.inertia_range import proved_inertia_range
    from quasilpv.descriptions.plausibility import concerns, require_bodies
    from quasilpv.descriptions.robot_file import read_robot_file

    robot = read_robot_file(file).robot()
    require_bodies(robot.tree, str(file), accept_triangle=accept_inertias)
    doubts = concerns(robot.tree)
    found = proved_inertia_range(robot) if prove else None
    if json:
        print_json(
            {
                "id": robot.id,
                "joints": [row for row in _rows(robot)],
                "concerns": [{"joint": doubt.joint, "text": doubt.text} for doubt in doubts],
                "inertia": None if found is None else _found_document(found),
            }
        )
    else:
        columns = ("joint", "lower", "upper", "speed", "torque", "rotor inertia", "mass", "reach")
        title = f"{robot.id}: {robot.tree.order} joints, rad, rad/s, N m, kg m², kg, m"
        print_table(title, columns, [tuple(_cell(v) for v in row.values()) for row in _rows(robot)])
        for doubt in doubts:
            print_note(f"{doubt.joint}: {doubt.text}")
        if found is not None:
            print(_sentence(found))
    return 0 if found is None or found.needed_range is not None else 1


def _rows(robot: SpatialRobot) -> list[dict[str, Any]]:
    following = [*(joint.placement for joint in robot.tree.joints[1:]), robot.tree.tool]
    return [
        {
            "joint": stated.name,
            "lower": stated.angle_rad[0],
            "upper": stated.angle_rad[1],
            "speed": stated.speed_rad_s,
            "torque": stated.torque_nm,
            "rotor_inertia": stated.rotor_inertia_kg_m2,
            "mass": own.inertia.mass_kg,
            "reach": float((after.translation_m**2).sum() ** 0.5),
        }
        for stated, own, after in zip(robot.joints, robot.tree.joints, following, strict=True)
    ]


def _found_document(found: InertiaRange) -> dict[str, Any]:
    return {
        "needed_range": None if found.needed_range is None else list(found.needed_range),
        "sampled_range": list(found.sampled_range),
        "seconds_to_find": found.seconds_to_find,
        "seconds_to_check": found.seconds_to_check,
        "cells": found.cells,
    }


def _sentence(found: InertiaRange) -> str:
    low, high = found.sampled_range
    sampled = f"postures, random and climbing, show [{low:.4g}, {high:.4g}]"
    if found.needed_range is None:
        return f"no range of inertias was proved; {sampled}"
    c1, c2 = found.needed_range
    return (
        f"proved for every posture and load: {c1:.4g} M < M_true < {c2:.4g} M, M with half the load; {sampled}; "
        f"found in {found.seconds_to_find:.1f} s, checked in {found.seconds_to_check:.2f} s, {found.cells} cells"
    )


def _cell(value: Any) -> str:
    return "-" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)
