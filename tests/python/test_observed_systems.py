"""Laws of general systems that read some states and estimate the others: step in C++, region, proof."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.artifact.system_store import read_system_artifact, write_system_artifact
from quasilpv.certificate.systems import verify_system
from quasilpv.certificate.systems.observed import ObservedLoop
from quasilpv.documents.canonical import canonical_json
from quasilpv.documents.programs import evaluate_signals
from quasilpv.documents.system_artifact import SystemArtifactDocument
from quasilpv.experiments.system_run import SystemExperiment, scenario_of
from reference.observed_systems import HEAVY, OBSERVED, observed, observer_of, with_observer
from reference.released_systems import changed, loaded


class NumpyStep:
    """One step of law and observer, from the document: what C++ is compared with. Deviations from the trim."""

    def __init__(self, artifact: SystemArtifactDocument) -> None:
        self.artifact, self.own = artifact, observer_of(artifact)
        self.q, self.m = artifact.model.differential, len(artifact.inputs)
        self.seen = np.flatnonzero(artifact.measured)
        self.unseen = np.flatnonzero(~np.array(artifact.measured[: self.q]))
        self.L = np.array(self.own.gain)
        self.limits = np.array([(s.low, s.high) for s in artifact.inputs], dtype=float)

    def premises(self, xi: FloatArray, told: FloatArray) -> FloatArray:
        table = self.artifact.law.gain
        signals = np.concatenate([xi, np.zeros(len(self.artifact.states) - self.q + self.m), told])
        return np.clip(evaluate_signals(self.artifact.law.schedule, signals), table.lower, table.upper)

    def gain(self, z: FloatArray) -> FloatArray:
        table, weights = self.artifact.law.gain, []
        for block in table.blocks:  # of one premise each, or none at all
            for k in block.premises:
                share = (z[k] - table.lower[k]) / (table.upper[k] - table.lower[k])
                weights += [(1.0 - share) / len(table.blocks), share / len(table.blocks)]
        return np.tensordot(weights, np.concatenate([np.array(block.vertices) for block in table.blocks]), axes=1)

    def rates(self, z: FloatArray, xi: FloatArray, u: FloatArray) -> FloatArray:
        q, model = self.q, self.artifact.model
        E, A, B = (X.evaluate(z) for X in (model.E, model.A, model.B))
        right = A[:, :q] @ xi + B @ u
        matrix = np.hstack([E[:, :q], -A[:, q:]])
        return np.asarray(np.linalg.solve(matrix, right)[:q])

    def __call__(self, h: FloatArray, y: FloatArray, told: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """xi, u, and h of the next sample."""
        xi = h.copy()
        xi[self.seen] = y
        z = self.premises(xi, told)
        u = np.clip(self.gain(z) @ xi, *self.limits.T)
        ahead = h + self.artifact.sample_period_s * self.rates(z, xi, u) + self.L @ (y - h[self.seen])
        return xi, u, ahead


@pytest.mark.parametrize("name", OBSERVED)
def test_the_cpp_step_is_the_numpy_step(name: str) -> None:
    artifact, rng = observed(name), np.random.default_rng(11)
    controller, step = _runtime.SystemController(loaded(artifact)), NumpyStep(artifact)
    trim, inputs = (np.array([s.trim for s in own]) for own in (artifact.states, artifact.inputs))
    told = np.zeros(len(artifact.parameters))
    size = np.sqrt(np.diag(artifact.region.lyapunov))
    h = np.array(observer_of(artifact).start)
    for k in range(300):
        y = rng.uniform(-1.2, 1.2, len(step.seen)) * size[step.seen]  # beyond the region too
        if k == 0:
            h[step.seen] = y
        state = np.full(len(trim), np.nan)
        state[step.seen] = y + trim[step.seen]
        xi, u, h = step(h, y, told)
        report = controller.step(state, np.full(len(told), 7.0))
        assert np.abs(report["state"][: step.q] - trim[: step.q] - xi).max() <= 1e-12 * max(1.0, np.abs(xi).max())
        assert np.abs(report["input"] - inputs - u).max() <= 1e-12 * np.abs(step.limits).max()
        assert report["level"] == pytest.approx(xi @ np.linalg.solve(np.array(artifact.region.lyapunov), xi), rel=1e-9)


def test_what_is_shipped_is_proved_and_so_is_what_is_read_back(tmp_path: Path) -> None:
    for name in OBSERVED:
        artifact = observed(name)
        for path in write_system_artifact(tmp_path / name, artifact):
            read = read_system_artifact(path)
            assert read == artifact
        found = verify_system(artifact)
        assert found.verified
        assert any(claim.name.startswith("sampling with the observer") for claim in found.claims)


# ---- the region of state and error -----------------------------------------------------------------------------------


def drawn(artifact: SystemArtifactDocument, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """State and estimate with ``|x|_P + nu |e|_Q <= 1``, most of them on the border; deviations."""
    own, q = observer_of(artifact), artifact.model.differential
    share, total = rng.uniform(), 1.0 if rng.uniform() < 0.8 else rng.uniform()
    ball = rng.normal(size=(2, q))
    ball /= np.linalg.norm(ball, axis=1)[:, None]
    x = total * share * np.linalg.cholesky(np.array(artifact.region.lyapunov)) @ ball[0]
    e = total * (1.0 - share) / own.weight * np.linalg.cholesky(np.array(own.lyapunov)) @ ball[1]
    return 0.999999 * x, 0.999999 * (x - e)


def check_starts(name: str, count: int, samples: int) -> None:
    """No start leaves, W never rises, no input leaves its limits, no flag is up."""
    artifact, rng = observed(name), np.random.default_rng(2023)
    own, step = observer_of(artifact), NumpyStep(artifact)
    q, runtime = step.q, loaded(artifact)
    trim, inputs = (np.array([s.trim for s in group]) for group in (artifact.states[:q], artifact.inputs))
    norms = [np.linalg.inv(np.linalg.cholesky(np.array(X))) for X in (artifact.region.lyapunov, own.lyapunov)]
    duration = samples * artifact.sample_period_s
    for _ in range(count):
        x, h = drawn(artifact, rng)
        start = {s.name: float(v + s.trim) for s, v in zip(artifact.states[:q], x, strict=True)}
        parameters = {s.name: float(rng.uniform(s.low, s.high)) for s in artifact.parameters}
        document = scenario_of(artifact, SystemExperiment(start, parameters, duration, tolerance=1e-9), "test")
        scenario = _runtime.SystemScenario.parse(canonical_json(document.to_document()), "test", runtime)
        scenario.estimate = list(h + trim)
        found = _runtime.simulate_system(runtime, scenario)
        columns = found["columns"]
        assert found["exit"] is None
        assert len(columns["state"]) == samples
        assert found["flags"] == 0
        state = columns["state"][:, :q] - trim
        u = columns["input"] - inputs
        assert (u >= step.limits[:, 0]).all()
        assert (u <= step.limits[:, 1]).all()
        weights = []
        for k in range(samples):
            weights.append(np.linalg.norm(norms[0] @ state[k]) + own.weight * np.linalg.norm(norms[1] @ (state[k] - h)))
            _, expected, h = step(h, state[k, step.seen], np.zeros(len(artifact.parameters)))
            assert np.abs(u[k] - expected).max() <= 1e-9 * np.abs(step.limits).max()
        assert weights[0] <= 1.0
        assert (np.diff(weights) <= 1e-9).all()


@pytest.mark.parametrize("name", OBSERVED)
def test_from_anywhere_in_the_region_of_state_and_error_nothing_leaves(name: str) -> None:
    check_starts(name, 100, 20)


@pytest.mark.full  # minutes
@pytest.mark.parametrize("name", OBSERVED)
def test_from_ten_thousand_places_in_the_region_of_state_and_error_nothing_leaves(name: str) -> None:
    check_starts(name, 5000, 60)


# ---- what is not true is not proved ----------------------------------------------------------------------------------


def contraction(artifact: SystemArtifactDocument) -> float:
    return ObservedLoop(artifact, 300).contraction()


@pytest.mark.parametrize("name", OBSERVED)
def test_a_changed_observer_is_not_proved(name: str) -> None:
    artifact = observed(name)
    own = observer_of(artifact)
    assert contraction(artifact) < 1.0
    gain, Q = np.array(own.gain), np.array(own.lyapunov)
    assert contraction(with_observer(artifact, gain=(0.0 * gain).tolist())) >= 1.0
    assert contraction(with_observer(artifact, gain=(-gain).tolist())) >= 1.0
    assert contraction(with_observer(artifact, weight=0.5 * own.weight)) >= 1.0  # a larger region of errors
    assert contraction(with_observer(artifact, lyapunov=(9.0 * Q).tolist())) >= 1.0
    other = next(s.name for s in artifact.states if s.name not in own.measured)
    assert contraction(with_observer(artifact, measured=[other])) >= 1.0


def simulated_limit(artifact: SystemArtifactDocument) -> float:
    """A period at which the linear loop at the trim, sampled exactly, is unstable in doubles."""
    step = NumpyStep(artifact)
    q, T0 = step.q, artifact.sample_period_s
    told = np.zeros(len(artifact.parameters))
    z = step.premises(np.zeros(q), told)
    basis = np.eye(q)
    A = np.column_stack([step.rates(z, column, np.zeros(step.m)) for column in basis])
    B = np.column_stack([step.rates(z, np.zeros(q), column) for column in np.eye(step.m)])
    K, C = step.gain(z), basis[step.seen]
    seen = np.diag([float(k in step.seen) for k in range(q)])
    T = T0
    while True:
        whole = expm(T * np.block([[A, B], [np.zeros((step.m, q + step.m))]]))
        F, G = whole[:q, :q], whole[:q, q:]
        law = np.hstack([K @ seen, K @ (basis - seen)])  # of x and h
        xi = np.hstack([seen, basis - seen])
        loop = np.vstack(
            [
                np.hstack([F, np.zeros((q, q))]) + G @ law,
                np.hstack([step.L @ C, basis - step.L @ C]) + T * (A @ xi + B @ law),
            ]
        )
        if np.abs(np.linalg.eigvals(loop)).max() > 1.0:
            return T
        T *= 1.3


@pytest.mark.parametrize("name", OBSERVED)
def test_three_times_the_simulated_limit_of_the_period_is_not_proved(name: str) -> None:
    artifact = observed(name)
    limit = simulated_limit(artifact)
    assert limit > artifact.sample_period_s
    longest = 10.0  # of any artifact
    assert longest > 1.2 * limit
    assert contraction(changed(artifact, sample_period_s=min(3.0 * limit, longest))) >= 1.0


def test_the_bounds_hold_what_samples_of_the_region_have() -> None:
    artifact, rng = observed("heavy"), np.random.default_rng(3)
    own = observer_of(artifact)
    loop = ObservedLoop(artifact, 300)
    bound = loop.bound
    system = HEAVY
    P, Q = (np.linalg.cholesky(np.array(X)) for X in (artifact.region.lyapunov, own.lyapunov))
    N = np.diag([0.0, 1.0])
    for _ in range(200):
        direction = rng.normal(size=2)
        x = P @ direction / np.linalg.norm(direction) * rng.uniform()
        k, u = rng.uniform(0.1, 0.3), rng.uniform(-30.0, 30.0)
        mass = 2.0 - np.cos(x[0])
        force = 9.0 * np.sin(x[0]) - k * x[1] + u
        slope = np.array(
            [[0.0, 1.0], [9.0 * np.cos(x[0]) / mass - np.sin(x[0]) * force / mass**2, -k / mass]]
        )  # by hand
        step = np.eye(2) + artifact.sample_period_s * slope @ N
        step[:, :1] -= np.array(own.gain)
        in_P, in_Q = np.linalg.inv(P), np.linalg.inv(Q)
        assert np.linalg.norm(in_P @ slope @ P, 2) <= bound.J
        assert np.linalg.norm(in_Q @ slope @ P, 2) <= bound.J_e
        assert np.linalg.norm(in_Q @ step @ Q, 2) <= bound.mu
        E, A, B, _ = system.evaluate(system.premise_values(x, {"k": k}))
        law = NumpyStep(artifact)
        K = law.gain(law.premises(x, np.zeros(1)))
        closed = np.linalg.solve(E, A + B @ K)
        assert np.linalg.norm(in_P @ closed @ P, 2) <= bound.b * (1.0 + 1e-9)
        assert np.linalg.norm(in_P @ (slope - closed) @ N @ Q, 2) <= bound.d
        middle = np.linalg.solve(*(X for X in system.evaluate(system.premise_values(x, {"k": 0.2}))[:2]))
        assert np.linalg.norm(in_Q @ (np.linalg.solve(E, A) - middle) @ P, 2) <= bound.delta
    assert np.linalg.norm(np.linalg.inv(P) @ N @ Q, 2) <= bound.kappa <= own.weight
