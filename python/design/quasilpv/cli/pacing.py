"""How ``hil`` runs its two programs, and what it says of their time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from quasilpv.cli.console import print_table
from quasilpv.defaults import WATCHDOG_S

if TYPE_CHECKING:
    from quasilpv.experiments.processes import Talk

LATENCIES = ("wakeup_ns", "round_trip_ns")
COUNTERS = ("missed_commands", "late_commands", "watchdog_samples", "overruns", "skipped_ticks")
QUANTILES = ("p50", "p99", "p99_9", "max")


@dataclass(frozen=True)
class Pacing:
    """What the command line says of time and transport; None where it says nothing."""

    real_time: bool
    silence_s: float | None
    hold_s: float | None
    priority: int | None
    url: str | None
    key: Path | None

    def talk(self, least_watchdog_s: float) -> Talk:
        """How both programs talk, with watchdogs of at least this time unless others were asked for."""
        from quasilpv.experiments.processes import RealTimeOptions, Talk, own_port

        usual = max(WATCHDOG_S, least_watchdog_s)
        silence, hold = (usual if asked is None else asked for asked in (self.silence_s, self.hold_s))
        return Talk(
            "realtime" if self.real_time else "lockstep",
            RealTimeOptions(silence, hold, self.priority),
            self.url or own_port(),
            self.key,
        )


def print_latencies(simulator: Mapping[str, Any]) -> None:
    """The latencies that the plant reports."""
    latencies = {name: simulator[name] for name in LATENCIES if simulator[name] is not None}
    waits = [
        (name.removesuffix("_ns").replace("_", " "), *(f"{latency[q] / 1e3:.1f}" for q in QUANTILES))
        for name, latency in latencies.items()
    ]
    print_table("latency at the plant, us", ("", *QUANTILES), waits)


def counters_of(simulator: Mapping[str, Any]) -> str:
    """What went wrong in real time, in a line."""
    return ", ".join(f"{name.replace('_', ' ')}: {simulator[name]}" for name in COUNTERS)


def print_ending(
    controller: Mapping[str, Any], simulator: Mapping[str, Any], *, mode: str, samples: int, stopped: bool
) -> None:
    """How a run over LCM ended, in a line: where a fault's last samples are, or what was identical, or counted."""
    if stopped:
        post_mortem = controller["post_mortem"]
        seq = post_mortem["seq"] if post_mortem else []
        print(f"stopped by a fault; the last {len(seq)} samples before it are in --json, controller_report.post_mortem")
    elif mode == "lockstep":
        print(f"{samples} samples, identical to the run in process")
    else:
        print(counters_of(simulator))
