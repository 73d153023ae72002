"""Laws of general systems that read some states and estimate the others: their proof, their step in C++, their runs."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.artifact.system_store import read_system_artifact, write_system_artifact
from quasilpv.certificate.systems import verify_system
from quasilpv.certificate.systems.observed import ObservedLoop
from quasilpv.cli.app import run
from quasilpv.documents.canonical import canonical_json
from quasilpv.documents.programs import evaluate_signals
from quasilpv.documents.strict_model import validate
from quasilpv.documents.system_artifact import ObserverDocument, SystemArtifactDocument
from quasilpv.errors import ClaimError, InfeasibleError, InputError
from quasilpv.experiments.processes import Talk
from quasilpv.experiments.system_grid import grid_check
from quasilpv.experiments.system_hil import require_identical, run_system_over_lcm
from quasilpv.experiments.system_run import SystemExperiment, scenario_of, simulate_scenario
from quasilpv.synthesis.regional.request import RegionalRequest
from quasilpv.system_release import release_system
from quasilpv.systems.catalogue import system_kind
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.telemetry import LOG_NAME, read_log
from quasilpv.telemetry.replay import replay
from reference.released_systems import EXAMPLES, changed, loaded, released
from two_processes import executable

HEAVY = DescriptorSystem.from_equations(
    ["x' = v", "(2 - cos(x))*v' = 9*sin(x) - k*v + u"],
    state="x v",
    inputs="u",
    domain={"x": (-1, 1), "v": (-3, 3), "k": (0.1, 0.3)},
    unknown="k",
    name="heavy",
)
"""With a mass that depends on the angle, and friction that nobody knows."""

OBSERVED: dict[str, tuple[Callable[[], DescriptorSystem], dict[str, Any]]] = {
    "two-tanks": (
        lambda: system_kind(str(EXAMPLES / "systems/two_tanks.py:two_tanks")).system(),
        {"decay_rate": 0.05, "input_limits": {"u": 0.006}, "measured": ("h2",), "rate_hz": 10.0},
    ),
    "heavy": (lambda: HEAVY, {"decay_rate": 1.0, "input_limits": {"u": 30.0}, "measured": ("x",), "rate_hz": 2000.0}),
}


@cache
def observed(name: str) -> SystemArtifactDocument:
    make, asked = OBSERVED[name]
    return release_system(RegionalRequest(make(), **asked))


def observer_of(artifact: SystemArtifactDocument) -> ObserverDocument:
    assert artifact.observer is not None
    return artifact.observer


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


def with_observer(artifact: SystemArtifactDocument, **members: Any) -> SystemArtifactDocument:
    return changed(artifact, observer={**observer_of(artifact).model_dump(mode="json"), **members})


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


# ---- documents and commands ------------------------------------------------------------------------------------------


def test_artifacts_from_before_there_were_observers_load_and_keep_their_hash(tmp_path: Path) -> None:
    new = released("two-tanks")
    content = {name: value for name, value in new.content().items() if name != "observer"}
    law = {name: value for name, value in content["law"].items() if name != "premise_fault_s"}
    old = changed(new)  # of version 2
    assert old.hash == new.hash
    old = validate(SystemArtifactDocument, {**content, "law": law, "schema_version": 1}, "old")
    assert "observer" not in old.content()
    path = write_system_artifact(tmp_path, old)[0]
    assert read_system_artifact(path) == old
    assert _runtime.SystemArtifact.load(str(path)).hash == old.hash
    with pytest.raises(InputError, match="observer"):
        validate(SystemArtifactDocument, {**content, "law": law, "schema_version": 1, "observer": None}, "old")
    with pytest.raises(InputError, match="observer"):
        validate(SystemArtifactDocument, content, "new")


@pytest.mark.parametrize(
    ("members", "words"),
    [
        ({"measured": ["h2", "h1"]}, "observer.measured"),
        ({"measured": ["u"]}, "observer.measured"),
        ({"gain": [[1.0, 0.0], [0.0, 1.0]]}, "observer.gain"),
        ({"lyapunov": [[1.0, 0.0], [0.0, -1.0]]}, "observer.lyapunov"),
        ({"start": [0.0]}, "observer.start"),
        ({"weight": 0.0}, "observer.weight"),
    ],
)
def test_an_observer_that_does_not_fit_is_refused_by_its_field(members: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        with_observer(observed("two-tanks"), **members)


def test_the_commands_take_measured_states_from_the_file_to_a_run_and_its_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    tanks = str(EXAMPLES / "systems/two_tanks.py:two_tanks")
    asked = ["--decay", "0.05", "--input-limit", "u=0.006", "--rate-hz", "10", "--measured", "h2"]
    assert run(["synth", tanks, *asked, "--start-estimate", "h1=0.27", "-o", "out/tanks"]) == 0
    said = capsys.readouterr().out
    assert "h1 0.27" in said
    path = "out/tanks/artifact.json"
    assert run(["verify", path, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["verified"] is True
    assert run(["inspect", path, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["observer"]
    assert told["measured"] == ["h2"]
    assert told["start"] == {"h1": pytest.approx(0.27)}
    assert 0.0 < told["largest_error"]["h1"] < 0.15
    arguments = ["simulate", path, "--start", "h1=0.26", "--start", "h2=0.23", "--json", "-o", "out/run"]
    assert run(arguments) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["largest_error"] == {"h1": pytest.approx(0.01)}
    assert abs(answer["final_error"]["h1"]) < 1e-4
    assert answer["largest_level"] <= answer["start_level"] < 1.0
    assert run(["simulate", path, "--start", "h1=0.38", "-o", "out/far"]) == 0
    assert "estimates start too far" in capsys.readouterr().err
    capsys.readouterr()
    assert run(["log", "replay", f"out/run/{LOG_NAME}"]) == 0
    assert {path.name for path in Path("out/run").iterdir()} >= {"signals.png", "region.png"}


def test_over_lcm_every_sample_is_that_of_one_process_and_the_log_has_the_estimates(tmp_path: Path) -> None:
    for program in ("qlpv-controller", "qlpv-simulator"):
        executable(program)
    artifact = observed("two-tanks")
    scenario = scenario_of(artifact, SystemExperiment({"h1": 0.26, "h2": 0.23}, {}, 20.0, noise={"h2": 1e-4}), "test")
    over_lcm = run_system_over_lcm(artifact, scenario, tmp_path, Talk("lockstep"))
    alone = simulate_scenario(artifact, scenario, "test")
    require_identical(over_lcm.run, alone)
    assert list(alone.estimation_error) == ["h1"]
    assert np.abs(alone.estimation_error["h1"]).max() == pytest.approx(0.01)
    log = read_log(tmp_path / LOG_NAME)
    told = log["measurement"].samples["value"]
    assert (told[:, 0] == 0.0).all()  # h1, which is not measured
    assert (told[:, 1] != 0.0).all()
    heard = log["telemetry"].samples
    np.testing.assert_array_equal(heard["measured"][:, 0], alone.measured[heard["seq"], 0])
    shown = replay(log)
    assert shown.first_difference is None
    assert shown.compared > 0.9 * shown.samples


def test_a_missing_measurement_holds_the_input_and_what_is_not_measured_is_not_missed() -> None:
    artifact = observed("two-tanks")
    controller = _runtime.SystemController(loaded(artifact))
    first = controller.step([0.0, 0.23], [])
    missed = controller.step([0.25, float("nan")], [])
    assert missed["flags"] == 1
    assert missed["input"] == first["input"]
    assert controller.step([float("nan"), 0.23], [])["flags"] == 0  # what is not measured is not missed


@pytest.mark.parametrize(
    ("asked", "error", "words"),
    [
        ({"measured": ("h3",)}, InputError, "measured: got h3"),
        ({"measured": ("h1", "h2")}, InputError, "every differential state"),
        ({"measured": ("h1", "h1")}, InputError, "each name once"),
        ({"measured": ("h2",), "start_estimate": {"h2": 0.2}}, InputError, "start estimate: got h2"),
        ({"start_estimate": {"h2": 0.2}}, InputError, "no state is estimated"),
    ],
)
def test_what_cannot_be_measured_or_estimated_is_refused(asked: dict[str, Any], error: type, words: str) -> None:
    with pytest.raises(error, match=words):
        RegionalRequest(OBSERVED["two-tanks"][0](), **asked)


def test_outputs_stand_for_the_states_that_they_show() -> None:
    def tanks(outputs: list[str]) -> DescriptorSystem:
        return DescriptorSystem.from_equations(
            ["h1' = -h1 + u", "h2' = h1 - h2"],
            state="h1 h2",
            inputs="u",
            outputs=outputs,
            domain={"h1": (-1, 1), "h2": (-1, 1)},
            name="tanks",
        )

    assert RegionalRequest(tanks(["2*h2"]), measured=("outputs",)).measured == ("h2",)
    with pytest.raises(InputError, match="output 2 of 2"):
        RegionalRequest(tanks(["h2", "h1 + h2"]), measured=("outputs",))


def test_points_of_the_region_are_checked_with_estimates_that_are_exact() -> None:
    found = grid_check(observed("two-tanks"), points=40)
    assert found.passed


def test_a_state_that_no_measurement_tells_of_is_named() -> None:
    cart = DescriptorSystem.from_equations(
        ["p' = v", "v' = u", "w' = -w + u"],
        state="p v w",
        inputs="u",
        domain={"p": (-1, 1), "v": (-1, 1), "w": (-1, 1)},
        name="cart",
    )
    with pytest.raises(InfeasibleError, match="measure p too"):
        release_system(RegionalRequest(cart, decay_rate=0.3, input_limits={"u": 3.0}, measured=("v",)))


def test_a_premise_of_an_algebraic_state_is_refused_by_name() -> None:
    singular = DescriptorSystem.from_equations(
        ["x' = -x + a + u", "v' = x", "0 = a + a^3 - x"],
        state="x v a",
        inputs="u",
        domain={"x": (-1, 1), "v": (-1, 1), "a": (-1, 1)},
        name="singular",
    )
    with pytest.raises(InputError, match="premises of differential states"):
        RegionalRequest(singular, measured=("v",))


def test_a_rate_that_is_too_slow_is_refused_with_one_that_is_not() -> None:
    make, asked = OBSERVED["two-tanks"]
    with pytest.raises(ClaimError, match="10 Hz would be"):
        release_system(RegionalRequest(make(), **{**asked, "rate_hz": 2.0}))
