"""What stopped a run in two processes, and when, from what both of them left."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.telemetry.codes import FAULT

NUMBERS = {
    "measurement lost": "F2",
    "plant silent": "F2",
    "foreign messages": "F5",
    "controller silent": "F7",
    "premise outside": "F9",
    "deadline overrun": "F12",
    "controller ended": "F16",
    "plant failed": "F17",
    "start refused": "F19",
    "measurement implausible": "F20",
    "speed beyond": "F21",
    "second plant": "F22",
    "second controller": "F22",
    "commands refused": "F25",
    "outside the limits": "F27",
}
"""Which fault of ``docs/reference/faults.md`` a cause is, by the beginning of its words."""


@dataclass(frozen=True)
class Fault:
    """Why a run ended before its end.

    Attributes:
        cause: in the words of the program that says so.
        sample: the first one at which the controller, or the plant's watchdog, no longer did what the law says.
        time_s: of that sample.
    """

    cause: str
    sample: int
    time_s: float

    def __str__(self) -> str:
        """``fault F2 at 1.842 s: plant silent``."""
        number = next((f" {number}" for words, number in NUMBERS.items() if self.cause.startswith(words)), "")
        return f"fault{number} at {self.time_s:.3f} s: {self.cause}"


def fault_of(
    said: str,
    report: Mapping[str, Any],
    controller: Mapping[str, FloatArray],
    plant: Mapping[str, FloatArray],
    sample_period_s: float,
) -> Fault:
    """The fault of a run that one of its programs says was stopped by one.

    Args:
        said: by that program, in a line.
        report: of the controller; its post-mortem ends with the sample that latched the fault.
        controller, plant: columns of their records.
        sample_period_s: T.
    """
    post_mortem = report.get("post_mortem")
    if post_mortem:
        return _at(str(post_mortem["cause"]), int(post_mortem["seq"][-1]), sample_period_s)
    latched = controller["seq"][controller["state"] == FAULT]
    if latched.size:
        return _at(str(report["fault_cause"]), int(latched[0]), sample_period_s)
    # The controller knows of none: the plant was left alone; its brake acts after the last sample with a command.
    commanded = plant["seq"][plant["command_delay_s"] >= 0.0]
    return _at(_cause_in(said), int(np.max(commanded, initial=-1)) + 1, sample_period_s)


def _at(cause: str, sample: int, sample_period_s: float) -> Fault:
    return Fault(cause, sample, sample * sample_period_s)


def _cause_in(said: str) -> str:
    """``controller silent`` of ``qlpv-simulator: fault stop: controller silent, last sample 7``."""
    return said.rpartition("fault stop: ")[2].partition(", last sample ")[0]
