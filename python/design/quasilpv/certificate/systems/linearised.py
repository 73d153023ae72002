"""A sharper proof of a sampling period: the loop linearised at every sample, and what the plant's curvature adds.

With the notation of `quasilpv.certificate.systems.sampled`, J_k = df/dx(x_k, u_k) and A_cl of a sample in coordinates
in which the region is the unit ball, ``phi(M) = I + M/2 + M^2/6 + ...``,

    |x(t)| <= |(I + t phi(t J_k) A_cl) x_k| + |x_k| eps(t),    eps(t) = L (b_c^2 rho_c) (G^2/2 - (t e^mt - G)/m)/m,

G = (e^mt - 1)/m: the first term is the plant linearised at the sample. m bounds the logarithmic norm of df/dx, L the
curvature, ``|df/dx(x, u) - df/dx(y, u)| <= L |x - y|``, over the region; b_c = |A_cl| and rho_c >= |x_k| over the cell
of x_k. Indeed v = x' has ``v' = (df/dx) v``, so ``|v(t)| <= b_c |x_k| e^mt``, ``|x(t) - x_k| <= b_c |x_k| G``, and
w = x' of the linearised plant, ``w' = J_k w``, differs from it by ``(v - w)' = J_k (v - w) + (df/dx - J_k) v``;
integrated twice.

    (I + t phi A_cl)' (I + t phi A_cl) = I + t (A_cl + A_cl' + t S(t)),   A_cl + A_cl' <= -2 alpha I  (decay, proved)

so that ``-2 alpha theta + max eig((1 - theta)(A_cl + A_cl') + t S) < -(2 eps - eps^2)/t`` for some theta of each cell
keeps every solution inside the region up to t, and with all t in (0, T] every sample contracts. Everything is enclosed
in ball arithmetic over cells of x_k, u_k and the parameters, all t included: a proof, with what `sampled` assumes.
(Magnus' linearisation at the sample; Coppel's inequality for the logarithmic norm.)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from math import factorial, inf, isfinite

import numpy as np
from flint import arb, arb_mat

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.claims import Claim
from quasilpv.certificate.systems.balls import beside, is_below, largest_eigenvalue, norm, split
from quasilpv.certificate.systems.cells import Box, Cells, halves
from quasilpv.documents.system_artifact import SystemArtifactDocument

CELLS = 6000
"""At most as many cells of samples are looked at."""

CONSTANT_CELLS = 300
"""At most as many for each of m and L."""

SHARES = (0.0, 0.5, 0.8, 0.9, 0.95, 0.98, 1.0)
"""theta: parts of the proved decay that are used instead of the enclosed one."""

TIMES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Ends of intervals of t, in units of T."""

ROUNDING = 1e-9
"""Added to eigenvalues found in doubles, of the largest entry."""

NARROW = 1e-3
"""Signals along which a cell is so narrow are not cut, in units of its largest width."""

POINT = 1e-9
"""A cell that is narrower along every signal, and fails, ends the search."""

RELIABLE = 8
"""Cuts along every signal, after which what they gained is believed."""

MIDDLES = 10
"""Of so many cells that are cut, the middle of one is looked at, whether it fails too."""

SAMPLES = 60
"""Looked at before any cell."""

SEED = 2022

ORDER = 7
"""Of the series of phi."""


@dataclass(frozen=True)
class _Sample:
    """A cell of x_k: A_cl, J_k, ``b_c^2 rho_c``."""

    closed: arb_mat
    slope: arb_mat
    curving: float


@dataclass(frozen=True)
class _Seen:
    """A cell, what is enclosed of it (None if no sample lies in it), and by how much it fails."""

    box: Box
    own: _Sample | None
    missing: float


class _Branching:
    """Along which signal cells are cut: most signals matter little, and which ones do is learnt.

    Of the first cells the halves along every signal are looked at, and the signal is taken whose halves fail least.
    What one cut gained, per relative width of the cell, is averaged for every signal; once each was tried often
    enough, the signal with the largest gain to be expected is taken unseen (pseudo-costs; Achterberg, Koch and Martin
    2005, Branching rules revisited).
    """

    def __init__(self, whole: Box, cut: Sequence[int]) -> None:
        """Nothing is learnt yet."""
        self._whole, self._cut = whole, cut
        self._gained, self._tried = dict.fromkeys(cut, 0.0), dict.fromkeys(cut, 0)

    def halved(self, seen: _Seen, look: Callable[[Box], _Seen]) -> list[_Seen]:
        """Both halves, the worse one last: it is looked at first, so that where nothing helps is soon found.

        None of a cell that is a point, nearly.
        """
        widths = {k: (seen.box[k][1] - seen.box[k][0]) / (self._whole[k][1] - self._whole[k][0]) for k in self._cut}
        if max(widths.values()) < POINT:
            return []
        wide = [k for k in self._cut if widths[k] >= NARROW * max(widths.values())]
        if not isfinite(seen.missing):
            wide = [max(wide, key=lambda k: widths[k])]
        elif all(self._tried[k] >= RELIABLE for k in wide):
            wide = [max(wide, key=lambda k: self._gained[k] / self._tried[k] * widths[k])]
        pairs = {k: sorted(map(look, halves(seen.box, k)), key=lambda half: half.missing) for k in wide}
        for k, pair in pairs.items():
            gained = seen.missing - 0.5 * (pair[0].missing + pair[1].missing)
            if isfinite(gained):
                self._gained[k] += max(gained, 0.0) / widths[k]
                self._tried[k] += 1
        return min(pairs.items(), key=lambda item: (item[1][0].missing + item[1][1].missing, -widths[item[0]]))[1]


