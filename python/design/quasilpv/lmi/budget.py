"""How much time and memory a question may take: what is known before a solver is asked, and what holds while it works.

Limits hold inside `limited`; outside nothing is limited. Time is looked at between inequalities, and the solver is
stopped (`worker`). Memory is estimated before a solver is asked. The solver factors a matrix with one node for every
unknown and one for every entry of an upper triangle, those of one inequality all connected, in an order of least
degree. An unknown that occurs in fewer entries than its inequalities have is eliminated first and joins them to one
dense block. With M_k the entries of the blocks that result, and U the unknowns that are left, about

    8 bytes x FILL x (sum_k M_k^2 / 2 + sum_k M_k u_k + U^2 / 2),

u_k those of the U that occur in block k.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from math import isfinite
from typing import NoReturn

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from quasilpv.arrays import IndexArray, distinct
from quasilpv.defaults import DEFAULT_MEMORY_GIB, DEFAULT_TIME_S
from quasilpv.errors import InputError, QuasilpvError
from quasilpv.lmi.layout import Layout

GIB = 2**30

FILL = 2.5
"""What the solver was measured to need over that: 1.5 to 2.8 times on problems of 0.02 to 33 GiB."""


@dataclass(frozen=True)
class Limits:
    """Of one question; None is no limit.

    Attributes:
        time_s: seconds from the question to its answer.
        memory_gib: what the solver may allocate, GiB.

    Raises:
        InputError: a limit is not positive.
    """

    time_s: float | None = None
    memory_gib: float | None = None

    def __post_init__(self) -> None:
        """Refuse limits that allow nothing."""
        for field, value in (("time limit", self.time_s), ("memory limit", self.memory_gib)):
            if value is not None and not (isfinite(value) and value > 0.0):
                raise InputError("limits", field, value, "a finite number > 0")


DEFAULT = Limits(DEFAULT_TIME_S, DEFAULT_MEMORY_GIB)
"""Of questions people ask."""


class TooLargeError(InputError):
    """A problem is larger than its budget; nothing was solved."""


class TimeUpError(QuasilpvError):
    """The time limit of a question was reached; nothing is known."""


@dataclass(frozen=True)
class Size:
    """Of a problem.

    Attributes:
        unknowns: scalar unknowns.
        rows: orders of the inequalities, summed.
        memory_gib: what a solver is expected to need.
    """

    unknowns: int
    rows: int
    memory_gib: float

    def __str__(self) -> str:
        """In words."""
        return f"{self.unknowns} unknowns, {self.rows} rows, about {self.memory_gib:.2g} GiB"


def at_most_gib(layout: Layout) -> float:
    """What a solver needs if nothing at all is sparse, GiB: known at once."""
    return 8.0 * FILL * (layout.rows + len(layout.kept)) ** 2 / 2.0 / GIB


def estimate(layout: Layout) -> Size:
    """The size of a compiled problem.

    Args:
        layout: of its coefficients.
    """
    sizes = np.array(layout.sizes)
    triangles = sizes * (sizes + 1) // 2
    _, rows, starts = layout.columns
    unknowns, lengths = len(layout.kept), np.diff(starts)
    cone_of_row = np.repeat(np.arange(len(sizes)), triangles)
    pairs = distinct(np.repeat(np.arange(unknowns), lengths) * len(sizes) + cone_of_row[rows])
    unknown, cone = np.divmod(pairs, len(sizes))
    group, gone = _merged(triangles, unknown, cone, lengths)
    order = np.bincount(group, weights=triangles)
    left = ~gone[unknown]
    coupled = distinct(unknown[left] * len(order) + group[cone[left]]) % len(order)
    entries = order @ order / 2.0 + order[coupled].sum() + np.count_nonzero(~gone) ** 2 / 2.0
    return Size(layout.unknowns, int(sizes.sum()), 8.0 * FILL * float(entries) / GIB)


def _merged(
    triangles: IndexArray, unknown: IndexArray, cone: IndexArray, lengths: IndexArray
) -> tuple[IndexArray, npt.NDArray[np.bool_]]:
    """Group of every cone, and which unknowns are eliminated before the cones they are in."""
    count, cones = len(lengths), len(triangles)
    group, gone = np.arange(cones), lengths == 0
    if not unknown.size:
        return group, gone
    present, first = np.unique(unknown, return_index=True)
    while True:
        order = np.bincount(group, weights=triangles)
        smallest = np.minimum.reduceat(order[group[cone]], first)
        now = gone.copy()
        now[present] |= lengths[present] < smallest
        if (now == gone).all():
            return group, gone
        gone = now
        joined = gone[unknown]
        places = (unknown[joined], count + cone[joined])
        graph = sparse.coo_matrix((np.ones(int(joined.sum())), places), shape=(count + cones,) * 2)
        _, label = connected_components(graph, directed=False)
        _, group = np.unique(label[count:], return_inverse=True)


def require_cones(count: int, order: int) -> None:
    """Refuse inequalities whose dense blocks alone exceed the memory limit, before they are written down.

    Args:
        count: of the inequalities.
        order: of each.

    Raises:
        TooLargeError: they do.
    """
    needed = 8.0 * count * (order * (order + 1) // 2) ** 2 / 2.0 / GIB
    allowed = memory_limit_gib()
    if allowed is not None and needed > allowed:
        got = f"{count} of order {order}, {needed:.2g} GiB for the cones alone"
        raise TooLargeError("condition", "inequalities", got, f"at most {allowed:g} GiB")


@dataclass(frozen=True)
class _Running:
    """Limits in force."""

    limits: Limits
    end: float | None


_running: ContextVar[_Running | None] = ContextVar("running", default=None)


@contextmanager
def limited(limits: Limits) -> Iterator[None]:
    """Put limits in force; within others, the earlier end and the smaller memory hold."""
    outer = _running.get()
    ends = [] if limits.time_s is None else [time.monotonic() + limits.time_s]
    memories = [] if limits.memory_gib is None else [limits.memory_gib]
    if outer is not None:
        ends += [] if outer.end is None else [outer.end]
        memories += [] if outer.limits.memory_gib is None else [outer.limits.memory_gib]
    inner = Limits(limits.time_s, min(memories, default=None))
    token = _running.set(_Running(inner, min(ends, default=None)))
    try:
        yield
    finally:
        _running.reset(token)


def time_left_s() -> float | None:
    """Seconds to the end of the question; None without a limit.

    Raises:
        TimeUpError: there are none.
    """
    running = _running.get()
    if running is None or running.end is None:
        return None
    left = running.end - time.monotonic()
    if left <= 0.0:
        time_is_up()
    return left


def time_is_up() -> NoReturn:
    """Raise the `TimeUpError` of the limits in force."""
    running = _running.get()
    limit = None if running is None else running.limits.time_s
    raise TimeUpError("stopped at the time limit" + ("" if limit is None else f" of {limit:g} s"))


def memory_limit_gib() -> float | None:
    """What a solver may allocate, GiB; None without a limit."""
    running = _running.get()
    return None if running is None else running.limits.memory_gib


def is_limited() -> bool:
    """Whether any limits are in force."""
    return _running.get() is not None
