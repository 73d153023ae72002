"""Fields of messages that hold codes, in words (``docs/reference/messages.md``)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

STATES = ("init", "ready", "running", "degraded", "fault")
RUNNING, FAULT = STATES.index("running"), STATES.index("fault")

SOURCES = ("", "controller", "plant", "operator")
CONTROLLER, PLANT = SOURCES.index("controller"), SOURCES.index("plant")

EVENTS = ("", "started", "ended", "fault", "reset", "left its domain")
STARTED, ENDED, LEFT_DOMAIN = EVENTS.index("started"), EVENTS.index("ended"), EVENTS.index("left its domain")

FAULT_CAUSES = (
    "",
    "measurement lost",
    "plant silent",
    "deadline overrun",
    "foreign messages",
    "premise outside its box",
    "stop requested",
    "second plant on this session",
    "second controller on this session",
    "plant failed",
    "measurement implausible",
    "speed beyond the domain",
    "start refused",
    "outside the limits of the proof",
)

SYSTEM_FLAGS = {
    1: "signal invalid",
    2: "premise outside its box",
    4: "input at its limit",
    8: "input not finite",
    16: "outside the region",
}
"""Bits of the flags of a step of a general system, in words."""

INPUT_AT_LIMIT = 4

TORQUE_SATURATED, SLEW_LIMITED = 1 << 2, 1 << 3
AT_LIMIT = TORQUE_SATURATED | SLEW_LIMITED
"""Bits of the flags of a step in which a limit acted."""

GEAR_SENSORS = {"motor_angle_rad": 1 << 0, "link_angle_rad": 1 << 1, "joint_torque_nm": 1 << 2}
"""Bits of ``available`` in measurements and telemetry, by the member that means something with it."""


def word(words: Sequence[str], code: int) -> str:
    """The word of a code, or the code itself if it has none."""
    return words[code] if 0 <= code < len(words) and words[code] else f"code {code}"


def event_in_words(event: Any, states: Sequence[str] = ()) -> str:
    """Who says what in a record of an event, and why if it is about a fault.

    Args:
        event: the record.
        states: their names, of a general system.
    """
    said = f"{word(SOURCES, int(event['source']))} {word(EVENTS, int(event['code']))}"
    if event["code"] == LEFT_DOMAIN:
        index = int(event["detail"][0])
        return f"{said}: {states[index] if 0 <= index < len(states) else f'state {index}'}"
    cause = int(event["detail"][0])
    return f"{said}: {word(FAULT_CAUSES, cause)}" if cause else said
