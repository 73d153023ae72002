"""Observers for the law of a region, from samples of the closed loop: candidates of several rates, the best first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from quasilpv.arrays import FloatArray
from quasilpv.conditions.regional.observer import observer_statement

RATES = tuple(2.0**k for k in range(1, 15))
"""Decay rates of the error that are tried, in units of that of the region."""

FASTEST = 0.7
"""Of the inverse of the period: no error is asked to decay faster."""

SHARE = 0.5
"""Of the error's decay that may go into the state."""

WORSE = 1.5
"""By so much the cost grows from one rate to the next where no faster one is worth a look."""

UNSEEN = 1e-9
"""Of the norm of the slope: what a state does less than this, in units of the region, nobody sees."""

BACK_OFF = 0.02
"""Of the optimum, given up for room in which the certificate's enclosures can confirm the inequalities."""


@dataclass(frozen=True, eq=False)
class SampledSlopes:
    """The plant at samples of its region, in the units of the signals.

    Attributes:
        region: P, (q, q).
        measured: of every differential state, whether it is.
        slopes: df/dx, (N, q, q).
        closed: A_cl, (N, q, q).
        decay_rate: of the region, 1/s.
    """

    region: FloatArray
    measured: tuple[bool, ...]
    slopes: FloatArray
    closed: FloatArray
    decay_rate: float


@dataclass(frozen=True, eq=False)
class ObserverDesign:
    """A candidate.

    Attributes:
        rate: lam, 1/s: the error contracts by ``1 - lam T`` at the samples.
        gain: L, (q, o).
        lyapunov: Q, (q, q).
        cost: t of `quasilpv.conditions.regional.observer`: less is better.
        state_loss, error_loss: ``(1 - theta)/T`` of v and w at the samples, 1/s; not proved, and positive if it can be.
    """

    rate: float
    gain: FloatArray
    lyapunov: FloatArray
    cost: float
    state_loss: float
    error_loss: float

    @property
    def contracts(self) -> bool:
        """Whether state and error contract together at the samples."""
        return min(self.state_loss, self.error_loss) > 0.0


def observer_designs(samples: SampledSlopes, period_s: float, near: float | None = None) -> list[ObserverDesign]:
    """Observers of several rates, the least cost first; none if the inequalities have no solution.

    Args:
        samples: of the loop.
        period_s: T.
        near: only rates next to this one, 1/s.
    """
    found: list[ObserverDesign] = []
    for rate in (factor * samples.decay_rate for factor in RATES):
        if rate * period_s > FASTEST:
            break
        if near is not None and not 0.4 < rate / near < 2.5:
            continue
        design = _design(samples, rate, period_s)
        if design is None:
            continue
        if found and design.cost > WORSE * found[-1].cost:
            break
        found.append(design)
    return sorted(found, key=lambda each: each.cost)


def unseen_modes(samples: SampledSlopes) -> list[int]:
    """Differential states that take part most in modes at the trim that are not seen and do not decay as asked; none
    if all others can be estimated from what is measured there."""
    size = np.sqrt(np.diag(samples.region))  # of every state in the region: its unit here
    D = samples.slopes[0] * size / size[:, None]
    unseen = _unseen_subspace(D, np.array(samples.measured))
    values, vectors = np.linalg.eig(unseen.T @ D @ unseen)
    kept = [vector for value, vector in zip(values, vectors.T, strict=True) if value.real >= -samples.decay_rate]
    return sorted({int(np.argmax(np.abs(unseen @ vector))) for vector in kept})


def _unseen_subspace(D: FloatArray, measured: npt.NDArray[np.bool_]) -> FloatArray:
    """Orthonormal columns: the largest subspace that D keeps in what is not measured.

    By subspaces and not by modes: rounding moves multiple eigenvalues by the root of what it moves the matrix by.
    """
    space = np.eye(len(D))[:, ~measured]
    while space.size:
        leaving = D @ space - space @ (space.T @ D @ space)
        _, sizes, right = np.linalg.svd(leaving)
        rank = int((sizes > UNSEEN * np.linalg.norm(D)).sum())
        if rank == 0:
            break
        space = space @ right[rank:].T
    return np.asarray(space, dtype=np.float64)


def _design(samples: SampledSlopes, rate: float, period_s: float) -> ObserverDesign | None:
    R, left = _units(samples)
    seen = list(samples.measured)
    N, C = _unseen(samples, left, R), np.asarray(R[seen])
    slopes, closed = (list(left @ own @ R) for own in (samples.slopes, samples.closed))
    coupling = _coupling(slopes, closed, N)
    stated = observer_statement(slopes, N, C, coupling, rate=rate, period_s=period_s, share=SHARE)
    solution = stated.problem.solve_inside(BACK_OFF)
    if not solution.verified:
        return None
    X = 0.5 * (solution.values[stated.X] + solution.values[stated.X].T)
    correction = rate * period_s * np.linalg.solve(X, solution.values[stated.Y])
    losses = _losses(samples, X, [np.eye(len(N)) + period_s * D @ N - correction @ C for D in slopes], period_s)
    Q = R @ np.linalg.inv(X) @ R.T
    return ObserverDesign(rate, R @ correction, 0.5 * (Q + Q.T), solution.objective, *losses)


def _units(samples: SampledSlopes) -> tuple[FloatArray, FloatArray]:
    """R with ``R R' = P``, and its inverse: to coordinates in which the region is the unit ball."""
    R = np.asarray(np.linalg.cholesky(samples.region), dtype=np.float64)
    return R, np.asarray(np.linalg.inv(R), dtype=np.float64)


def _unseen(samples: SampledSlopes, left: FloatArray, R: FloatArray) -> FloatArray:
    """N in coordinates in which the region is the unit ball."""
    return np.asarray(left @ np.diag([float(not own) for own in samples.measured]) @ R)


def _coupling(slopes: Sequence[FloatArray], closed: Sequence[FloatArray], N: FloatArray) -> list[FloatArray]:
    """Differences at every point, and at pairs of points: both are suprema of their own."""
    count = len(slopes)
    pairs = [(i, j) for i in range(count) for j in (i, (5 * i + 3) % count)]
    return [(slopes[i] - closed[j]) @ N for i, j in pairs]


def _losses(samples: SampledSlopes, X: FloatArray, steps: Sequence[FloatArray], period_s: float) -> tuple[float, float]:
    """Of v and w, with what the samples say of the letters of `quasilpv.certificate.systems.observed`; nu is 1."""
    (R, left), half = _units(samples), np.linalg.cholesky(X).T
    back, T = np.linalg.inv(half), period_s
    slopes, closed = left @ samples.slopes @ R, left @ samples.closed @ R
    N = _unseen(samples, left, R)

    def largest(matrices: npt.ArrayLike) -> float:
        return float(np.linalg.norm(np.asarray(matrices), 2, axis=(1, 2)).max())

    b, J, J_e = largest(closed), largest(slopes), largest(half @ slopes)
    d = largest([Delta @ back for Delta in _coupling(list(slopes), list(closed), N)])
    rho = (np.expm1(J * T) - J * T) / J**2
    euler = np.sqrt(1.0 - 2.0 * samples.decay_rate * T + (b * T) ** 2) + rho * J * b
    mu = largest([half @ step @ back for step in steps])
    of_state = euler + rho * J_e * b
    of_error = (T + rho * J) * d + mu + rho * J_e * d
    return float((1.0 - of_state) / T), float((1.0 - of_error) / T)
