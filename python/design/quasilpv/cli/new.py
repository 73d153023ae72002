"""``design new``: a file to start from."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Literal

import typer

from quasilpv.cli.console import JsonOption, print_json, print_note
from quasilpv.errors import InputError
from quasilpv.files import claim_file, write_atomically

SYSTEM = '''"""A pendulum with an unknown load: change the equations, names and intervals to yours.

    design synth {file}:plant -o out/plant
    design simulate out/plant/artifact.json --start angle=0.3 -o out/plant
"""

import quasilpv as ql


def plant(largest_angle: float = 1.0) -> ql.DescriptorSystem:
    """Numbers with defaults are parameters: design synth {file}:plant --set largest_angle=0.8."""
    return ql.DescriptorSystem.from_equations(
        # One equation per state; x' is a rate. An equation without a rate is algebraic, and so is its state.
        [
            "angle' = rate",
            "(0.02 + load)*rate' = 1.5*sin(angle) - 0.05*rate + torque",
        ],
        name="plant",
        state="angle rate",
        inputs="torque",
        # Where the model is to hold: what is in a nonlinear term needs an interval, and the region that is proved stays
        # inside. States that are not named here may be anywhere.
        domain={{
            "angle": (-largest_angle, largest_angle),
            "rate": (-5, 5),
            "load": (0, 0.01),
        }},
        # What the controller is not told.
        unknown="load",
        # For deviations from another operating point: equilibrium=((0.2, 0), (-1.5*sin(0.2),)), with sympy's sin.
    )
'''


def new_command(
    what: Annotated[Literal["system", "robot"], typer.Argument(metavar="system|robot", help="What to start.")],
    description: Annotated[
        Path | None, typer.Argument(metavar="[DESCRIPTION]", help="Of a robot: its URDF or MJCF.")
    ] = None,
    *,
    tip: Annotated[str | None, typer.Option(metavar="LINK", help="Of a robot: the link to control.")] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FILE", help="What to write.  [default: my_system.py, robot.toml]"),
    ] = None,
    json: JsonOption = False,
) -> int:
    """Write a commented file to start from: equations of a system, or what a robot's description lacks.

    A file that is there is never replaced.

    \b
    Examples:
      design new system
      design new robot ur5.urdf -o ur5.toml
    """
    path = out or Path("my_system.py" if what == "system" else "robot.toml")
    if os.path.lexists(path):
        raise InputError(str(path), "file", "one that is there", "another name: -o FILE")
    if what == "robot":
        if description is None:
            raise InputError("command line", "DESCRIPTION", "nothing", "the URDF or MJCF of the robot")
        from quasilpv.cli.robot import robot_command

        return robot_command("show", description, tip=tip, out=path, json=json)
    for option, value in (("DESCRIPTION", description), ("--tip", tip)):
        if value is not None:
            raise InputError("command line", option, value, "nothing: it is for a robot")
    claim_file(path)
    write_atomically({path: SYSTEM.format(file=path.name).encode(errors="surrogateescape")})
    if json:
        print_json({"file": str(path)})
    else:
        print_note(f"wrote {path}")
    return 0
