"""A commented ``robot.toml`` to start from: what a description says is filled in, what it does not say is asked for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isfinite

from quasilpv.descriptions.described_tree import DescribedJoint

HEAD = """# What the description lacks. Angles in rad, speeds in rad/s, torques in N m, inertias in kg m^2; of a joint
# that slides m, m/s, N, kg. Lines that begin with "# ?" have no default: fill them in and remove the "# ?".
description = {description}
tip_link = {tip}

[base]
gravity = 9.81          # m/s^2
orientation = "floor"   # or "wall", "ceiling", or [roll, pitch, yaw]

[payload]               # everything the tool may carry; remove the table if that is nothing
# ? mass = 5.0                                                    # kg, at most
# ? com_box = [[-0.03, 0.03], [-0.03, 0.03], [0.02, 0.08]]        # m, in the frame of the tip
# ? inertia = 0.02                                                # about its centre of mass, at most

[uncertainty]
links = 0.0             # share by which every link's inertia may differ from the description
"""


def starting_file(description: str, tip: str, joints: Sequence[DescribedJoint]) -> str:
    """The text of a ``robot.toml``.

    Args:
        description: path of the description, as it will be looked for from the folder of the new file.
        tip: the frame to control.
        joints: those on the way to it.
    """
    tables = "\n".join("\n".join(_table(joint)) for joint in joints)
    return f"{HEAD.format(description=_text(description), tip=_text(tip))}\n{tables}\n"


def _table(joint: DescribedJoint) -> Iterator[str]:
    yield f"[joints.{_text(joint.name)}]"
    limited = isfinite(joint.lower) and isfinite(joint.upper) and joint.lower < joint.upper
    yield from _line("angle", f"[{joint.lower!r}, {joint.upper!r}]" if limited else None, "[-3.1, 3.1]", "")
    yield from _line("speed", joint.speed, "3.0", "")
    yield from _line("torque", joint.torque, "100.0", "the largest of the drive")
    rotor = "the rotor's times the gear ratio squared; 0 only for direct drive"
    yield from _line("rotor_inertia", joint.rotor_inertia_kg_m2, "0.1", rotor)
    yield '# ? stiffness = [1e4, 4e4]   # of the gear, N m/rad, lowest and highest; "rigid" for a direct drive'
    yield "# ? damping_least = 0.0      # of a gear that gives: damping over stiffness, s; 0 is safe"
    yield '# ? encoder_side = "motor"   # of a gear that gives: or "link", "both"'
    for name, value in (("damping", joint.damping_nm_s), ("friction", joint.friction_nm)):
        if value:
            yield f"# the description has a {name} of {value:g}; if real: friction_viscous, friction_coulomb"


def _line(name: str, value: object, example: str, remark: str) -> Iterator[str]:
    remark = f"   # {remark}" if remark else ""
    yield f"{name} = {value}{remark}" if value is not None else f"# ? {name} = {example}{remark}"


def _text(value: str) -> str:
    """A TOML string."""
    escaped = "".join(c if c.isprintable() and c not in '"\\' else f"\\u{ord(c):04x}" for c in value)
    return f'"{escaped}"'
