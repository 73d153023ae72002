"""How long work says how far it is."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

Progress: TypeAlias = Callable[[int, int], None]
"""Called with (points done, points in all)."""


def no_progress(done: int, total: int) -> None:
    """Report nothing."""
