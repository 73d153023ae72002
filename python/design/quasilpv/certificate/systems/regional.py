"""The claims of a `regional-feedback`: a region that no solution leaves, inside which every bound holds.

With the shipped gains K_j and the shipped P (`quasilpv.documents.system_artifact`), in units that are powers of two:

* **decay**: ``sum_ij w_i w_j He((A_e,i + alpha E_o) P_e + B_e,i [K_j P 0]) < 0`` over the vertices of the premise box,
  ``P_e = [P 0; W Z]``: along solutions in the box ``V = x_d' P^-1 x_d`` has ``V' <= -2 alpha V``, and the algebraic
  equations can be solved for their states.
* **states, inputs, algebraic states, speed**: at the vertices, the inequalities that keep ``V <= 1`` inside the domain
  and the limits.
* **L2 gain**, if the design is for one: ``V' + z'z/g - g w'w < 0``, without the sampling.
* **premise box**: the premises stay in the box over which all this was decided while the differential states are in the
  region, the algebraic ones in their domain and the parameters in their intervals, in ball arithmetic.
* **plant**: the residual that is simulated is ``E(z) x' - A(z) x - B(z) u`` at random points (sampled).

What is assumed is stated by the artifact: parameters stay in their intervals (and may change at any speed), and an
algebraic state is where the domain says when the run begins. Written from the mathematics, without the design's rooms.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf
from typing import NamedTuple

import numpy as np
from flint import fmpq, fmpq_mat

from quasilpv.certificate.exact.claims import Claim
from quasilpv.certificate.exact.double_sum import double_sum, he
from quasilpv.certificate.exact.matrices import diagonal, matrix, rational, stack, symmetric, zero
from quasilpv.certificate.exact.program_ranges import outputs_of, range_claim
from quasilpv.certificate.exact.program_values import program_values
from quasilpv.certificate.exact.vertex_tables import VertexTable
from quasilpv.documents.strict_model import FieldError
from quasilpv.documents.system_artifact import (
    BALANCE,
    DISTURBANCE,
    L2_GAIN,
    PERFORMANCE,
    AffineDocument,
    Signal,
    SystemArtifactDocument,
)

UNITS = "units"
POINTS = 64
ROUNDING = 1e-9
_SEED = 2022


def regional_claims(artifact: SystemArtifactDocument) -> Iterator[Claim]:
    """Decide everything the artifact claims.

    Raises:
        FieldError: the witness lacks a matrix, or one has another shape than it needs.
    """
    own = _Claims(artifact)
    yield Claim.positive("region: P > 0", own.P)
    yield from own.decay()
    yield from own.states()
    yield from own.inputs()
    if artifact.region.speed_per_s is not None:
        yield from own.speed(rational(artifact.region.speed_per_s))
    if L2_GAIN in artifact.witness:
        yield from own.l2_gain()
    yield from own.premises()
    yield from VertexTable.of(artifact.law.gain).collapse_claim("gain")
    yield plant_claim(artifact)


def bound_of(signal: Signal) -> float:
    """Largest magnitude of a deviation that lies between its bounds on both sides; infinite without bounds."""
    low = inf if signal.low is None else -signal.low
    high = inf if signal.high is None else signal.high
    return min(low, high)


class Units(NamedTuple):
    """Factors of states, inputs and equations, and of time: old units in a new one."""

    states: tuple[fmpq, ...]
    inputs: tuple[fmpq, ...]
    equations: tuple[fmpq, ...]
    time: fmpq


@dataclass(frozen=True, eq=False)
class _Claims:
    """The matrices of an artifact, exactly, in the units of its witness."""

    artifact: SystemArtifactDocument

    @property
    def n(self) -> int:
        return len(self.artifact.states)

    @property
    def q(self) -> int:
        return self.artifact.model.differential

    @cached_property
    def units(self) -> Units:
        """In which the witness is written."""
        rows = self.artifact.witness.get(UNITS, ())
        sizes = (self.n, len(self.artifact.inputs), self.n, 1)
        if tuple(len(row) for row in rows) != sizes or any(not value > 0.0 for row in rows for value in row):
            raise FieldError("witness.units", len(rows), f"positive factors in rows of {sizes}")
        states, inputs, equations, time = (tuple(map(rational, row)) for row in rows)
        return Units(states, inputs, equations, time[0])

    @property
    def c(self) -> fmpq:
        return self.units.time

    @cached_property
    def alpha(self) -> fmpq:
        return rational(self.artifact.region.decay_rate_per_s) * self.c

    @cached_property
    def P(self) -> fmpq_mat:
        inverse = diagonal([1 / t for t in self.units.states[: self.q]])
        return inverse * matrix(self.artifact.region.lyapunov) * inverse

    @cached_property
    def table(self) -> VertexTable:
        return VertexTable.of(self.artifact.law.gain)

    @cached_property
    def offsets(self) -> list[list[fmpq]]:
        """Where the vertices lie: ``z_c + G (corner - z_c)`` in the premises of their block, z_c in the others."""
        table, count = self.table, len(self.table.blocks)
        centre = [rational(value) for value in table.centre]
        vertices = []
        for block in table.blocks:
            for corner in range(2 ** len(block)):
                point = list(centre)
                for place, p in enumerate(block):
                    upper = corner >> (len(block) - 1 - place) & 1
                    bound = rational(table.upper[p] if upper else table.lower[p])
                    point[p] = centre[p] + count * (bound - centre[p])
                vertices.append(point)
        return vertices

    def _vertices(self, affine: AffineDocument, columns: Sequence[fmpq], factor: fmpq) -> list[fmpq_mat]:
        left, right = diagonal([factor * d for d in self.units.equations]), diagonal(columns)
        constant, slopes = matrix(affine.constant), [matrix(slope) for slope in affine.coefficients]
        return [
            left * sum((z * slope for z, slope in zip(point, slopes, strict=True)), constant) * right
            for point in self.offsets
        ]

    @cached_property
    def E(self) -> list[fmpq_mat]:
        return self._vertices(self.artifact.model.E, self.units.states, 1 / self.c)

    @cached_property
    def A(self) -> list[fmpq_mat]:
        return self._vertices(self.artifact.model.A, self.units.states, fmpq(1))

    @cached_property
    def B(self) -> list[fmpq_mat]:
        return self._vertices(self.artifact.model.B, self.units.inputs, fmpq(1))

    @cached_property
    def M(self) -> list[fmpq_mat]:
        """``K_j P`` of the shipped gains."""
        left = diagonal([1 / s for s in self.units.inputs])
        right = diagonal(self.units.states[: self.q])
        return [left * K * right * self.P for K in self.table.vertices()]

    def witness(self, name: str, rows: int, columns: int) -> fmpq_mat:
        found = self.artifact.witness.get(name, ())
        if len(found) != rows or any(len(row) != columns for row in found):
            raise FieldError(f"witness.{name}", f"{len(found)} rows", f"a {rows} x {columns} matrix")
        return matrix(found)

    def _negative(self, name: str, title: str, entry: Callable[[int, int], fmpq_mat], size: int) -> Iterator[Claim]:
        """``sum_ij w_i w_j X_ij < 0``, X_ij symmetric, with slack of zero weighted mean; one sum if B is constant."""
        blocks = [b for b, block in enumerate(self.table.blocks) for _ in range(2 ** len(block))]
        count, groups = len(blocks), len(self.table.blocks)
        single = not any(any(map(any, slope)) for slope in self.artifact.model.B.coefficients)
        places = 0 if groups == 1 else (1 if single else 2)
        slack = [
            [self._slack(f"{name} slack {place * groups + b}", size) for b in range(groups)] for place in range(places)
        ]
        means = [sum(own[1:], own[0]) / groups for own in slack]

        def shifted(i: int, j: int) -> fmpq_mat:
            total = entry(i, j)
            for own, mean, index in zip(slack, means, (i, j), strict=False):
                total = total + own[blocks[index]] - mean
            return total

        if single:
            yield from (Claim.positive(f"{title} {i}", -shifted(i, i)) for i in range(count))
        else:
            yield from double_sum(title, shifted, count)

    def _slack(self, name: str, size: int) -> fmpq_mat:
        found = self.witness(name, size, size)
        return (found + found.transpose()) / 2

    def decay(self) -> Iterator[Claim]:
        """See the module."""
        q, n, P = self.q, self.n, self.P
        W, Z = self.witness("W", n, q), self.witness("Z", n, n)

        def entry(i: int, j: int) -> fmpq_mat:
            E, A = self.E[i], self.A[i]
            lower = _columns(A, 0, q) * P + _extended(E, A, q) * stack([[W]]) + self.B[i] * self.M[j]
            upper = self.alpha * P + _rows(W, 0, q)
            return he(stack([[upper, _rows(Z, 0, q)], [lower, _extended(E, A, q) * Z]])) / 2

        yield from self._negative("decay", "decay", entry, q + n)

    def states(self) -> Iterator[Claim]:
        """``|x_k| < b_k`` in the region, of the states with bounds."""
        for k, signal in enumerate(self.artifact.states):
            bound = bound_of(signal)
            if bound == inf:
                continue
            if k < self.q:
                limit = (rational(bound) / self.units.states[k]) ** 2
                yield Claim.at_most(f"state {signal.name} in its domain", self.P[k, k], limit)
            else:
                yield from self._algebraic(signal, k, bound)

    def _algebraic(self, signal: Signal, k: int, bound: float) -> Iterator[Claim]:
        q, a = self.q, self.n - self.q
        number = k - q
        Y, Z = self.witness(f"Y {number}", a, q), self.witness(f"Z2 {number}", a, a)
        chosen = matrix([[int(column == number) for column in range(a)]])
        limit = matrix([[(rational(bound) / self.units.states[k]) ** 2]])

        def entry(i: int, j: int) -> fmpq_mat:
            A, B = _rows(self.A[i], q, self.n), _rows(self.B[i], q, self.n)
            A22 = _columns(A, q, self.n)
            rest = _columns(A, 0, q) * self.P + A22 * Y + B * self.M[j]
            upper: list[list[fmpq_mat | None]] = [
                [self.P, -rest.transpose(), (chosen * Y).transpose()],
                [None, -he(A22 * Z), (chosen * Z).transpose()],
                [None, None, limit],
            ]
            return -symmetric(upper)

        yield from self._negative(f"algebraic {number}", f"state {signal.name} in its domain", entry, q + a + 1)

    def inputs(self) -> Iterator[Claim]:
        """``|u_k| < u_max,k`` in the region, of the inputs with limits."""
        for k, signal in enumerate(self.artifact.inputs):
            bound = bound_of(signal)
            if bound < inf:
                limit = matrix([[(rational(bound) / self.units.inputs[k]) ** 2]])

                def entry(_: int, j: int, limit: fmpq_mat = limit, k: int = k) -> fmpq_mat:
                    row = _rows(self.M[j], k, k + 1)
                    return -symmetric([[limit, row], [None, self.P]])

                yield from self._single(f"input {k}", f"input {signal.name} within its limits", entry, self.q + 1)

    def speed(self, bound: fmpq) -> Iterator[Claim]:
        """``|x_d'|_P < b |x_d|_P`` along solutions."""
        n, q, b = self.n, self.q, bound * self.c
        a = n - q
        G = self.witness("G", q, q)
        Y, Z = (self.witness("Y speed", a, q), self.witness("Z2 speed", a, a)) if a else (None, None)

        def entry(i: int, j: int) -> fmpq_mat:
            drift = _columns(self.A[i], 0, q) * self.P + self.B[i] * self.M[j]
            E1, upper = _rows(_columns(self.E[i], 0, q), 0, q), _rows(drift, 0, q)
            if Y is not None:
                upper = upper + _columns(_rows(self.A[i], 0, q), q, n) * Y
            blocks: list[list[fmpq_mat | None]] = [
                [b * self.P, upper.transpose(), zero(q, q)],
                [None, b * he(E1 * G), b * G.transpose()],
                [None, None, b * self.P],
            ]
            if Y is None or Z is None:
                return -symmetric(blocks)
            below = _columns(_rows(self.A[i], q, n), q, n)
            rest = _rows(drift, q, n) + below * Y
            across = _columns(_rows(self.A[i], 0, q), q, n) * Z
            last = [-rest.transpose(), across, zero(q, a)]
            wide = [[*row, column] for row, column in zip(blocks, last, strict=True)]
            return -symmetric([*wide, [None, None, None, -he(below * Z)]])

        yield from self._negative("speed", "speed of the closed loop", entry, 3 * q + a)

    def l2_gain(self) -> Iterator[Claim]:
        """``int z'z < g^2 int w'w`` from rest: w is added to inputs and rates, z are states and inputs, in sizes."""
        q, n, P = self.q, self.n, self.P
        W, Z = self.witness("W", n, q), self.witness("Z", n, n)
        g, balance = (self.witness(name, 1, 1)[0, 0] for name in (L2_GAIN, BALANCE))
        factors = [*self.units.states, *self.units.inputs]
        m = len(self.artifact.inputs)
        sizes = [balance * self.witness(name, 1, n + m) for name in (DISTURBANCE, PERFORMANCE)]
        added, output = (row.table()[0] for row in sizes)
        w, z = ([k for k in range(n + m) if row[k] > 0] for row in (added, output))
        if not w or not z or any(q <= k < n for k in w):
            raise FieldError("witness.disturbance", len(w), "one of an input or a differential state, and performance")

        def entry(i: int, j: int) -> fmpq_mat:
            A, M = self.A[i], self.M[j]
            lower = _columns(A, 0, q) * P + _extended(self.E[i], A, q) * stack([[W]]) + self.B[i] * M
            top = he(stack([[_rows(W, 0, q), _rows(Z, 0, q)], [lower, _extended(self.E[i], A, q) * Z]]))
            both = [self.E[i] * self.c if k < n else self.B[i] for k in w]
            shares = [added[k] / factors[k] for k in w]
            columns = [
                _columns(X, k % n if k < n else k - n, (k if k < n else k - n) + 1)
                for X, k in zip(both, w, strict=True)
            ]
            rows = [[fmpq(0)] * q + [s * col[r, 0] for r in range(n)] for s, col in zip(shares, columns, strict=True)]
            extended = [self._state_row(k, W, Z) if k < n else _wide(_rows(M, k - n, k - n + 1), n) for k in z]
            seen = [[factors[k] / output[k] * entry for entry in row] for k, row in zip(z, extended, strict=True)]
            return symmetric(
                [
                    [top, matrix(rows).transpose(), matrix(seen).transpose()],
                    [None, -g * diagonal([fmpq(1)] * len(w)), zero(len(w), len(z))],
                    [None, None, -g * diagonal([fmpq(1)] * len(z))],
                ]
            )

        yield from self._negative("l2", f"L2 gain {float(g.p) / float(g.q):.4g}", entry, q + n + len(w) + len(z))

    def _state_row(self, k: int, W: fmpq_mat, Z: fmpq_mat) -> list[fmpq]:
        """The row of ``P_e`` of a state: x_d = [P 0] xi, x_a = the last rows of [W Z] xi."""
        if k < self.q:
            return [*self.P.table()[k], *[fmpq(0)] * self.n]
        return [*W.table()[k], *Z.table()[k]]

    def _single(self, slack: str, title: str, entry: Callable[[int, int], fmpq_mat], size: int) -> Iterator[Claim]:
        blocks = [b for b, block in enumerate(self.table.blocks) for _ in range(2 ** len(block))]
        groups = len(self.table.blocks)
        T = [self._slack(f"{slack} slack {b}", size) for b in range(groups)] if groups > 1 else [zero(size, size)]
        mean = sum(T[1:], T[0]) / len(T)
        for j, b in enumerate(blocks):
            yield Claim.positive(f"{title}, vertex {j}", -(entry(j, j) + T[b if groups > 1 else 0] - mean))

    def premises(self) -> Iterator[Claim]:
        """The premise box, and that the law is scheduled on the same premises as the model."""
        model, law = self.artifact.model, self.artifact.law
        domain = domain_of(self.artifact)
        pieces = outputs_of(model.premises.code)
        schedule = outputs_of(law.schedule.code)
        for p, (code, used) in enumerate(zip(pieces, schedule, strict=True)):
            title = f"premise {model.names[p]} in its box"
            yield range_claim(title, code, domain, (model.lower[p], model.upper[p]))
            told = [tuple(step) for step in used] == [tuple(step) for step in code]
            untold = [tuple(step) for step in used] == [("const", law.gain.centre[p])]
            if not (told or untold):
                raise FieldError("law.schedule", f"another program of premise {model.names[p]}", "that of the model")
            if untold and not told:
                yield self._unscheduled(p)

    def _unscheduled(self, p: int) -> Claim:
        """A gain does not depend on a premise that the law is not told."""
        own = [j for j, point in enumerate(self.offsets) if point[p] != rational(self.table.centre[p])]
        first = self.table.vertices()[own[0]]
        same = all(self.table.vertices()[j] == first for j in own)
        spread = fmpq(0) if same else fmpq(2)
        return Claim.at_most(f"gain independent of {self.artifact.model.names[p]}", spread, fmpq(1))