class LinearisedLoop:
    """The enclosures of one artifact.

    Raises:
        ArithmeticError: as `quasilpv.certificate.systems.sampled.SampledLoop`.
        UnsupportedError: an operation in the plant's derivatives has no slope.
    """

    def __init__(self, artifact: SystemArtifactDocument, cells: int = CELLS) -> None:
        """Prepare; nothing is enclosed yet."""
        self.artifact, self.cells, self._most_cells = artifact, Cells(artifact), cells
        self._dynamics = self.cells.dynamics
        self._alpha = artifact.region.decay_rate_per_s

    @cached_property
    def growth(self) -> float:
        """m, 1/s, positive."""
        return max(1e-3 * self._alpha, self.cells.largest(self._logarithmic_norm, CONSTANT_CELLS).value)

    @cached_property
    def curvature(self) -> float:
        """L, 1/s."""
        return self.cells.largest(self._curvature_norm, CONSTANT_CELLS).value

    @property
    def cut(self) -> list[int]:
        """The signals of which cells of samples are made."""
        return [*self.cells.used, *range(self.cells.n, self.cells.n + self.cells.m)]

    def claim(self, period_s: float) -> Claim:
        """The claim that a period is short enough."""
        cells = self.cells_of_proof(period_s)
        if cells is None:
            title = f"sampling: {period_s:.6g} s not proved with {self._most_cells} cells"
            return Claim.enclosed(title, holds=False, margin=-1.0)
        return Claim.enclosed(f"sampling: contraction over {period_s:.6g} s, {cells} cells", holds=True, margin=1.0)

    def cells_of_proof(self, period_s: float) -> int | None:
        """How many cells were looked at until every sample was seen to contract; None if that was not seen."""
        branching = _Branching(self.cells.whole, self.cut)
        pending = [self._look(box, period_s) for box in self.cells.first(self.cut)]
        for count in range(self._most_cells):
            if not pending:
                return count
            seen = pending.pop()
            if seen.own is None or (seen.missing == 0.0 and self._contracts(seen.own, period_s)):
                continue
            if count % MIDDLES == 0:
                middle = self._sample(self.cells.balls(_middle(seen.box)))
                if middle is not None and not self._contracts(middle, period_s):
                    return None
            found = branching.halved(seen, lambda box: self._look(box, period_s))
            if not found:
                return None
            pending += found
        return None

    def _look(self, box: Box, period_s: float) -> _Seen:
        own = None if self.cells.is_outside(box) else self._sample(self.cells.balls(box))
        return _Seen(box, own, 0.0 if own is None else self._missing(own, period_s))

    def is_hopeless(self, period_s: float) -> bool:
        """Whether some samples on the border of the region fail without what the curvature adds: no cells are tried."""
        rng = np.random.default_rng(SEED)
        factor, low, high = np.array(self.artifact.region.lyapunov), *np.array(self.cells.whole).T
        for _ in range(SAMPLES):
            direction = rng.normal(size=self.cells.q)
            x = np.linalg.cholesky(factor) @ (direction / np.linalg.norm(direction))
            point = np.where(
                np.isfinite(low) & np.isfinite(high), np.where(rng.uniform(size=len(low)) < 0.5, low, high), 0.0
            )
            point[: self.cells.q] = x
            box = [(float(value),) * 2 for value in point]
            box[self.cells.n : self.cells.n + self.cells.m] = self.cells.whole[
                self.cells.n : self.cells.n + self.cells.m
            ]
            own = self._sample(self.cells.balls(tuple(box)))
            if own is not None and not self._contracts(replace(own, curving=0.0), period_s):
                return True
        return False

    def _sample(self, cell: list[arb]) -> _Sample | None:
        """None if no input of the law lies in the cell."""
        q, n = self.cells.q, self.cells.n
        asked = self._dynamics.gain(cell) * arb_mat(q, 1, cell[:q])
        inputs = []
        for k in range(self.cells.m):
            if not asked[k, 0].overlaps(cell[n + k]):
                return None
            inputs.append(asked[k, 0].intersection(cell[n + k]))
        cell = [*cell[:n], *inputs, *cell[n + self.cells.m :]]
        closed = self._dynamics.closed(cell)
        return _Sample(closed, self._dynamics.slope(cell), norm(closed) ** 2 * self._dynamics.level(cell))

    def _contracts(self, own: _Sample, period_s: float) -> bool:
        """Whether one cell does; from the last times to the first ones, because most fail at the last."""
        decay = own.closed + own.closed.transpose()
        for early, late in reversed(list(pairwise(TIMES))):
            low, high = early * period_s, late * period_s
            second = _second(own, low, high)
            eps = own.curving * self._bending(high) if own.curving else 0.0
            if not eps < 1.0:
                return False
            allowed = -(2.0 * eps - eps * eps) / high * (1.0 + ROUNDING)
            if not all(self._is_below(decay, second, t, allowed) for t in (high, low)):
                return False
        return True

    def _is_below(self, decay: arb_mat, second: arb_mat, t: float, allowed: float) -> bool:
        """Whether ``A_cl + A_cl' + t S < allowed I``: the best theta is found in doubles, then decided in balls."""
        guesses = self._guesses(decay, second, t)
        best = int(np.argmin(guesses - 2.0 * self._alpha * np.array(SHARES)))
        bound = allowed + 2.0 * self._alpha * SHARES[best] * (1.0 - ROUNDING)
        return guesses[best] < bound and is_below((1 - arb(SHARES[best])) * decay + arb(t) * second, bound)

    def _guesses(self, decay: arb_mat, second: arb_mat, t: float) -> FloatArray:
        """The largest eigenvalue for every theta, in doubles."""
        (own, own_radius), (added, added_radius) = split(decay), split(second)
        theta = np.array(SHARES)[:, None, None]
        middle, radius = (1.0 - theta) * own + t * added, (1.0 - theta) * own_radius + t * added_radius
        guesses = np.linalg.eigvalsh(0.5 * (middle + middle.transpose(0, 2, 1)))[:, -1]
        return np.asarray(guesses + np.linalg.norm(radius, axis=(1, 2)) + ROUNDING * np.abs(own).max())

    def _missing(self, own: _Sample, period_s: float) -> float:
        """By how much a cell fails at the last times, in doubles; 0 if it does not."""
        eps = own.curving * self._bending(period_s)
        if not eps < 1.0:
            return inf
        second = _second(own, TIMES[-2] * period_s, period_s)
        guesses = self._guesses(own.closed + own.closed.transpose(), second, period_s)
        bound = -(2.0 * eps - eps * eps) / period_s
        return max(0.0, float((guesses - 2.0 * self._alpha * np.array(SHARES)).min()) - bound)

    def _bending(self, t: float) -> float:
        """``L (G^2/2 - (t e^mt - G)/m)/m``, at most ``L e^2mt t^3/6``."""
        m, T = arb(self.growth), arb(t)
        G = ((m * T).exp() - 1) / m
        sharp = (G**2 / 2 - (T * (m * T).exp() - G) / m) / m
        plain = (2 * m * T).exp() * T**3 / 6
        return self.curvature * min(float(sharp.upper()), float(plain.upper())) * (1.0 + 1e-12)

    def _logarithmic_norm(self, cell: Sequence[arb]) -> float:
        def of(corner: Sequence[arb]) -> float:
            slope = self._dynamics.slope(corner)
            return 0.5 * largest_eigenvalue(slope + slope.transpose())

        return self.cells.at_corners(cell, of)

    def _curvature_norm(self, cell: Sequence[arb]) -> float:
        """``|sum_k d_k D_k| <= |[D_1, D_2, ...]|`` for every unit vector d."""
        return self.cells.at_corners(cell, lambda corner: norm(beside(self._dynamics.curvature(corner))))


