"""Points from which V does not fall as is claimed: what refutes a region on wider intervals of parameters.

Points are looked for in doubles; that V rises at one is decided in ball arithmetic, of the nonlinear plant as its model
has it and the law as it is shipped.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from flint import arb, arb_mat

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.program_values import program_values
from quasilpv.certificate.exact.vertex_tables import VertexTable
from quasilpv.certificate.systems.balls import constant
from quasilpv.certificate.systems.dynamics import Dynamics
from quasilpv.documents.system_artifact import SystemArtifactDocument

POINTS = 1500
CLIMBED = 8
STEPS = 12
AROUND = 40
_SEED = 2023


@dataclass(frozen=True, eq=False)
class Rise:
    """Deviations of the differential states, (q,), and of the parameters, (k,), at which V does not fall as claimed."""

    state: FloatArray
    parameters: FloatArray


class RisingPoints:
    """The search over an artifact whose intervals of parameters may be wider than what it is proved for."""

    def __init__(self, artifact: SystemArtifactDocument, decay_rate: float) -> None:
        """With ``V' <= -2 decay_rate V`` as the claim."""
        self.artifact, self.decay_rate = artifact, decay_rate
        self._q, self._n = artifact.model.differential, len(artifact.states)
        self._table = VertexTable.of(artifact.law.gain)
        self._root = np.linalg.cholesky(np.array(artifact.region.lyapunov))
        ends = [(signal.low or 0.0, signal.high or 0.0) for signal in artifact.parameters]
        self._low, self._high = np.array(ends).reshape(-1, 2).T

    def found(self) -> Rise | None:
        """A point at which the claim is refuted; None if none was found, or premises depend on algebraic states."""
        read = {int(op[1]) for op in self.artifact.model.premises.code if op[0] == "signal"}
        if read & set(range(self._q, self._n + len(self.artifact.inputs))):
            return None
        rng = np.random.default_rng(_SEED)
        y, share = self._draw(rng)
        excess = self._excess(y, share)
        for place in np.argsort(-excess)[:CLIMBED]:
            own = (y[place], share[place])
            for step in range(STEPS):
                width = 0.4 * 0.7**step
                around = (
                    own[0] + width * rng.normal(size=(AROUND, self._q)),
                    np.clip(own[1] + width * rng.normal(size=(AROUND, len(self._low))), 0.0, 1.0),
                )
                near = around[0] / np.maximum(np.linalg.norm(around[0], axis=1), 1.0)[:, None]
                candidates = np.vstack([own[0][None], near]), np.vstack([own[1][None], around[1]])
                best = int(np.argmax(self._excess(*candidates)))
                own = candidates[0][best], candidates[1][best]
            rise = Rise(0.999 * self._root @ own[0], self._low + own[1] * (self._high - self._low))
            if self._is_refuted(rise):
                return rise
        return None

    def _draw(self, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
        """Points of the unit ball, some near its middle, and parameters at ends of their intervals."""
        y = rng.normal(size=(POINTS, self._q))
        radius = np.where(rng.uniform(size=POINTS) < 0.3, 1e-3, rng.uniform(size=POINTS) ** (1.0 / self._q))
        y *= (radius / np.linalg.norm(y, axis=1))[:, None]
        return y, np.round(rng.uniform(size=(POINTS, len(self._low))))

    def _excess(self, y: FloatArray, share: FloatArray) -> FloatArray:
        """``(V' + 2 alpha V) / V`` at points x = R y, in doubles; minus infinity where it is not finite."""
        q, n, model = self._q, self._n, self.artifact.model
        x = y @ self._root.T
        parameters = self._low + share * (self._high - self._low)
        nothing = [np.zeros(len(y))] * (n - q + len(self.artifact.inputs))
        signals = [*x.T, *nothing, *parameters.T]
        with np.errstate(all="ignore"):
            z, told = (
                np.array([np.broadcast_to(v, len(y)) for v in program_values(code, signal=signals)]).reshape(-1, len(y))
                for code in (model.premises.code, self.artifact.law.schedule.code)
            )
            E, A, B = (
                np.broadcast_to(X.evaluate(z), (len(y), *np.shape(X.constant))) for X in (model.E, model.A, model.B)
            )
            closed = A.copy()
            closed[:, :, :q] += B @ self._table.evaluate(told.T)
            try:
                reduced = closed[:, :q, :q]
                if q < n:
                    rest = np.linalg.solve(closed[:, q:, q:], closed[:, q:, :q])
                    reduced = reduced - closed[:, :q, q:] @ rest
                rates = np.linalg.solve(E[:, :q, :q], reduced @ x[:, :, None])[:, :, 0]
            except np.linalg.LinAlgError:
                return np.full(len(y), -np.inf)
            along = np.einsum("ki,ki->k", y, np.linalg.solve(self._root, rates.T).T)
            excess = 2.0 * along / np.einsum("ki,ki->k", y, y) + 2.0 * self.decay_rate
        return np.where(np.isfinite(excess), excess, -np.inf)

    def _is_refuted(self, rise: Rise) -> bool:
        """Whether V <= 1 and V' > -2 alpha V there, in balls."""
        q, n, m = self._q, self._n, len(self.artifact.inputs)
        dynamics = Dynamics(self.artifact)
        cell = [*map(arb, rise.state.tolist()), *[arb(0)] * (n - q + m), *map(arb, rise.parameters.tolist())]
        told = program_values(self.artifact.law.schedule.code, signal=cell)
        box = zip(told, self._table.lower, self._table.upper, strict=True)
        if any(not (value >= low and value <= high) for value, low, high in box):
            return False  # beyond its box the law is another polynomial
        x = arb_mat(q, 1, cell[:q])
        try:
            rates = dynamics.right * dynamics.closed(cell) * dynamics.left * x
            scaled = constant(np.array(self.artifact.region.lyapunov)).solve(x)
        except (ArithmeticError, ZeroDivisionError):
            return False
        level, rate = ((scaled.transpose() * vector)[0, 0] for vector in (x, rates))
        return bool(level <= 1) and bool(2 * rate + 2 * arb(self.decay_rate) * level > 0)
