"""Whether a nonlinear system stays in its region under a sampled law that reads some states and estimates the others.

With h the prediction, e = x - h, N the projection on the states that are not measured and xi = x - N e what the law
uses, ``u = K(z) xi`` and ``h+ = h + T f_told(xi, u) + L C e`` (`quasilpv.documents.system_artifact.ObserverDocument`).
In the norms ``v = |x|_P``, ``w = |e|_Q``, ``|y|_P^2 = y' P^-1 y``, let over the region, its parameters and its inputs

    b = sup |A_cl|_P,    J = sup |df/dx|_P,    J_e = sup |df/dx|_P->Q,    d = sup |(df/dx - A_cl) N|_Q->P,
    mu = sup |I + T df/dx N - L C|_Q,          kappa = |N|_Q->P,          delta = sup |A_cl - A_told|_P->Q.

While x and xi are in the region, ``f(x, u) = f(xi, u) + D N e = A_cl(xi) x + (D - A_cl(xi)) N e`` with D in the convex
hull of df/dx, so ``|f(x, u)|_P <= b v + d w``. What Euler's step leaves over is the integral of ``(T - t) df/dx x'``
with ``|x'| <= |f(x, u)| exp(J t)``: at most rho J and rho J_e times that, ``rho = (exp(J T) - 1 - J T)/J^2``. So

    v+ <= (sup |I + T A_cl|_P + rho J b) v + (T + rho J) d w,
    w+ <= mu w + rho J_e (b v + d w) + T delta (v + kappa w).

``nu >= kappa`` and ``v+ + nu w+ <= theta (v + nu w)`` with theta < 1 keep ``v + nu w <= 1``: there x and xi are in the
region, so that the input is within its limits and every premise in its box. Between samples the bound of v is convex in
t, at most v at 0 and at most theta at T. d is the sum of the suprema of ``|(df/dx - D_0) N|`` and ``|(D_0 - A_cl) N|``,
because both are taken at different points, D_0 the slope at the trim.

Premises may depend on estimated states. What is enclosed is the slope of the equations, not of a model; algebraic
states are eliminated. Everything is enclosed in ball arithmetic over cells of the region: this is a proof, with what
`quasilpv.certificate.systems.sampled` assumes, exact measurements among it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from flint import arb, arb_mat

from quasilpv.certificate.exact.claims import Claim
from quasilpv.certificate.systems.balls import constant, norm, split
from quasilpv.certificate.systems.cells import Cells
from quasilpv.documents.strict_model import FieldError
from quasilpv.documents.system_artifact import ObserverDocument, SystemArtifactDocument

CELLS = 1500
"""At most as many cells are looked at for each supremum."""


@dataclass(frozen=True)
class ObservedBound:
    """The suprema of the module, by its letters; rates in 1/s."""

    b: float
    J: float
    J_e: float
    d: float
    delta: float
    mu: float
    kappa: float


class ObservedLoop:
    """The enclosures of one artifact with an observer.

    Raises:
        FieldError: it has none.
        ArithmeticError: as `quasilpv.certificate.systems.sampled.SampledLoop`.
    """

    def __init__(self, artifact: SystemArtifactDocument, cells: int = CELLS) -> None:
        """Prepare; nothing is enclosed yet."""
        if artifact.observer is None:
            raise FieldError("observer", "null", "one: the sampling period is said to be proved with it")
        self.artifact, self.cells, self._most_cells = artifact, Cells(artifact), cells
        self.observer: ObserverDocument = artifact.observer
        self._dynamics, self.q = self.cells.dynamics, self.cells.q
        self._right = self._dynamics.left * constant(np.linalg.cholesky(np.array(self.observer.lyapunov)))
        self._left = self._right.inv()
        unseen = np.diag([float(not seen) for seen in artifact.measured[: self.q]])
        self._unseen = self._dynamics.left * constant(unseen) * self._dynamics.right

    @cached_property
    def bound(self) -> ObservedBound:
        """All suprema."""
        dynamics, identity = self._dynamics, _identity(self.q)
        unseen, right, left = self._unseen, self._right, self._left
        corrected = identity - dynamics.left * self._correction() * dynamics.right
        period, T = self.artifact.sample_period_s, arb(self.artifact.sample_period_s)
        D0 = constant(split(dynamics.slope(self._trim()))[0])

        def loss(slope: arb_mat) -> float:
            """Of the error, per second: relative to 1 it would be too small for `Cells.largest` to see."""
            return (norm(left * (corrected + T * slope * unseen) * right) - 1.0) / period

        b, stated = self._over(lambda cell: norm(dynamics.closed(cell))), self.artifact.region.speed_per_s
        along = unseen * right
        apart = self._over_slopes(lambda slope: norm((slope - D0) * along))
        apart += self._over(lambda cell: norm((D0 - dynamics.closed(cell)) * along))
        knows_all = self.artifact.law.schedule.code == self.artifact.model.premises.code
        return ObservedBound(
            b=b if stated is None else min(b, stated),
            J=self._over_slopes(norm),
            J_e=self._over_slopes(lambda slope: norm(left * slope)),
            d=apart * (1.0 + 1e-15),
            delta=0.0 if knows_all else self._over(lambda cell: norm(left * dynamics.untold(cell))),
            mu=(1.0 + period * self._over_slopes(loss)) * (1.0 + 1e-15),
            kappa=norm(along),
        )

    def contraction(self) -> float:
        """theta, rounded up; infinite if ``nu < kappa``."""
        own, nu, T = self.bound, arb(self.observer.weight), arb(self.artifact.sample_period_s)
        if not nu >= own.kappa:
            return float("inf")
        b, J, J_e, d, delta, mu, kappa = (arb(value) for value in vars(own).values())
        rho = ((J * T).exp() - 1 - J * T) / J**2
        euler = (1 - 2 * arb(self.artifact.region.decay_rate_per_s) * T + (b * T) ** 2).sqrt() + rho * J * b
        of_state = euler + nu * (rho * J_e * b + T * delta)
        of_error = (T + rho * J) * d / nu + mu + rho * J_e * d + T * delta * kappa
        if not (of_state < 1 and of_error < 1):  # wide balls included
            return max(1.0, float(of_state.mid()), float(of_error.mid()))
        return max(float(of_state.upper()), float(of_error.upper()))

    def claim(self, period_s: float) -> Claim:
        """The claim that a period is short enough, with this observer."""
        theta = self.contraction()
        title = f"sampling with the observer: contraction per {period_s:.6g} s at most {theta:.9f}"
        return Claim.enclosed(title, holds=theta < 1.0, margin=max(-1.0, 1.0 - theta))

    def _trim(self) -> list[arb]:
        """Where states and inputs do not deviate, and parameters are in the middle."""
        of_parameters = [0.5 * (low + high) for low, high in self.cells.whole[self.cells.n + self.cells.m :]]
        values = [0.0] * (self.cells.n + self.cells.m) + of_parameters
        return self.cells.balls(tuple((value, value) for value in values))

    def _correction(self) -> arb_mat:
        """``L C``, (q, q)."""
        gain, seen = np.array(self.observer.gain), np.flatnonzero(self.artifact.measured[: self.q])
        full = np.zeros((self.q, self.q))
        full[:, seen] = gain
        return constant(full)

    def _over(self, of: Callable[[Sequence[arb]], float]) -> float:
        return self.cells.largest(of, self._most_cells).value

    def _over_slopes(self, of: Callable[[arb_mat], float]) -> float:
        """Of a convex function of df/dx, which is affine in the inputs."""
        dynamics = self._dynamics
        return self._over(lambda cell: self.cells.at_corners(cell, lambda corner: of(dynamics.slope(corner))))


def _identity(size: int) -> arb_mat:
    return arb_mat(size, size, [int(i == j) for i in range(size) for j in range(size)])
