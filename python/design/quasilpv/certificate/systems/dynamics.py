"""The plant of an artifact over cells of signals, as matrices of balls in the coordinates of its region.

With ``x' = f(x, u)`` of the differential states, algebraic ones eliminated, and R R' = P, so that ``|R y|_P = |y|``:

    closed     R^-1 A_cl R,  f(x, K(z) x) = A_cl(x) x
    slope      R^-1 (df/dx) R
    curvature  R^-1 (D_k df/dx) R, D_k the derivative along the k-th column of R

From the residual ``F(x', x, u, p)`` and its derivatives, ``df/dx = -F_x'^-1 F_x``, and the curvature by running the
programs of these derivatives on tangents (`quasilpv.certificate.exact.tangents`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from flint import arb, arb_mat

from quasilpv.certificate.exact.program_ranges import outputs_of
from quasilpv.certificate.exact.program_values import program_values
from quasilpv.certificate.exact.tangents import Tangent
from quasilpv.certificate.exact.vertex_tables import VertexTable
from quasilpv.certificate.systems.balls import at, constant, exact, part
from quasilpv.documents.system_artifact import SystemArtifactDocument


class Dynamics:
    """See the module.

    Cells are balls of all signals: states, inputs, parameters.
    """

    def __init__(self, artifact: SystemArtifactDocument) -> None:
        """Prepare; nothing is enclosed yet."""
        self.artifact = artifact
        self.q, self.n, self.m = artifact.model.differential, len(artifact.states), len(artifact.inputs)
        self.right = constant(np.linalg.cholesky(np.array(artifact.region.lyapunov)))
        self.left = self.right.inv()
        monomials = VertexTable.of(artifact.law.gain).monomials()
        self._gains = [(factors, exact(coefficient)) for factors, coefficient in monomials.items()]

    def level(self, cell: Sequence[arb]) -> float:
        """The largest ``|x_d|_P`` in a cell, at most 1."""
        own = self.left * arb_mat(self.q, 1, list(cell[: self.q]))
        square = sum((entry * entry for row in own.table() for entry in row), arb(0))
        return min(1.0, math.sqrt(float(square.upper())) * (1.0 + 1e-12))

    def gain(self, cell: Sequence[arb]) -> arb_mat:
        """K, (m, q)."""
        told = program_values(self.artifact.law.schedule.code, signal=cell)
        K = arb_mat(self.m, self.q)
        for factors, coefficient in self._gains:
            K = K + coefficient * math.prod((told[p] for p in factors), start=arb(1))
        return K

    def closed(self, cell: Sequence[arb]) -> arb_mat:
        """See the module."""
        return self._in_region(self._closed_at(cell, program_values(self.artifact.model.premises.code, signal=cell)))

    def untold(self, cell: Sequence[arb]) -> arb_mat:
        """``R^-1 (A_cl - A_told) R``, A_told the closed loop of the model at the premises as the law is told them."""
        model = self.artifact.model
        told = program_values(self.artifact.law.schedule.code, signal=cell)
        true = program_values(model.premises.code, signal=cell)
        if not self._untold_is_direct:
            return self._in_region(self._closed_at(cell, true) - self._closed_at(cell, told))
        added, gain = arb_mat(self.q, self.q), self.gain(cell)
        for p in self._untold_premises:
            A, B = (constant(np.array(X.coefficients[p])) for X in (model.A, model.B))
            added = added + (A + B * gain) * (true[p] - told[p])
        return self._in_region(_solve(at(model.E, true), added))

    @cached_property
    def _untold_premises(self) -> list[int]:
        """Those whose program is another one for the law than for the model."""
        programs = (outputs_of(own.code) for own in (self.artifact.model.premises, self.artifact.law.schedule))
        pairs = enumerate(zip(*programs, strict=True))
        return [p for p, (true, told) in pairs if [*map(tuple, true)] != [*map(tuple, told)]]

    @property
    def _untold_is_direct(self) -> bool:
        """Whether the difference is a sum over these premises: no cell is then wide twice."""
        slopes = self.artifact.model.E.coefficients
        return self.q == self.n and not any(any(map(any, slopes[p])) for p in self._untold_premises)

    def slope(self, cell: Sequence[arb]) -> arb_mat:
        """See the module."""
        E, A = self._partials(cell)
        return self._in_region(_solve(E, self._eliminated(A, arb_mat(self.n, self.q))))

    def _closed_at(self, cell: Sequence[arb], z: Sequence[arb]) -> arb_mat:
        model = self.artifact.model
        E, A, B = (at(X, z) for X in (model.E, model.A, model.B))
        feedback = B * self.gain(cell)
        return _solve(part(E, 0, self.q, 0, self.q), self._eliminated(A, feedback))

    def curvature(self, cell: Sequence[arb]) -> list[arb_mat]:
        """See the module; as many as differential states.

        Raises:
            UnsupportedError: an operation of the programs has no slope.
        """
        q, n = self.q, self.n
        E, A = self._partials(cell)
        below = _solve(part(A, q, n, q, n), part(A, q, n, 0, q)) if q < n else None
        slope = _solve(E, self._eliminated(A, arb_mat(n, q)))
        along, rates = self.right.table(), (slope * self.right).table()
        tangents = [Tangent(cell[k], tuple(along[k])) for k in range(q)]
        if below is not None:
            algebraic = (below * self.right).table()
            tangents += [Tangent(cell[q + k], tuple(-entry for entry in algebraic[k])) for k in range(n - q)]
        tangents += [Tangent(ball) for ball in cell[n:]]
        speeds = self._rates(cell)
        tangents += [Tangent(speeds[k], tuple(rates[k])) for k in range(q)]
        tangents += [Tangent(arb(0)) for _ in range(n - q)]
        rows = [program_values(row.code, signal=tangents) for row in self.artifact.plant.jacobian]
        found = []
        for k in range(q):
            own = [[entry.slopes[k] if entry.slopes else arb(0) for entry in row] for row in rows]
            D = arb_mat(n, 2 * n, [entry for row in own for entry in row])
            upper = -part(D, 0, q, n, n + q) - part(D, 0, q, 0, q) * slope
            if below is not None:
                lower = -part(D, q, n, n, n + q) + part(D, q, n, n + q, 2 * n) * below
                across = _solve(part(A, q, n, q, n), lower)
                upper = upper + part(D, 0, q, n + q, 2 * n) * below - part(A, 0, q, q, n) * across
            found.append(self._in_region(_solve(E, upper)))
        return found

    def _in_region(self, matrix: arb_mat) -> arb_mat:
        return self.left * matrix * self.right

    def _rates(self, cell: Sequence[arb]) -> list[arb]:
        """x' of the differential states."""
        q, still = self.q, [arb(0)] * self.n
        rest = program_values(self.artifact.plant.residual.code, signal=[*cell, *still])
        rows = [program_values(row.code, signal=[*cell, *still]) for row in self.artifact.plant.jacobian[:q]]
        inertia = arb_mat(q, q, [rows[i][j] for i in range(q) for j in range(q)])
        speeds = _solve(inertia, arb_mat(q, 1, [-rest[i] for i in range(q)]))
        return [speeds[i, 0] for i in range(q)]

    def _partials(self, cell: Sequence[arb]) -> tuple[arb_mat, arb_mat]:
        """``F_x'`` of the differential states and ``-F_x``."""
        n, q = self.n, self.q
        signals = [*cell, *self._rates(cell), *[arb(0)] * (n - q)]
        rows = [program_values(row.code, signal=signals) for row in self.artifact.plant.jacobian]
        E = arb_mat(q, q, [rows[i][j] for i in range(q) for j in range(q)])
        return E, arb_mat(n, n, [-rows[i][n + j] for i in range(n) for j in range(n)])

    def _eliminated(self, A: arb_mat, feedback: arb_mat) -> arb_mat:
        """``A_11 + F_1 - A_12 A_22^-1 (A_21 + F_2)``, (q, q), F the feedback on the differential states."""
        n, q = self.n, self.q
        upper = part(A, 0, q, 0, q) + part(feedback, 0, q, 0, q)
        if q == n:
            return upper
        lower = part(A, q, n, 0, q) + part(feedback, q, n, 0, q)
        return upper - part(A, 0, q, q, n) * _solve(part(A, q, n, q, n), lower)


def _solve(matrix: arb_mat, right: arb_mat) -> arb_mat:
    """Raises ArithmeticError where the balls hold a singular matrix."""
    try:
        return matrix.solve(right)
    except ZeroDivisionError as error:
        raise ArithmeticError("the rates could not be enclosed over the region") from error
