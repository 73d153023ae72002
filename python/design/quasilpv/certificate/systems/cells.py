"""The region of an artifact cut into cells, and the largest value of a function of them.

A cell is an interval of every signal. Only signals that slopes and premises depend on are cut; the others keep the
interval that the region, the limits or their domain allow. Cells that no state of the region lies in are left out.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from flint import arb, arb_mat

from quasilpv.certificate.exact.program_values import program_values
from quasilpv.certificate.systems.balls import at, part
from quasilpv.certificate.systems.dynamics import Dynamics
from quasilpv.certificate.systems.regional import bound_of
from quasilpv.documents.system_artifact import SystemArtifactDocument

FIRST = 60
"""So many before those with the largest values are cut."""

SETTLED = 0.02
"""Cutting ends when the largest value is nearer than this to that of its middle, relative."""

Box = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Largest:
    """A number that a function does not exceed over the region, the cells it was found on, and how many were tried."""

    value: float
    leaves: list[Box]
    cells: int


class Cells:
    """See the module.

    Raises:
        ArithmeticError: an algebraic state on which the premises depend has no domain or moves with the input.
    """

    def __init__(self, artifact: SystemArtifactDocument) -> None:
        """Of the region of an artifact."""
        self.artifact, self.dynamics = artifact, Dynamics(artifact)
        self.q, self.n, self.m = self.dynamics.q, self.dynamics.n, self.dynamics.m
        P = np.array(artifact.region.lyapunov)
        self._factor = np.linalg.cholesky(P)
        self._reach = [math.sqrt(P[k, k]) * (1.0 + 1e-12) for k in range(self.q)]

    def largest(self, of: Callable[[Sequence[arb]], float], most_cells: int) -> Largest:
        """The largest value over the region; cells with large values are cut."""
        used, whole = self.used, self.whole
        queue: list[tuple[float, int, Box]] = []
        count = 0

        def look(box: Box) -> None:
            nonlocal count
            if not self.is_outside(box):
                count += 1
                heapq.heappush(queue, (-of(self.balls(box)), count, box))

        for box in self.first(used):
            look(box)
        while count < most_cells and used:
            largest, _, box = queue[0]
            middle = of(self.balls(tuple((0.5 * (low + high),) * 2 for low, high in box)))
            if -largest <= middle + SETTLED * abs(middle):
                break
            heapq.heappop(queue)
            for half in halves(box, widest(box, whole, used)):
                look(half)
        return Largest(-queue[0][0], [box for _, _, box in queue], count)

    def first(self, cut: Sequence[int]) -> list[Box]:
        """The region in cells, breadth first: the whole of it may be too wide to be enclosed at all."""
        pending = [self.whole]
        while len(pending) < FIRST and cut:
            pending = [half for box in pending for half in halves(box, widest(box, self.whole, cut))]
        return pending

    def at_corners(self, cell: Sequence[arb], of: Callable[[Sequence[arb]], float]) -> float:
        """The largest value over the inputs of a cell, of a convex function of what is affine in them."""
        first, m = self.n, self.m
        corners = product(*((ball.lower(), ball.upper()) for ball in cell[first : first + m]))
        return max(of([*cell[:first], *corner, *cell[first + m :]]) for corner in corners)

    def balls(self, box: Box) -> list[arb]:
        """Of all signals; algebraic states from their equations, or from their domain where premises depend on them."""
        is_open = [self.q <= k < self.n and not self._by_domain for k in range(len(box))]
        cell = [arb(0) if wide else arb(low).union(arb(high)) for (low, high), wide in zip(box, is_open, strict=True)]
        if not any(is_open):
            return cell
        z = program_values(self.artifact.model.premises.code, signal=cell)
        q, n, m = self.q, self.n, self.m
        A, B = at(self.artifact.model.A, z), at(self.artifact.model.B, z)
        x, u = arb_mat(q, 1, cell[:q]), arb_mat(m, 1, cell[n : n + m])
        rest = part(A, q, n, 0, q) * x + part(B, q, n, 0, m) * u
        solved = part(A, q, n, q, n).solve(-rest)
        return [solved[k - q, 0] if wide else ball for k, (ball, wide) in enumerate(zip(cell, is_open, strict=True))]

    @cached_property
    def used(self) -> list[int]:
        """Signals that premises and slopes depend on, but for inputs and algebraic states that follow from others."""
        programs = [self.artifact.model.premises, *self.artifact.plant.jacobian]
        read = {step[1] for program in programs for step in program.code if step[0] == "signal"}
        followed = range(self.n if self._by_domain else self.q, self.n + self.m)
        candidates = [k for k in sorted(read) if k < len(self.artifact.signals) and k not in followed]
        return [k for k in candidates if self.whole[k][0] < self.whole[k][1] < math.inf]

    @cached_property
    def whole(self) -> Box:
        """Intervals of all signals in the region."""
        intervals = []
        for k, signal in enumerate(self.artifact.signals):
            low = -math.inf if signal.low is None else signal.low
            high = math.inf if signal.high is None else signal.high
            if k < self.q:
                low, high = max(low, -self._reach[k]), min(high, self._reach[k])
            elif signal.role == "input":
                reach = min(bound_of(signal), self._input_reach(k - self.n))
                low, high = -reach, reach
            intervals.append((low, high))
        return tuple(intervals)

    @cached_property
    def _by_domain(self) -> bool:
        """Whether premises depend on algebraic states, which then are where their domain says.

        Raises:
            ArithmeticError: one has no domain, or moves with the input, which between samples is not that of the law.
        """
        scheduled = {step[1] for step in self.artifact.model.premises.code if step[0] == "signal"}
        own = scheduled & set(range(self.q, self.n))
        for k in own:
            name = self.artifact.signals[k].name
            if self.artifact.signals[k].low is None or self.artifact.signals[k].high is None:
                raise ArithmeticError(f"the premises depend on the algebraic state {name}, which has no domain")
            rows = [self.artifact.model.B.constant, *self.artifact.model.B.coefficients]
            if any(any(map(any, matrix[self.q :])) for matrix in rows):
                raise ArithmeticError(f"the premises depend on the algebraic state {name}, which moves with the input")
        return bool(own)

    def _input_reach(self, k: int) -> float:
        """What the gains can ask of an input in the region."""
        table = self.artifact.law.gain
        centre, total = np.array(table.at_centre())[k], 0.0
        for block in table.blocks:
            gains = np.array(block.vertices)[:, k]
            total += float(np.linalg.norm((gains - centre) @ self._factor, axis=1).max()) / len(table.blocks)
        return (float(np.linalg.norm(centre @ self._factor)) + total) * (1.0 + 1e-9)

    def is_outside(self, box: Box) -> bool:
        """Whether no state of the region lies in a box of some of its coordinates."""
        own, root = self._projection
        if not own:
            return False
        middle = np.array([0.5 * (box[k][0] + box[k][1]) for k in own])
        half = np.array([0.5 * (box[k][1] - box[k][0]) for k in own])
        nearest = np.maximum(np.abs(root @ middle) - np.abs(root) @ half, 0.0)
        return float(np.linalg.norm(nearest)) > 1.0 + 1e-6

    @cached_property
    def _projection(self) -> tuple[list[int], np.ndarray[tuple[int, ...], np.dtype[np.float64]]]:
        """The differential states that are cut, and the inverse root of the region's projection on them."""
        own = [k for k in self.used if k < self.q]
        P = np.array(self.artifact.region.lyapunov)[np.ix_(own, own)]
        return own, np.linalg.inv(np.linalg.cholesky(P)) if own else P


def widest(box: Box, whole: Box, cut: Sequence[int]) -> int:
    """The signal along which a cell is widest, relative to the region."""
    return max(cut, key=lambda k: (box[k][1] - box[k][0]) / (whole[k][1] - whole[k][0]))


def halves(box: Box, k: int) -> tuple[Box, Box]:
    """A cell cut in the middle of one of its signals."""
    low, high = box[k]
    middle = 0.5 * (low + high)
    return tuple((*box[:k], half, *box[k + 1 :]) for half in ((low, middle), (middle, high)))  # type: ignore[return-value]
