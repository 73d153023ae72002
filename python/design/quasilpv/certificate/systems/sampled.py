"""Whether a sampling period keeps a nonlinear system in its region, under the input held between samples.

With x' = f(x, u) of the differential states (algebraic ones eliminated), ``u_k = K(z_k) x_k``,
``f(x, K x) = A_cl(x) x`` and the norm ``|x|_P^2 = x' P^-1 x`` of the region, let over the region, its parameters and
its inputs

    b = sup |A_cl(x)|_P,    J = sup |df/dx (x, u)|_P.

As long as the state stays in the region, ``|x(t) - x_k - t f(x_k, u_k)|_P <= b |x_k|_P (exp(J t) - 1 - J t)/J``, so
that

    g(T) = sup |I + T A_cl|_P + b (exp(J T) - 1 - J T)/J < 1

keeps it there: g is convex, ``g(0) = 1``, so ``g(t) <= 1`` between samples too, and every sample contracts by g(T).
Everything is enclosed in ball arithmetic over cells of the region: this is a proof. It assumes the exact state, no
delay, and parameters that do not change during a sample. (Euler's method with its error bound; Groenwall's lemma.)
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from flint import arb, arb_mat

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.claims import Claim
from quasilpv.certificate.exact.program_values import program_values
from quasilpv.certificate.exact.vertex_tables import VertexTable
from quasilpv.certificate.systems.regional import bound_of
from quasilpv.documents.system_artifact import AffineDocument, SystemArtifactDocument

CELLS = 1500
"""At most as many cells are looked at."""

FIRST = 60
"""So many before those with the largest slopes are divided."""

SETTLED = 0.02
"""Dividing ends when the largest slope is nearer than this to that of its middle, relative."""

BISECTIONS = 40

Box = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class SampledBound:
    """What was found.

    Attributes:
        speed: b, 1/s.
        lipschitz: J, 1/s.
        longest_period_s: a period for which ``g(T) < 1`` in double arithmetic, the longest of a bisection; 0 for none.
        cells: how many were looked at.
    """

    speed: float
    lipschitz: float
    longest_period_s: float
    cells: int


class SampledLoop:
    """The enclosures of one artifact.

    Raises:
        ArithmeticError: the equations cannot be solved for the rates on some cell, as far as the balls can tell, or an
            algebraic state on which the premises depend has no domain or moves with the input.
    """

    def __init__(self, artifact: SystemArtifactDocument, cells: int = CELLS) -> None:
        """Prepare; nothing is enclosed yet."""
        self.artifact, self._most_cells = artifact, cells
        self.q, self.n = artifact.model.differential, len(artifact.states)
        P = np.array(artifact.region.lyapunov)
        factor = np.linalg.cholesky(P)
        self._factor = factor
        self._reach = [math.sqrt(P[k, k]) * (1.0 + 1e-12) for k in range(self.q)]
        self._right = _constant(factor)
        self._left = self._right.inv()

    @cached_property
    def bound(self) -> SampledBound:
        """b and J, and how long a period they allow."""
        lipschitz, leaves, looked_at = self._largest_slope()
        stated = self.artifact.region.speed_per_s
        closed = max(norm(self._in_region(self._closed(self._balls(box)))) for box in leaves)
        speed = closed if stated is None else min(closed, stated)
        low, high = 0.0, 4.0 / speed
        for _ in range(BISECTIONS):
            period = 0.5 * (low + high)
            if float(self._contraction(speed, lipschitz, period).upper()) < 1.0:
                low = period
            else:
                high = period
        return SampledBound(speed, lipschitz, low, looked_at)

    def claim(self, period_s: float) -> Claim:
        """The claim that a period is short enough."""
        total = self._contraction(self.bound.speed, self.bound.lipschitz, period_s)
        upper = float(total.upper())
        title = f"sampling: contraction per {period_s:.6g} s at most {upper:.9f}"
        return Claim.enclosed(title, holds=bool(total.upper() < 1), margin=1.0 - upper)

    def _contraction(self, speed: float, lipschitz: float, period_s: float) -> arb:
        """g(T): by the decay that was proved, ``|I + T A_cl|_P^2 <= 1 - 2 alpha T + b^2 T^2``."""
        T, b, J = arb(period_s), arb(speed), arb(lipschitz)
        linear = (1 - 2 * arb(self.artifact.region.decay_rate_per_s) * T + (b * T) ** 2).sqrt()
        return linear + b * ((J * T).exp() - 1 - J * T) / J

    def _largest_slope(self) -> tuple[float, list[Box], int]:
        """J, the cells it was found on, and how many were looked at; those with large slopes are divided."""
        used = self._used()
        whole = tuple(self._intervals())
        queue: list[tuple[float, int, Box]] = []
        count = 0

        def look(box: Box) -> None:
            nonlocal count
            if not self._is_outside(box, used):
                count += 1
                heapq.heappush(queue, (-self._slope_norm(self._balls(box)), count, box))

        pending = [whole]
        while len(pending) < FIRST and used:  # breadth first: the whole region may be too wide to be enclosed at all
            pending = [half for box in pending for half in _halves(box, _widest(box, whole, used))]
        for box in pending:
            look(box)
        while count < self._most_cells and used:
            largest, _, box = queue[0]
            middle = self._slope_norm(self._balls(tuple((0.5 * (low + high),) * 2 for low, high in box)))
            if -largest <= (1.0 + SETTLED) * middle:
                break
            heapq.heappop(queue)
            for half in _halves(box, _widest(box, whole, used)):
                look(half)
        return -queue[0][0], [box for _, _, box in queue], count

    def _slope_norm(self, cell: Sequence[arb]) -> float:
        """Of ``df/dx`` on a cell: affine in the inputs, so that the corners of what they may be decide."""
        first, m = self.n, len(self.artifact.inputs)
        corners = product(*((ball.lower(), ball.upper()) for ball in cell[first : first + m]))
        points = ([*cell[:first], *corner, *cell[first + m :]] for corner in corners)
        return max(norm(self._in_region(self._slope(point))) for point in points)

    def _in_region(self, matrix: arb_mat) -> arb_mat:
        return self._left * matrix * self._right

    def _balls(self, box: Box) -> list[arb]:
        """Of all signals; algebraic states from their equations, or from their domain where premises depend on them."""
        is_open = [self.q <= k < self.n and not self._by_domain for k in range(len(box))]
        cell = [arb(0) if wide else arb(low).union(arb(high)) for (low, high), wide in zip(box, is_open, strict=True)]
        if not any(is_open):
            return cell
        z = program_values(self.artifact.model.premises.code, signal=cell)
        q, n, m = self.q, self.n, len(self.artifact.inputs)
        A, B = _at(self.artifact.model.A, z), _at(self.artifact.model.B, z)
        x, u = arb_mat(q, 1, cell[:q]), arb_mat(m, 1, cell[n : n + m])
        rest = _part(A, q, n, 0, q) * x + _part(B, q, n, 0, m) * u
        solved = _part(A, q, n, q, n).solve(-rest)
        return [solved[k - q, 0] if wide else ball for k, (ball, wide) in enumerate(zip(cell, is_open, strict=True))]

    def _used(self) -> list[int]:
        """Signals that premises and slopes depend on, but for inputs and algebraic states that follow from others."""
        programs = [self.artifact.model.premises, *self.artifact.plant.jacobian]
        read = {step[1] for program in programs for step in program.code if step[0] == "signal"}
        followed = range(self.n if self._by_domain else self.q, self.n + len(self.artifact.inputs))
        intervals = self._intervals()
        candidates = [k for k in sorted(read) if k < len(self.artifact.signals) and k not in followed]
        return [k for k in candidates if intervals[k][0] < intervals[k][1] < math.inf]

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

    def _intervals(self) -> list[tuple[float, float]]:
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
        return intervals

    def _input_reach(self, k: int) -> float:
        """Of an input without limits: what the gains can ask for in the region."""
        table = self.artifact.law.gain
        centre, total = np.array(table.at_centre())[k], 0.0
        for block in table.blocks:
            gains = np.array(block.vertices)[:, k]
            total += float(np.linalg.norm((gains - centre) @ self._factor, axis=1).max()) / len(table.blocks)
        return (float(np.linalg.norm(centre @ self._factor)) + total) * (1.0 + 1e-9)

    def _is_outside(self, box: Box, used: Sequence[int]) -> bool:
        """Whether no state of the region lies in a box of some of its coordinates."""
        own = [k for k in used if k < self.q]
        if not own:
            return False
        P = np.array(self.artifact.region.lyapunov)[np.ix_(own, own)]
        root = np.linalg.inv(np.linalg.cholesky(P))
        middle = np.array([0.5 * (box[k][0] + box[k][1]) for k in own])
        half = np.array([0.5 * (box[k][1] - box[k][0]) for k in own])
        nearest = np.maximum(np.abs(root @ middle) - np.abs(root) @ half, 0.0)
        return float(np.linalg.norm(nearest)) > 1.0 + 1e-6

    def _closed(self, cell: list[arb]) -> arb_mat:
        """A_cl."""
        model, table = self.artifact.model, VertexTable.of(self.artifact.law.gain)
        z = program_values(model.premises.code, signal=cell)
        told = program_values(self.artifact.law.schedule.code, signal=cell)
        E, A, B = (_at(X, z) for X in (model.E, model.A, model.B))
        K = arb_mat(len(self.artifact.inputs), self.q)
        for factors, coefficient in table.monomials().items():
            K = K + _exact(coefficient) * math.prod((told[p] for p in factors), start=arb(1))
        return _eliminated(E, A, B * K, self.q)

    def _slope(self, cell: list[arb]) -> arb_mat:
        """df/dx."""
        n, q = self.n, self.q
        still = [arb(0)] * n
        rest = program_values(self.artifact.plant.residual.code, signal=[*cell, *still])
        rows = [program_values(row.code, signal=[*cell, *still]) for row in self.artifact.plant.jacobian]
        inertia = arb_mat(q, q, [rows[i][j] for i in range(q) for j in range(q)])
        speeds = inertia.solve(arb_mat(q, 1, [-rest[i] for i in range(q)]))
        rates = [speeds[i, 0] for i in range(q)] + [arb(0)] * (n - q)
        rows = [program_values(row.code, signal=[*cell, *rates]) for row in self.artifact.plant.jacobian]
        E = arb_mat(n, n, [rows[i][j] for i in range(n) for j in range(n)])
        A = arb_mat(n, n, [-rows[i][n + j] for i in range(n) for j in range(n)])
        return _eliminated(E, A, arb_mat(n, q), q)


def _widest(box: Box, whole: Box, used: Sequence[int]) -> int:
    return max(used, key=lambda k: (box[k][1] - box[k][0]) / (whole[k][1] - whole[k][0]))


def _halves(box: Box, k: int) -> tuple[Box, Box]:
    low, high = box[k]
    middle = 0.5 * (low + high)
    return tuple((*box[:k], half, *box[k + 1 :]) for half in ((low, middle), (middle, high)))  # type: ignore[return-value]


def _eliminated(E: arb_mat, A: arb_mat, feedback: arb_mat, q: int) -> arb_mat:
    """``E_1^-1 (A_11 + F_1 - A_12 A_22^-1 (A_21 + F_2))``, (q, q), F the feedback on the differential states."""
    n = A.nrows()
    upper, lower = _part(A, 0, q, 0, q) + _part(feedback, 0, q, 0, q), None
    if q < n:
        lower = _part(A, q, n, 0, q) + _part(feedback, q, n, 0, q)
        upper = upper - _part(A, 0, q, q, n) * _part(A, q, n, q, n).solve(lower)
    return _part(E, 0, q, 0, q).solve(upper)


def norm(matrix: arb_mat) -> float:
    """A number that no singular value of any matrix in the balls exceeds, proved by ``s^2 I - M' M > 0``."""
    middle, radius = _split(matrix)
    guess = (float(np.linalg.norm(middle, 2)) + float(np.linalg.norm(radius))) * (1.0 + 1e-9) + 1e-300
    size = matrix.ncols()
    for _ in range(60):
        square = matrix.transpose() * matrix
        rest = [[arb(guess) ** 2 * int(i == j) - square[i, j] for j in range(size)] for i in range(size)]
        if _is_positive_definite(rest):
            return guess
        guess *= 1.02
    raise ArithmeticError("no bound of a norm was found: the cells are too wide")


