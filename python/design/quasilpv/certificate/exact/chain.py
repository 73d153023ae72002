"""One small matrix inequality per joint proves a form in the speeds of a chain of bodies positive in every posture.

The difference of two inertia matrices of one robot, ``c M_n(q) - M_t(q)`` say, is the form

    sum_k v_k' D_k v_k + d_k w_k^2,    v_k = X_k(q_k) v_(k-1) + S_k w_k,    v_0 = 0

in the joint speeds w: v_k the twist of body k, D_k and d_k the differences of the inertias of its bodies and rotors. It
is positive for all w /= 0 if there are *storages*, a scalar z_1 and symmetric 6 x 6 matrices Z_2 .. Z_(n-1), with
Z_n = 0 and, for every coordinate q_k in joint k's own interval,

    k = 1:  S_1' D_1 S_1 + z_1 + d_1 > 0
    k = 2:  T' (D_2 + Z_2) T + diag(-z_1, d_2) > 0,            T = [X_2(q_2) S_1, S_2]    (6 x 2)
    k > 2:  T' (D_k + Z_k) T + blkdiag(-Z_(k-1), d_k) > 0,     T = [X_k(q_k), S_k]        (6 x 7)

because the storages cancel in the sum over k. (For n = 1 and n = 2 the last one has no storage.) No inequality knows
more than one coordinate: the effort grows linearly with the number of joints, and postures are never listed.

**One coordinate is decided without sampling.** With ``q = m pi + 2 atan t``, |t| <= 1, sine and cosine are rational in
t, and the inequality times ``(1 + t^2)^2`` is a matrix polynomial of degree 4 in t with rational coefficients; that of
a prismatic joint has degree 2 in q itself. It is positive definite on [a, b] if its Bernstein coefficients there are;
if they are not, [a, b] is halved. Ends of intervals are rounded outwards, in ball arithmetic; nothing else is rounded:
what is proved is the statement about the numbers of the model as they are.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import atan, comb, isfinite, pi

import numpy as np
from flint import arb, ctx, fmpq, fmpq_mat

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.matrices import identity, is_positive_definite, matrix, rational, stack, zero
from quasilpv.certificate.exact.rationals import to_float, to_floats

Polynomial = tuple[fmpq_mat, ...]
"""Matrix coefficients of the powers of one variable."""

END_BITS = 40
"""Ends of intervals are rounded outwards to multiples of 2^-END_BITS."""

SMALLEST_CELL = fmpq(1, 1 << 20)
"""An inequality undecided on a cell this narrow is given up: it is violated there, or positive by too little."""


@dataclass(frozen=True)
class ChainJoint:
    """How one frame moves in the frame before, exactly.

    Attributes:
        turns: rotation about the axis, or translation along it.
        rotation, translation: of the joint's frame at coordinate 0 in the frame before: rows of R, and t.
        axis: unit vector in the joint's frame.
        lower, upper: limits of the coordinate, rad or m; infinite limits of a rotation are a full circle.
    """

    turns: bool
    rotation: Sequence[Sequence[float]]
    translation: Sequence[float]
    axis: Sequence[float]
    lower: float
    upper: float

    @property
    def twist(self) -> fmpq_mat:
        """S, 6 x 1."""
        none = [0.0, 0.0, 0.0]
        return matrix([[x] for x in ([*none, *self.axis] if self.turns else [*self.axis, *none])])

    def charts(self) -> Iterator[Chart]:
        """X as polynomials over intervals that cover all coordinates."""
        fixed = _motion(matrix(self.rotation).transpose(), _cross(self.translation))
        K = _cross(self.axis)
        if not self.turns:
            sliding = stack([[zero(3, 3), K * fmpq(-1)], [zero(3, 3), zero(3, 3)]])
            yield Chart((fixed, sliding * fixed), (fmpq(1),), rational(self.lower), rational(self.upper))
            return
        for half_turns, low, high in _half_circles(self.lower, self.upper):
            sign = fmpq(1 if half_turns % 2 == 0 else -1)
            one, K2 = identity(3), K * K
            # (1 + t^2) (I - sin q K + (1 - cos q) K^2), with sin q = sign 2 t / (1 + t^2) and cos q likewise
            turned = (one + K2 * (1 - sign), K * (-2 * sign), one + K2 * (1 + sign))
            X = tuple(block_diagonal(R, R) * fixed for R in turned)
            yield Chart(X, (fmpq(1), fmpq(0), fmpq(1)), low, high, half_turns)


@dataclass(frozen=True)
class Chart:
    """Coordinates in an interval by one variable t, in which ``weight(t) X(q(t))`` is a polynomial.

    Attributes:
        motion: that polynomial.
        weight: 1 + t^2, or 1; by its coefficients.
        low, high: the interval of t.
        half_turns: m with ``q = m pi + 2 atan t``; None where q = t.
    """

    motion: Polynomial
    weight: tuple[fmpq, ...]
    low: fmpq
    high: fmpq
    half_turns: int | None = None

    @classmethod
    def point(cls) -> Chart:
        """For an inequality without a coordinate."""
        return cls((), (fmpq(1),), fmpq(0), fmpq(0))

    def coordinate(self, t: fmpq) -> float:
        """q, in double."""
        value = to_float(t)
        return value if self.half_turns is None else self.half_turns * pi + 2.0 * atan(value)

    @property
    def turning(self) -> Polynomial:
        """``weight(t) dX/dq`` as a polynomial."""
        if self.half_turns is None:
            return self.motion[1:]
        P0, P1, P2 = self.motion  # dq/dt = 2 / (1 + t^2); the power t^3 cancels
        return P1 / 2, P2 - P0, P1 / -2

    def inequality(self, before: fmpq_mat, twist: fmpq_mat, stored: fmpq_mat, constant: fmpq_mat) -> Polynomial:
        """``weight^2 (T' stored T + constant)`` with ``T = [X before, twist]``."""
        columns = [X * before for X in self.motion]
        none = zero(6, columns[0].ncols())
        T = [
            stack([[columns[i] if i < len(columns) else none, twist * (self.weight[i] if i < len(self.weight) else 0)]])
            for i in range(max(len(columns), len(self.weight)))
        ]
        return self.congruence(T, stored, constant)

    def congruence(self, T: Sequence[fmpq_mat], stored: fmpq_mat, constant: fmpq_mat) -> Polynomial:
        """``weight^2 (T' stored T + constant)``, given ``weight T`` by its coefficients."""
        size = T[0].ncols()
        total = [zero(size, size) for _ in range(2 * len(T) - 1)]
        for i, left in enumerate(T):
            half = left.transpose() * stored
            for j, right in enumerate(T):
                total[i + j] += half * right
        for i, one in enumerate(self.weight):
            for j, other in enumerate(self.weight):
                total[i + j] += constant * (one * other)
        return tuple(total)


@dataclass(frozen=True)
class ChainForm:
    """A form in the speeds of a chain: D_k and d_k of every body.

    Attributes:
        bodies: for every body its matrices D_k, 6 x 6, one or several: the form is meant for each choice of them, and
            so for every convex combination.
        rotors: d_k.
    """

    bodies: Sequence[Sequence[fmpq_mat]]
    rotors: Sequence[fmpq]


@dataclass(frozen=True)
class ChainProof:
    """What became of the inequalities.

    Attributes:
        holds: all were proved.
        cells: intervals that were needed.
        failed_joint: the first (from 1) whose inequality is violated or was not proved; None if all hold.
        failed_at: a coordinate where it is violated or undecided, in rad or m.
    """

    holds: bool
    cells: int
    failed_joint: int | None = None
    failed_at: float | None = None


def prove_chain(joints: Sequence[ChainJoint], form: ChainForm, storages: Sequence[fmpq_mat]) -> ChainProof:
    """Decide the inequalities of a chain exactly.

    Args:
        joints: base to tip, n of them.
        form: the bodies' and rotors' part of the form.
        storages: z_1 as a 1 x 1 matrix, Z_2 .. Z_(n-1), n - 1 matrices; symmetric, or the proof fails.

    Raises:
        ValueError: there are not n bodies, n rotors and n - 1 storages.
    """
    n = len(joints)
    if len(form.bodies) != n or len(form.rotors) != n or len(storages) != n - 1:
        raise ValueError("prove_chain: joints, bodies, rotors and storages do not belong together")
    return prove_joints(_inequalities(k, joints, form, storages) for k in range(n))


def prove_joints(inequalities: Iterable[Iterable[tuple[Polynomial, Chart]]]) -> ChainProof:
    """Decide the inequalities of each joint in turn, base to tip, up to the first that is not proved."""
    cells = 0
    for joint, charted in enumerate(inequalities, start=1):
        for entry, chart in charted:
            outcome = positive_on(entry, chart.low, chart.high)
            if not isinstance(outcome, int):
                return ChainProof(False, cells, joint, chart.coordinate(outcome))
            cells += outcome
    return ChainProof(True, cells)


def _inequalities(
    k: int, joints: Sequence[ChainJoint], form: ChainForm, storages: Sequence[fmpq_mat]
) -> Iterator[tuple[Polynomial, Chart]]:
    """The inequality of joint k (from 0) for every choice of its body, chart by chart, as a polynomial in t."""
    twist, rotor = joints[k].twist, fmpq_mat(1, 1, [form.rotors[k]])
    if k == 0:
        ahead = storages[0] if storages else zero(1, 1)
        for D in form.bodies[0]:
            yield (twist.transpose() * D * twist + ahead + rotor,), Chart.point()
        return
    before = joints[0].twist if k == 1 else identity(6)
    constant = block_diagonal(storages[k - 1] * fmpq(-1), rotor)
    for D in form.bodies[k]:
        stored = D + storages[k] if k < len(storages) else D
        for chart in joints[k].charts():
            yield chart.inequality(before, twist, stored, constant), chart


def positive_on(entry: Polynomial, low: fmpq, high: fmpq) -> int | fmpq:
    """In how many cells a matrix polynomial was proved positive definite on [low, high]; or a point where it was not.

    Doubles decide which cells are put to the exact test, and are believed where they say that it is not positive.
    """
    floats = np.array([to_floats(G) for G in entry])
    scale = 1.0 / np.sqrt(np.maximum(np.abs(floats).sum(axis=0).diagonal(), 1e-300))
    floats = floats * scale * scale[:, None]
    cells, waiting = 0, [(low, high)]
    while waiting:
        a, b = waiting.pop()
        guide = np.linalg.eigvalsh(_bernstein_floats(floats, float(a.p) / float(a.q), float(b.p) / float(b.q)))[:, 0]
        for end, value in ((a, guide[0]), (b, guide[-1])):
            if value <= 0.0:
                return end
        if guide.min() > 0.0 and all(is_positive_definite(B) for B in bernstein(entry, a, b)):
            cells += 1
        elif b - a <= SMALLEST_CELL:
            return a
        else:
            middle = (a + b) / 2
            waiting += [(middle, b), (a, middle)]
    return cells


def bernstein(entry: Polynomial, low: fmpq, high: fmpq) -> list[fmpq_mat]:
    """Bernstein coefficients of a matrix polynomial on an interval: on it, it is a mean of them with weights >= 0."""
    degree, width = len(entry) - 1, high - low
    shifted = [
        sum((entry[i] * (comb(i, j) * low ** (i - j)) for i in range(j, degree + 1)), entry[0] * 0) * width**j
        for j in range(degree + 1)
    ]
    return [
        sum((shifted[j] * fmpq(comb(i, j), comb(degree, j)) for j in range(i + 1)), entry[0] * 0)
        for i in range(degree + 1)
    ]


def _bernstein_floats(entry: FloatArray, low: float, high: float) -> FloatArray:
    """The same in doubles, (degree + 1, size, size)."""
    degree, width = len(entry) - 1, high - low
    change = np.zeros((degree + 1, degree + 1))
    for i in range(degree + 1):
        for j in range(i + 1):
            share = comb(i, j) / comb(degree, j) * width**j
            for m in range(j, degree + 1):
                change[i, m] += share * comb(m, j) * low ** (m - j)
    return np.asarray(np.einsum("im,mab->iab", change, entry))


def _half_circles(lower: float, upper: float) -> Iterator[tuple[int, fmpq, fmpq]]:
    """m and the interval of ``t = tan((q - m pi) / 2)``, for the half circles around m pi that [lower, upper] meets."""
    if upper - lower >= 2.0 * pi or not (isfinite(lower) and isfinite(upper)):
        yield from ((m, fmpq(-1), fmpq(1)) for m in (0, 1))
        return
    # One half circle more on either side costs nothing: an interval that is not met is empty.
    for m in range(round(lower / pi) - 1, round(upper / pi) + 2):
        low, high = _half_tangent(lower, m, outwards=-1), _half_tangent(upper, m, outwards=1)
        if low < 1 and high > -1 and low < high:
            yield m, max(low, fmpq(-1)), min(high, fmpq(1))


def _half_tangent(angle: float, half_turns: int, *, outwards: int) -> fmpq:
    """``tan((angle - m pi) / 2)`` rounded outwards; -2 or 2 for angles beyond the half circle."""
    with ctx.workprec(128):
        turned = (arb(angle) - half_turns * arb.pi()) / 2
        if abs(float(turned)) > 1.0:  # beyond pi/4 by far: outside of [-1, 1]
            return fmpq(2 if float(turned) > 0 else -2)
        scaled = turned.tan() * (1 << END_BITS)
        end = scaled.floor() - 1 if outwards < 0 else scaled.ceil() + 1
        return fmpq(int(float(end)), 1 << END_BITS)


def _motion(Rt: fmpq_mat, translation: fmpq_mat) -> fmpq_mat:
    """X of a placement: from the transposed rotation and ``[t]``."""
    return stack([[Rt, Rt * translation * fmpq(-1)], [zero(3, 3), Rt]])


def _cross(vector: Sequence[float]) -> fmpq_mat:
    """``[a]`` with ``[a] b = a x b``."""
    x, y, z = vector
    return matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def block_diagonal(first: fmpq_mat, second: fmpq_mat) -> fmpq_mat:
    """One matrix beside the other."""
    rows, columns = first.nrows(), second.ncols()
    return stack([[first, zero(rows, columns)], [zero(second.nrows(), first.ncols()), second]])