def _middle(box: Box) -> Box:
    return tuple((0.5 * (low + high) if high - low < inf else 0.0,) * 2 for low, high in box)


def _second(own: _Sample, low: float, high: float) -> arb_mat:
    """S(t) for t in an interval: ``(phi A)' (phi A) + psi J A + (psi J A)'``, ``phi(M) = I + M psi(M)``."""
    size = own.slope.nrows()
    M = arb(low).union(arb(high)) * own.slope
    psi = _psi(M)
    identity = arb_mat(size, size, [int(i == j) for i in range(size) for j in range(size)])
    moved = (identity + M * psi) * own.closed
    bent = psi * own.slope * own.closed
    return moved.transpose() * moved + bent + bent.transpose()


def _psi(M: arb_mat) -> arb_mat:
    """``I/2 + M/6 + M^2/24 + ...``, its rest bounded by the norm of M."""
    size = M.nrows()
    identity = arb_mat(size, size, [int(i == j) for i in range(size) for j in range(size)])
    total = identity * (1 / arb(factorial(ORDER + 2)))
    for k in range(ORDER - 1, -1, -1):
        total = M * total + identity * (1 / arb(factorial(k + 2)))
    middle, radius = split(M)
    largest = float(np.linalg.norm(np.abs(middle) + radius)) * (1.0 + 1e-12)
    rest = largest ** (ORDER + 1) / factorial(ORDER + 3) / max(1.0 - largest / (ORDER + 4), 1e-300)
    ball = arb(0, 2.0 * rest)
    return total + arb_mat(size, size, [ball] * (size * size))
