"""The kinds of robots the checker knows: one exact and one numeric evaluator each, found by the tag of the document."""

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
"""In rational arithmetic, from the document of the kind."""

NUMERIC: Mapping[str, Callable[[Any], RobotDynamics]] = {
    "serial-arm": SerialArmDynamics,
    "five-bar": FiveBarDynamics,
    "spring-disc": SpringDiscDynamics,
}
"""In doubles."""


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
    """The entry of a robot's kind. InputError: there is none."""
    if mechanism.kind not in table:
        raise InputError(source, "robot.parameters.kind", mechanism.kind, f"one of {', '.join(table)} here")
    return table[mechanism.kind]