def domain_of(artifact: SystemArtifactDocument) -> dict[str, list[tuple[float, float]]]:
    """Of every signal the interval in which it is while the region is not left."""
    P, q = artifact.region.lyapunov, artifact.model.differential
    reach = [float(np.nextafter(np.sqrt(P[k][k]) * (1 + 1e-12), inf)) for k in range(q)]
    extents = reach + [inf] * (len(artifact.signals) - q)
    return {"signal": [_interval(signal, extent) for signal, extent in zip(artifact.signals, extents, strict=True)]}


def plant_claim(artifact: SystemArtifactDocument) -> Claim:
    """The plant's residual against the model's, at random points of the domain (sampled)."""
    rng = np.random.default_rng(_SEED)
    extents = [float(np.sqrt(artifact.region.lyapunov[k][k])) for k in range(artifact.model.differential)]
    signals = []
    for k, signal in enumerate(artifact.signals):
        low, high = _interval(signal, extents[k] if k < len(extents) else 1.0)
        signals.append(rng.uniform(low, high, POINTS))
    n, m = len(artifact.states), len(artifact.inputs)
    rates = list(rng.normal(size=(n, POINTS)) * np.abs(np.array(signals[:n])).max(axis=1, keepdims=True))
    residual = np.array(program_values(artifact.plant.residual.code, signal=[*signals, *rates]))
    z = np.array(program_values(artifact.model.premises.code, signal=signals)).reshape(-1, POINTS)
    E, A, B = (X.evaluate(z) for X in (artifact.model.E, artifact.model.A, artifact.model.B))
    x, u, x_dot = np.array(signals[:n]), np.array(signals[n : n + m]), np.array(rates)
    parts = [np.einsum("kij,jk->ik", X, v) for X, v in ((E, x_dot), (-A, x), (-B, u))]
    sizes = [np.einsum("kij,jk->ik", np.abs(X), np.abs(v)) for X, v in ((E, x_dot), (A, x), (B, u))]
    error = np.abs(residual - sum(parts)) / np.maximum(sum(sizes).max(axis=1, keepdims=True), 1e-300)
    return Claim.sampled(f"plant: residual of the model at {POINTS} points (sampled)", float(error.max()), ROUNDING)


def _interval(signal: Signal, extent: float) -> tuple[float, float]:
    low = -inf if signal.low is None else signal.low
    high = inf if signal.high is None else signal.high
    low, high = (max(low, -extent), min(high, extent)) if signal.role != "parameter" else (low, high)
    return (low if low > -inf else -1.0, high if high < inf else 1.0) if signal.role == "input" else (low, high)


def _extended(E: fmpq_mat, A: fmpq_mat, q: int) -> fmpq_mat:
    """``[-E_1 A_12; 0 A_22]``, (n, n)."""
    n = E.nrows()
    left = -_columns(E, 0, q)
    return left if q == n else stack([[left, _columns(A, q, n)]])


def _wide(row: fmpq_mat, n: int) -> list[fmpq]:
    return [*row.table()[0], *[fmpq(0)] * n]


def _rows(full: fmpq_mat, start: int, stop: int) -> fmpq_mat:
    return matrix(full.table()[start:stop])


def _columns(full: fmpq_mat, start: int, stop: int) -> fmpq_mat:
    return matrix([row[start:stop] for row in full.table()])