def _is_positive_definite(rows: list[list[arb]]) -> bool:
    """Cholesky's elimination in balls: every pivot is positive for every symmetric matrix in them."""
    size = len(rows)
    work = [list(row) for row in rows]
    for k in range(size):
        pivot = work[k][k]
        if not pivot > 0:
            return False
        for i in range(k + 1, size):
            for j in range(i, size):
                work[i][j] = work[i][j] - work[k][i] * work[k][j] / pivot
    return True


def _split(matrix: arb_mat) -> tuple[FloatArray, FloatArray]:
    """Middles and radii, in doubles."""
    shape = matrix.nrows(), matrix.ncols()
    entries = [entry for row in matrix.table() for entry in row]
    middle = np.array([float(entry.mid()) for entry in entries]).reshape(shape)
    return middle, np.array([float(entry.rad()) for entry in entries]).reshape(shape)


def _constant(values: FloatArray) -> arb_mat:
    rows, columns = values.shape
    return arb_mat(rows, columns, [arb(float(value)) for value in values.ravel()])


def _exact(matrix: object) -> arb_mat:
    rows = matrix.table()  # type: ignore[attr-defined]
    return arb_mat(len(rows), len(rows[0]), [arb(entry) for row in rows for entry in row])


def _at(affine: AffineDocument, z: Sequence[arb]) -> arb_mat:
    total = _constant(np.array(affine.constant))
    for value, slope in zip(z, affine.coefficients, strict=True):
        total = total + _constant(np.array(slope)) * value
    return total


def _part(matrix: arb_mat, top: int, bottom: int, left: int, right: int) -> arb_mat:
    table = matrix.table()
    return arb_mat(bottom - top, right - left, [table[i][j] for i in range(top, bottom) for j in range(left, right)])
