"""Units in which a descriptor system is easy on a solver: a verdict must not depend on those its author chose.

Linear matrix inequalities are the same statement in all units (`Units`); a solver in double arithmetic is not the same
solver. The exponents of `Units` (t of the states, s of the inputs, d of the equations, tau of time; logarithms to base
2) bring the largest magnitudes over the box of premises near one:

    min  sum rho(log|E_ij| + d_i + t_j - tau) + sum rho(log|A_ij| + d_i + t_j) + sum rho(log|B_ij| + d_i + s_j),

``rho(r) = r^2`` for r > 0 and ``16 log(1 + (r/4)^2)`` for r < 0: a large entry must come down, a small one may stay
small. Changes of units lie in the range of this fit, so that the rescaled system does not depend on the units it came
in, up to the rounding of exponents to whole numbers.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from quasilpv.arrays import FloatArray
from quasilpv.polytopes.units import Units
from quasilpv.systems.descriptor.affine_system import SystemMatrices
from quasilpv.systems.descriptor.premise import AffineMatrix
from quasilpv.systems.descriptor.system import DescriptorSystem

SMALL = 4.0
"""Binary orders below one from which on the robust penalty lets go of an entry."""

ROUNDS = 40
"""Of iteratively reweighted least squares."""

WIDTH_WEIGHT = 3.0
"""Of the half-widths of the domain in the first fit."""


NEAR = 2
"""Systems whose entries differ by at most so many binary orders are the same to a solver."""

STILL = 1e-3
"""The fit ends when no exponent moves by more."""

LITTLE = 1e-9
"""Weight of the exponents themselves: states, inputs and equations moved together change nothing."""


def ladder(system: DescriptorSystem) -> Iterator[Units | None]:
    """Units to try, one after the other, those that are near others left out; None for the units it comes in.

    First the robust fit that also knows the half-widths w of the domain (``t_j - t_k = log(w_j / w_k)``), then the
    robust fit alone, then plain least squares; then the same three with states and inputs in the sizes they have in the
    closed loop of a linear quadratic regulator at the centre of the box, the square roots of the diagonal of its
    Gramian. Units in which numbers would leave the range of doubles are left out; where all would, the units it comes
    in are all there is.
    """
    fit, widths = _Fit.of(system), _widths(system)
    seen: list[NDArray[np.int_]] = []

    def is_new(exponents: FloatArray) -> bool:
        """Whether these units can be used and are not near others; remembers them."""
        multiples = fit.multiples(exponents)
        near = any(np.abs(multiples - other).max(initial=0) <= NEAR for other in seen)
        if near or not fit.units(system, exponents).are_exact_for(system):
            return False
        seen.append(multiples)
        return True

    def units(exponents: FloatArray) -> Units | None:
        same = np.abs(fit.multiples(exponents)).max(initial=0) <= NEAR
        return None if same else fit.units(system, exponents)

    fits = []
    for known, robust in ((widths, True), ({}, True), ({}, False))[len(widths) < 2 :]:
        exponents = fit.solved(known, robust=robust)
        if is_new(exponents):
            fits.append(exponents)
            yield units(exponents)
    if not fits:
        yield None
    for one in fits:
        refined = _refined(system, fit, one)
        if refined is not None and is_new(refined):
            yield units(refined)


class _Fit(NamedTuple):
    """The least squares problem: one row per entry of E, A and B that is not identically zero.

    The unknowns are (d, t, s, tau). ``design @ unknowns + logs`` are the logarithms of the rescaled magnitudes.
    """

    design: FloatArray
    logs: FloatArray
    order: int

    @classmethod
    def of(cls, system: DescriptorSystem) -> _Fit:
        n, m = system.order, len(system.inputs)
        rows, logs = [], []
        for matrix, column, time in ((system.E, n, -1.0), (system.A, n, 0.0), (system.B, 2 * n, 0.0)):
            magnitudes = _magnitudes(matrix, system.lower, system.upper)
            for i, j in np.argwhere(magnitudes > 0.0).tolist():
                row = np.zeros(2 * n + m + 1)
                row[i], row[column + j], row[-1] = 1.0, 1.0, time
                rows.append(row)
                logs.append(np.log2(magnitudes[i, j]))
        return cls(np.array(rows).reshape(-1, 2 * n + m + 1), np.array(logs), n)

    @property
    def zero(self) -> FloatArray:
        """The units as they are."""
        return np.zeros(self.design.shape[1])

    def solved(self, widths: dict[int, float], *, robust: bool, given: FloatArray | None = None) -> FloatArray:
        """Exponents (d, t, s, tau), not rounded.

        Args:
            widths: logarithms of half-widths by state, as far as they count.
            robust: the penalty of the module, or squares.
            given: exponents of which all but those of the equations are kept.
        """
        start = self.zero if given is None else np.where(np.arange(len(self.zero)) < self.order, 0.0, given)
        free = slice(None) if given is None else slice(0, self.order)
        design, logs = self.design[:, free], self.logs + self.design @ start
        extra, target = _width_rows(widths, self.order, design.shape[1])
        weights = np.ones(len(logs))
        found = np.full(design.shape[1], np.inf)
        for _ in range(ROUNDS if robust else 1):
            weighted = design.T * weights
            normal = weighted @ design + extra.T @ extra + LITTLE * np.eye(len(found))
            before, found = found, np.linalg.solve(normal, extra.T @ target - weighted @ logs)
            if np.abs(found - before).max(initial=0.0) < STILL:
                break
            residual = logs + design @ found
            weights = np.where(residual > 0.0, 1.0, 1.0 / (1.0 + (residual / SMALL) ** 2))
        exponents = start.copy()
        exponents[free] += found
        return exponents

    def multiples(self, exponents: FloatArray) -> NDArray[np.int_]:
        """By which power of two every entry is multiplied: what tells one rescaled system from another."""
        return np.asarray(np.round(self.design @ np.round(exponents)).astype(int))

    def units(self, system: DescriptorSystem, exponents: FloatArray) -> Units:
        """Rounded, with outputs in units of their own."""
        n, m = self.order, len(system.inputs)
        whole = np.round(exponents).astype(int)
        state = whole[n : 2 * n]
        magnitudes = _magnitudes(system.C, system.lower, system.upper) * np.ldexp(1.0, state)
        largest = magnitudes.max(axis=1, initial=0.0)
        outputs = np.round(np.log2(np.where(largest > 0.0, largest, 1.0))).astype(int)
        return Units(
            state=tuple(state.tolist()),
            inputs=tuple(whole[2 * n : 2 * n + m].tolist()),
            outputs=tuple(outputs.tolist()),
            rows=tuple(whole[:n].tolist()),
            time=int(whole[-1]),
            differential=system.differential,
        )


def _magnitudes(matrix: AffineMatrix, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """The largest magnitudes of the entries over a box."""
    centre = matrix.evaluate(0.5 * (lower + upper))
    return np.asarray(np.abs(centre) + np.tensordot(0.5 * (upper - lower), np.abs(matrix.coefficients), axes=1))


def _widths(system: DescriptorSystem) -> dict[int, float]:
    """Logarithms of the half-widths of the domain, by state, where it is bounded."""
    found = {}
    for k, symbol in enumerate(system.state):
        low, high = system.domain.get(symbol, (-np.inf, np.inf))
        half = 0.5 * (float(high) - float(low))
        if np.isfinite(half) and half > 0.0:
            found[k] = float(np.log2(half))
    return found


def _width_rows(widths: dict[int, float], order: int, unknowns: int) -> tuple[FloatArray, FloatArray]:
    """``t_j - t_k = log(w_j / w_k)`` for neighbours among the states with a width, weighted."""
    states = list(widths)
    rows, target = np.zeros((max(0, len(states) - 1), unknowns)), np.zeros(max(0, len(states) - 1))
    for number, (j, k) in enumerate(pairwise(states)):
        rows[number, order + j], rows[number, order + k] = 1.0, -1.0
        target[number] = widths[j] - widths[k]
    root = np.sqrt(WIDTH_WEIGHT)
    return root * rows, root * target


def _refined(system: DescriptorSystem, fit: _Fit, exponents: FloatArray) -> FloatArray | None:
    """Exponents corrected by the sizes of states and inputs in a regulated loop; None where there is no regulator."""
    n = system.order
    units = fit.units(system, exponents)
    sizes = _regulated_sizes(units.of(system).evaluate(0.5 * (system.lower + system.upper)), system.differential)
    if sizes is None:
        return None
    refined = np.round(exponents)
    refined[n:-1] += np.log2(sizes)
    return fit.solved({}, robust=True, given=refined)


def _regulated_sizes(centre: SystemMatrices, q: int) -> FloatArray | None:
    """Square roots of the Gramian's diagonal for (x, u) of a loop closed by a linear quadratic regulator, (n + m,)."""
    E, A, B, _ = centre
    m = B.shape[1]
    try:
        onto = -np.linalg.solve(A[q:, q:], np.hstack([A[q:, :q], B[q:]]))  # x_a from (x_d, u)
        rest = np.hstack([A[:q, :q], B[:q]]) + A[:q, q:] @ onto
        reduced = np.linalg.solve(E[:q, :q], rest)
        drift, inputs = reduced[:, :q], reduced[:, q:]
        gain = np.zeros((m, q))
        if m:
            gain = -inputs.T @ _riccati(drift, inputs)
        closed = drift + inputs @ gain
        if np.linalg.eigvals(closed).real.max() >= 0.0:
            return None
        gramian = scipy.linalg.solve_continuous_lyapunov(closed, -np.eye(q))
    except (np.linalg.LinAlgError, ValueError):
        return None
    outputs = np.vstack([np.eye(q), onto @ np.vstack([np.eye(q), gain]), gain])
    squares = np.einsum("ij,jk,ik->i", outputs, gramian, outputs)
    if not np.isfinite(squares).all():
        return None
    floor = 1e-12 * squares.max()
    return np.asarray(np.sqrt(np.maximum(squares, floor)))


def _riccati(drift: NDArray[Any], inputs: NDArray[Any]) -> FloatArray:
    """The stabilising X of ``drift' X + X drift - X inputs inputs' X + I = 0``, (q, q).

    From the stable subspace of the Hamiltonian matrix (Laub 1979): what it is for needs one digit, and scipy, which is
    asked where that fails, takes ten times as long to be careful.

    Raises:
        LinAlgError: there is none.
    """
    q = len(drift)
    hamiltonian = np.block([[drift, -inputs @ inputs.T], [-np.eye(q), -drift.T]])
    _, basis, stable = scipy.linalg.schur(hamiltonian, sort="lhp")
    if stable != q:
        return np.asarray(scipy.linalg.solve_continuous_are(drift, inputs, np.eye(q), np.eye(inputs.shape[1])))
    return np.asarray(np.linalg.solve(basis[:q, :q].T, basis[q:, :q].T).T)
