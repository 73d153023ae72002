"""Logs of runs: what went over the wire, the documents behind it, and what was true; read, write, replay, convert."""

from quasilpv.telemetry.event_log import SUFFIX, Event, read_events, write_events
from quasilpv.telemetry.log import LOG_NAME, Mode, RunHeader, RunLog, latest_log, read_log

__all__ = [
    "LOG_NAME",
    "SUFFIX",
    "Event",
    "Mode",
    "RunHeader",
    "RunLog",
    "latest_log",
    "read_events",
    "read_log",
    "write_events",
]
