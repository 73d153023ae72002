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

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from flint import arb

from quasilpv.certificate.exact.claims import Claim
from quasilpv.certificate.systems.balls import norm
from quasilpv.certificate.systems.cells import Cells
from quasilpv.documents.system_artifact import SystemArtifactDocument

CELLS = 1500
"""At most as many cells are looked at."""

BISECTIONS = 40


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
        self.artifact, self.cells, self._most_cells = artifact, Cells(artifact), cells

    @cached_property
    def bound(self) -> SampledBound:
        """b and J, and how long a period they allow."""
        found = self.cells.largest(self._slope_norm, self._most_cells)
        stated = self.artifact.region.speed_per_s
        closed = self.cells.largest(lambda cell: norm(self.cells.dynamics.closed(cell)), self._most_cells)
        speed = closed.value if stated is None else min(closed.value, stated)
        low, high = 0.0, 4.0 / speed
        for _ in range(BISECTIONS):
            period = 0.5 * (low + high)
            if float(self._contraction(speed, found.value, period).upper()) < 1.0:
                low = period
            else:
                high = period
        return SampledBound(speed, found.value, low, found.cells + closed.cells)

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

    def _slope_norm(self, cell: Sequence[arb]) -> float:
        return self.cells.at_corners(cell, lambda corner: norm(self.cells.dynamics.slope(corner)))
