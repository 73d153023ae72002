"""Where each kind of robot is decided, found by the tag of its document; a kind that is nowhere is refused by name.

| kind | exactly | in doubles |
|---|---|---|
| those in a plane | `EXACT`: inertia as cosines of absolute angles, gravity, friction | `NUMERIC` |
| those of `IN_SPACE` | `robot.tree`: inequalities along a chain of bodies | `tree_range.TreePair` |

A robot in space has no evaluator of the first form: its inertia is no sum of cosines of differences of absolute angles,
which premises, programs and grids of the planar laws are made of. Its laws have a chain as design inertia, whose claims
and gates are `tree_model` and `tree_range`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from quasilpv.certificate.robot.dynamics import RobotDynamics
from quasilpv.certificate.robot.five_bar import FiveBarData, FiveBarDynamics
from quasilpv.certificate.robot.mechanism import MechanismData
from quasilpv.certificate.robot.serial_arm import SerialArmData, SerialArmDynamics
from quasilpv.certificate.robot.spring_disc import SpringDiscData, SpringDiscDynamics
from quasilpv.documents.mechanism import MechanismDocument
from quasilpv.errors import InputError

T = TypeVar("T")

EXACT: Mapping[str, Callable[[Any], MechanismData]] = {
    "serial-arm": SerialArmData,
    "five-bar": FiveBarData,
    "spring-disc": SpringDiscData,
}
"""Of robots in a plane, in rational arithmetic, from the document of the kind."""

NUMERIC: Mapping[str, Callable[[Any], RobotDynamics]] = {
    "serial-arm": SerialArmDynamics,
    "five-bar": FiveBarDynamics,
    "spring-disc": SpringDiscDynamics,
}
"""Of the same, in doubles."""

IN_SPACE = frozenset({"tree"})
"""Kinds that are chains of bodies."""


def is_in_space(mechanism: MechanismDocument, source: str = "artifact") -> bool:
    """Whether a robot is decided as a chain of bodies, or by the tables here.

    Raises:
        InputError: its kind is in neither.
    """
    if mechanism.kind in IN_SPACE:
        return True
    if mechanism.kind not in EXACT:
        raise InputError(source, "robot.parameters.kind", mechanism.kind, f"one of {', '.join((*EXACT, *IN_SPACE))}")
    return False


def exact_robot(mechanism: MechanismDocument, source: str = "artifact") -> MechanismData:
    """The exact evaluator of a robot.

    Raises:
        InputError: its kind has none, or a five-bar linkage with links of different lengths.
    """
    return known(EXACT, mechanism, source)(mechanism)


def numeric_robot(mechanism: MechanismDocument, source: str = "artifact") -> RobotDynamics:
    """The numeric evaluator of a robot. Errors as `exact_robot`."""
    return known(NUMERIC, mechanism, source)(mechanism)


def known(table: Mapping[str, T], mechanism: MechanismDocument, source: str) -> T:
    """The entry of a robot's kind. InputError: there is none; a robot in space has none in any of these tables."""
    if mechanism.kind not in table:
        about = " (of robots in a plane)" if mechanism.kind in IN_SPACE else ""
        raise InputError(source, "robot.parameters.kind", mechanism.kind, f"one of {', '.join(table)} here{about}")
    return table[mechanism.kind]
