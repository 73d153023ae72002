"""What is assumed where nobody says otherwise, and what may be said: numbers and names that help pages state.

They are here, below everything, and not beside the code they belong to: a help page needs them, and none of the
libraries behind that code.
"""

from __future__ import annotations

ENCODER_BITS = 20
"""Of the encoders of every scenario, and those a design is made for."""

RELATIVE_TOLERANCE = 1e-4
"""Width of the last interval around a boundary, relative to where it is."""

SAMPLE_PERIOD_S = 0.01
"""Of conditions on a sampled model, s."""

DEFAULT_TIME_S, DEFAULT_MEMORY_GIB = 100.0, 4.0
"""Of one answer."""

REPRESENTATIONS = ("ts", "rules", "reduced", "per-premise", "uncertain", "grouped=0,1+2")
"""Forms of a representation's name; numbers are premises, ``+`` joins a group, ``,`` separates groups."""

WATCHDOG_S = 0.02
"""In real time: a fault after so long without a measurement, brakes after so long without a command."""

DEFAULT_URL = "udpm://239.255.76.67:7667?ttl=0"
"""Where runs are listened to; with a time to live of 0 it stays on this machine."""

DEFAULT_PORT = 8080
"""Of the page of a run."""

LAST = "LAST"
"""The word for the log of the last run."""

DEFAULT_FORMATS = ("png",)
"""Formats of the files of a figure."""

LARGEST_WRITTEN = 1e16
"""Of numbers that people write: products of a few of them are finite, and as a count none of them fits into memory."""
