"""Clarabel, in this process or in one of its own.

Clarabel does not return to Python before it is done: no time limit holds while it factors, Ctrl-C waits for it, and an
allocation that fails ends the process. So a problem that takes longer than a moment is solved in a process of its own
where limits are in force (`budget`): it can be stopped, and what it does to itself stays there. A process costs some
milliseconds; small problems are solved in place.
"""

from __future__ import annotations

import ctypes
import faulthandler
import multiprocessing
import os
import resource
import signal
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection

import clarabel
import numpy as np
from scipy import sparse

from quasilpv.arrays import FloatArray
from quasilpv.lmi import budget

IN_PLACE = 1_000_000
"""Entries of upper triangles times unknowns up to which a problem takes less than about a second."""

QUIET_S = 2.0
"""Progress is reported after it."""

POLL_S = 0.1
REPORT_S = 1.0


@dataclass(frozen=True, eq=False)
class Reply:
    """What Clarabel returned.

    Attributes:
        status: its own word.
        x: the unknowns; not a number where there are none.
        z: the dual, one number per row.
        iterations: how many.
    """

    status: str
    x: FloatArray
    z: FloatArray
    iterations: int = 0

    @property
    def infeasible(self) -> bool:
        """Whether it claims that there is no point."""
        return "PrimalInfeasible" in self.status


@dataclass(frozen=True, eq=False)
class _Program:
    """What is solved; see `solve`."""

    coefficients: sparse.csc_matrix
    offset: FloatArray
    sizes: Sequence[int]
    objective: FloatArray
    method: str


def solve(
    coefficients: sparse.csc_matrix,
    offset: FloatArray,
    sizes: Sequence[int],
    *,
    objective: FloatArray | None = None,
    method: str = "faer",
) -> Reply:
    """Find x with ``svec^-1(coefficients x + offset)`` positive semidefinite, block by block.

    Args:
        coefficients: scaled upper triangles by unknowns, (rows, unknowns).
        offset: (rows,).
        sizes: order of every block.
        objective: what is minimised, (unknowns,); None for any x.
        method: with which linear equations are solved, in Clarabel's words.

    Raises:
        TimeUpError: the time limit was reached.
        TooLargeError: the memory limit was.
    """
    left = budget.time_left_s()
    linear = np.zeros(coefficients.shape[1]) if objective is None else objective
    program = _Program(coefficients, offset, sizes, linear, method)
    if not budget.is_limited() or coefficients.shape[0] * coefficients.shape[1] <= IN_PLACE:
        return _in_place(program, left)
    return _apart(program, left)


def _in_place(program: _Program, time_s: float | None) -> Reply:
    unknowns = program.coefficients.shape[1]
    cones = [clarabel.PSDTriangleConeT(size) for size in program.sizes]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.direct_solve_method = program.method
    if time_s is not None:
        settings.time_limit = time_s
    quadratic = sparse.csc_matrix((unknowns, unknowns))
    data = quadratic, program.objective, -program.coefficients, program.offset
    found = clarabel.DefaultSolver(*data, cones, settings).solve()
    if str(found.status) == "MaxTime":
        budget.time_is_up()
    return Reply(str(found.status), np.asarray(found.x), np.asarray(found.z), found.iterations)


def _apart(program: _Program, time_s: float | None) -> Reply:
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    memory = budget.memory_limit_gib()
    child = context.Process(target=_work, args=(sender, os.getpid(), memory, program))
    child.start()
    sender.close()
    start = time.monotonic()
    progress = _Progress(program.coefficients.shape, time_s)
    try:
        while not receiver.poll(POLL_S):
            passed = time.monotonic() - start
            if time_s is not None and passed > time_s:
                budget.time_is_up()
            progress.after(passed)
        reply: Reply = receiver.recv()
    except EOFError:
        allowed = "what there is" if memory is None else f"{memory:g} GiB"
        raise budget.TooLargeError("solver", "memory", f"more than {allowed}", "a smaller problem") from None
    finally:
        progress.clear()
        child.kill()
        child.join()
        receiver.close()
    return reply


def _work(
    sender: Connection,
    parent: int,
    memory_gib: float | None,
    program: _Program,
) -> None:
    """In the process of its own: Ctrl-C is for the parent, and it does not outlive it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
    if os.getppid() != parent:
        os._exit(1)
    faulthandler.disable()
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # an allocation that fails says so there
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if memory_gib is not None:
        most = _address_space() + int(memory_gib * budget.GIB)
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
    sender.send(_in_place(program, None))
    sender.close()
    os._exit(0)


def _address_space() -> int:
    """Bytes this process has mapped already."""
    with open("/proc/self/statm", encoding="ascii") as statistics:
        return int(statistics.read().split()[0]) * resource.getpagesize()


class _Progress:
    """A line on stderr that says how long a solver has been at work, and how long it may be."""

    def __init__(self, shape: tuple[int, int], time_s: float | None) -> None:
        self._what = f"solving for {shape[1]} unknowns"
        self._time_s = time_s
        self._next = QUIET_S
        self._shown = False

    def after(self, passed: float) -> None:
        """Report, if it is time to."""
        if passed < self._next:
            return
        self._next = passed + REPORT_S
        left = "" if self._time_s is None else f", at most {self._time_s - passed:.0f} s left"
        line = f"{self._what}: {passed:.0f} s{left}"
        if sys.stderr.isatty():
            print(f"\r\x1b[K{line}", end="", file=sys.stderr, flush=True)
            self._shown = True
        elif self._next > QUIET_S + REPORT_S and not self._shown:
            print(line, file=sys.stderr, flush=True)
            self._next = passed + 10.0 * REPORT_S

    def clear(self) -> None:
        """Remove the line from a terminal."""
        if self._shown:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
