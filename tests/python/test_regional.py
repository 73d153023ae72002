"""Feedback of general systems with the region it is proved in: designs, checker, run time, plant, command."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import quasilpv as ql
from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.artifact import write_artifact
from quasilpv.certificate.systems import verify_system
from quasilpv.certificate.systems.sampled import SampledLoop
from quasilpv.cli.app import run
from quasilpv.documents.canonical import canonical_json, with_hash
from quasilpv.documents.programs import evaluate_signals
from quasilpv.documents.strict_model import validate
from quasilpv.documents.system_artifact import SystemArtifactDocument
from quasilpv.errors import ClaimError, InfeasibleError, InputError
from quasilpv.experiments.system_run import SystemExperiment, SystemRun, simulate
from quasilpv.release import release
from quasilpv.synthesis import DesignRequest
from quasilpv.synthesis.regional.feedback import design_feedback
from quasilpv.synthesis.regional.request import RegionalRequest
from quasilpv.system_release import release_system
from quasilpv.systems.catalogue import system_kind

EXAMPLES = Path(__file__).parents[2] / "examples"
ASKED: Mapping[str, tuple[str, dict[str, Any]]] = {
    "two-tanks": ("systems/two_tanks.py:two_tanks", {"decay_rate": 0.05, "input_limits": {"u": 0.006}, "rate_hz": 5.0}),
    "cart-pole": ("systems/cart_pole.py:cart_pole", {"decay_rate": 1.0, "input_limits": {"u": 60.0}}),
    "dc-bus": ("own_system.py:dc_bus", {}),
}


@cache
def request_of(name: str) -> RegionalRequest:
    reference, asked = ASKED[name]
    return RegionalRequest(system_kind(str(EXAMPLES / reference)).system(), **asked)


@cache
def released(name: str) -> SystemArtifactDocument:
    return release_system(request_of(name))


def loaded(artifact: SystemArtifactDocument) -> _runtime.SystemArtifact:
    return _runtime.SystemArtifact.parse(canonical_json(artifact.to_document()))


def changed(artifact: SystemArtifactDocument, **members: Any) -> SystemArtifactDocument:
    return validate(SystemArtifactDocument, {**artifact.content(), **members}, "changed")


def on_the_border(artifact: SystemArtifactDocument, rng: np.random.Generator, scale: float = 0.999) -> dict[str, float]:
    """A start with V = scale^2, by name, with the trim."""
    q = artifact.model.differential
    direction = rng.normal(size=q)
    x = scale * np.linalg.cholesky(np.array(artifact.region.lyapunov)) @ (direction / np.linalg.norm(direction))
    return {s.name: float(v + s.trim) for s, v in zip(artifact.states[:q], x, strict=True)}


def drawn_parameters(artifact: SystemArtifactDocument, rng: np.random.Generator) -> dict[str, float]:
    return {s.name: float(rng.uniform(s.low, s.high)) for s in artifact.parameters}


# ---- designs and their proof -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ASKED)
def test_what_is_released_is_proved_and_says_what_is_sampled(name: str) -> None:
    found = verify_system(released(name))
    assert found.verified
    assert [claim.name for claim in found.claims if claim.evidence.value == "sampled"] == [
        "plant: residual of the model at 64 points (sampled)"
    ]


@pytest.mark.parametrize("name", ASKED)
@pytest.mark.parametrize("count", [60, pytest.param(10_000, marks=pytest.mark.full)])
def test_no_run_from_the_border_leaves_the_region_or_the_limits(name: str, count: int) -> None:
    artifact, rng = released(name), np.random.default_rng(7)
    for _ in range(count):
        duration = 300 * artifact.sample_period_s
        found = simulate(
            artifact,
            SystemExperiment(on_the_border(artifact, rng), drawn_parameters(artifact, rng), duration, rk4_steps=2),
        )
        assert found.stayed
        assert found.flags == ()
        assert (np.diff(found.level) <= 1e-12).all()


def test_a_period_far_beyond_the_proved_one_breaks_the_loop() -> None:
    # What is held to be proved above can fail: the pole falls before the next sample.
    artifact, rng = released("cart-pole"), np.random.default_rng(7)
    slow = changed(artifact, sample_period_s=0.5, sampling=None)
    runs = [simulate(slow, SystemExperiment(on_the_border(slow, rng), {}, 25.0, rk4_steps=50)) for _ in range(5)]
    assert not any(each.stayed for each in runs)


@pytest.mark.parametrize(
    "change",
    [
        {"region.lyapunov": 1.1},
        {"region.decay_rate_per_s": 4.0},
        {"law.gain": -1.0},
        {"model.lower": 0.7},
        {"signals.high": 0.5},
        {"model.A": 1.5},
        {"sample_period_s": 1000.0},
    ],
    ids=lambda change: next(iter(change)),
)
def test_a_claim_that_is_not_so_is_found(change: dict[str, float]) -> None:
    [(member, factor)] = change.items()
    content = released("two-tanks").content()
    part, _, name = member.partition(".")
    if part == "signals":
        for signal in content["signals"]:
            signal["high"] = signal["high"] and factor * signal["high"]
            signal["low"] = signal["low"] and factor * signal["low"]
    elif not name:
        content[part] = min(content[part] * factor, 10.0)
    elif name == "lower":
        half = [
            0.5 * (high - low) * factor
            for low, high in zip(content[part]["lower"], content[part]["upper"], strict=True)
        ]
        for place in (content["model"], content["law"]["gain"]):
            place["lower"] = [high - 2.0 * h for high, h in zip(place["upper"], half, strict=True)]
    else:
        content[part][name] = _scaled(content[part][name], factor)
    try:
        found = verify_system(validate(SystemArtifactDocument, content, "changed"))
    except InputError:
        return
    assert not found.verified


def _scaled(value: Any, factor: float) -> Any:
    """Numbers of matrices times a factor; what schedules them stays."""
    if isinstance(value, dict):
        return {
            k: v if k in {"premises", "lower", "upper", "centre", "kind"} else _scaled(v, factor)
            for k, v in value.items()
        }
    if isinstance(value, list):
        return [_scaled(v, factor) for v in value]
    return factor * value if isinstance(value, int | float) else value


def test_the_enclosed_slope_is_above_every_sampled_one() -> None:
    artifact, rng = released("cart-pole"), np.random.default_rng(3)
    loop = SampledLoop(artifact, 200)
    system = request_of("cart-pole").system
    root = np.linalg.cholesky(np.array(artifact.region.lyapunov))

    def f(x: FloatArray, u: float) -> FloatArray:
        E, A, B, _ = system.evaluate(system.premise_values(x))
        return np.asarray(np.linalg.solve(E, A @ x + B[:, 0] * u))

    largest = 0.0
    for _ in range(300):
        direction = rng.normal(size=4)
        x = root @ (direction / np.linalg.norm(direction)) * rng.uniform() ** 0.25
        u = 60.0 * rng.uniform(-1, 1)
        J = np.array([(f(x + 1e-6 * e, u) - f(x - 1e-6 * e, u)) / 2e-6 for e in np.eye(4)]).T
        largest = max(largest, np.linalg.norm(np.linalg.solve(root, J @ root), 2))
    assert largest <= loop.bound.lipschitz * (1 + 1e-6)
    assert loop.bound.lipschitz <= 6.0 * largest  # and not far above


def with_algebraic(equation: str) -> ql.DescriptorSystem:
    """A tank whose outflow, algebraic, is nonlinear in itself."""
    return ql.DescriptorSystem.from_equations(
        ["x' = u - y", equation], state="x y", inputs="u", domain={"x": (-1, 1), "y": (-0.8, 0.8)}, name="tank"
    )


def test_a_premise_in_an_algebraic_state_is_bounded_by_its_domain_unless_the_input_moves_it() -> None:
    # Between samples the input is not that of the law: what was proved of the algebraic state with it is not so then.
    still = release_system(RegionalRequest(with_algebraic("2*y + y^3 = x"), input_limits={"u": 2.0}))
    assert still.sampling is not None
    assert verify_system(still).verified
    moved = RegionalRequest(with_algebraic("2*y + y^3 = x + u/20"), input_limits={"u": 2.0})
    with pytest.raises(ClaimError, match="the algebraic state y, which moves with the input"):
        release_system(moved)
    assert release_system(moved, allow_unproved_rate=True).sampling is None


def test_an_algebraic_equation_that_folds_is_refused() -> None:
    # 0 = x - (y - 0.4 y^3) has no solution near y where x exceeds its largest value: the state would jump.
    folding = with_algebraic("0 = x - (y - 0.8*y^3)")
    with pytest.raises(InputError, match="the algebraic equation folds"):
        release_system(RegionalRequest(folding, input_limits={"u": 5.0}), allow_unproved_rate=True)


def test_more_decay_less_input_and_a_slower_loop_give_smaller_regions() -> None:
    base = replace(request_of("two-tanks"), rate_hz=None)
    size = [np.linalg.det(design_feedback(r).lyapunov) for r in (base, replace(base, decay_rate=0.3))]
    assert size[1] < size[0]
    tight = replace(base, decay_rate=0.3, input_limits={"u": 0.001})
    assert np.linalg.det(design_feedback(tight).lyapunov) < size[1]


def test_each_objective_is_best_at_what_it_is_for() -> None:
    base = replace(request_of("two-tanks"), rate_hz=None)
    largest = design_feedback(base)
    fastest = design_feedback(replace(base, objective="fastest", decay_rate=None))
    least = design_feedback(replace(base, objective="least-gain"))
    assert fastest.decay_rate > largest.decay_rate
    assert np.abs(least.gains).max() < np.abs(largest.gains).max()
    assert np.linalg.det(largest.lyapunov) > max(np.linalg.det(d.lyapunov) for d in (fastest, least))
    assert (fastest.extent >= 0.5 * 0.15 * (1 - 1e-6)).all()  # half of the domain is covered


def test_another_factoring_is_found_where_the_first_one_has_no_design() -> None:
    # With the documented rule this has none; (x^2 y) as y (x^2) instead of x (x y) has one.
    system = ql.DescriptorSystem.from_equations(
        ["x' = v", "v' = x - x*v^2 + u"], state="x v", inputs="u", domain={"x": (-1, 1), "v": (-1, 1)}, name="two-ways"
    )
    assert release_system(RegionalRequest(system, input_limits={"u": 20.0})).region.decay_rate_per_s > 0.0


# ---- run time and plant ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ASKED)
def test_the_cpp_step_is_the_numpy_step(name: str) -> None:
    artifact, rng = released(name), np.random.default_rng(11)
    controller = _runtime.SystemController(loaded(artifact))
    n, m, q = len(artifact.states), len(artifact.inputs), artifact.model.differential
    table = artifact.law.gain
    for _ in range(300):
        x = np.array([rng.uniform(*_interval(s)) for s in artifact.states])
        p = np.array([rng.uniform(s.low, s.high) for s in artifact.parameters])
        signals = np.concatenate(
            [x, np.zeros(m), [v if s.known else 0.0 for v, s in zip(p, artifact.parameters, strict=True)]]
        )
        z = np.clip(evaluate_signals(artifact.law.schedule, signals), table.lower, table.upper)
        weights = []
        for block in table.blocks:  # blocks of one premise
            [k] = block.premises
            share = (z[k] - table.lower[k]) / (table.upper[k] - table.lower[k])
            weights += [(1.0 - share) / len(table.blocks), share / len(table.blocks)]
        K = np.tensordot(weights, np.concatenate([np.array(block.vertices) for block in table.blocks]), axes=1)
        wanted = K @ x[:q]
        limits = [_interval(s, 1e300) for s in artifact.inputs]
        u = np.clip(wanted, *np.array(limits).T)
        trim = [np.array([s.trim for s in own]) for own in (artifact.states, artifact.inputs)]
        report = controller.step(x + trim[0], p)
        scale = np.abs(K) @ np.abs(x[:q]) + np.abs(trim[1])
        assert (np.abs(report["input"] - u - trim[1]) <= 1e-12 * scale).all()
        V = x[:q] @ np.linalg.solve(np.array(artifact.region.lyapunov), x[:q])
        assert report["level"] == pytest.approx(V, rel=1e-9)
        assert bool(report["flags"] & 16) == (V > 1.0)
        assert bool(report["flags"] & 4) == bool((u != wanted).any())
    assert n >= q


def _interval(signal: Any, otherwise: float = 1.0) -> tuple[float, float]:
    return (-otherwise if signal.low is None else signal.low, otherwise if signal.high is None else signal.high)


def test_a_signal_that_is_not_a_number_keeps_the_last_input() -> None:
    controller = _runtime.SystemController(loaded(released("two-tanks")))
    before = controller.step([0.3, 0.2], [])
    broken = controller.step([float("nan"), 0.2], [])
    assert broken["flags"] == 1
    assert broken["input"] == before["input"]


def radau(artifact: SystemArtifactDocument, name: str, start: Mapping[str, float], samples: int) -> FloatArray:
    """The sampled loop with scipy, from the matrices of the system; algebraic states eliminated."""
    system = request_of(name).system
    n, q = system.order, system.differential
    controller = _runtime.SystemController(loaded(artifact))
    parameters = [0.5 * (s.low + s.high) for s in artifact.parameters]  # type: ignore[operator]
    named = dict(zip([s.name for s in artifact.parameters], parameters, strict=True))
    trim = np.array([s.trim for s in artifact.states])
    inputs = np.array([s.trim for s in artifact.inputs])

    def rates(_: float, xd: FloatArray, u: FloatArray) -> FloatArray:
        x = np.concatenate([xd, np.zeros(n - q)])
        E, A, B, _C = system.evaluate(system.premise_values(x, named))
        if n > q:
            x[q:] = -np.linalg.solve(A[q:, q:], A[q:, :q] @ xd + B[q:] @ u)
        return np.asarray(np.linalg.solve(E[:q, :q], (A @ x + B @ u)[:q]))

    xd = np.array([start[s.name] for s in artifact.states[:q]]) - trim[:q]
    found = []
    for _ in range(samples):
        found.append(xd + trim[:q])
        measured = np.concatenate([xd, np.zeros(n - q)]) + trim
        u = controller.step(measured, parameters)["input"] - inputs
        xd = solve_ivp(rates, (0.0, artifact.sample_period_s), xd, method="Radau", args=(u,), rtol=1e-10, atol=1e-12).y[
            :, -1
        ]
    return np.array(found)


@pytest.mark.parametrize("name", ASKED)
def test_ida_and_rk4_follow_what_scipy_finds(name: str) -> None:
    artifact = released(name)
    start = on_the_border(artifact, np.random.default_rng(5), 0.7)
    samples = 40
    expected = radau(artifact, name, start, samples)
    size = np.abs(expected).max(axis=0)
    for steps in (0, 20):
        found = simulate(
            artifact, SystemExperiment(start, {}, samples * artifact.sample_period_s, rk4_steps=steps, tolerance=1e-10)
        )
        error = np.abs(found.state[:, : expected.shape[1]] - expected)
        assert (error <= 1e-7 * size).all()


def test_the_jacobian_of_the_plant_is_the_slope_of_its_residual() -> None:
    for name in ASKED:
        artifact, rng = released(name), np.random.default_rng(13)
        n, count = len(artifact.states), len(artifact.signals)
        values = np.array([rng.uniform(*_interval(s)) for s in artifact.signals] + list(rng.normal(size=n)))
        rows = np.array([evaluate_signals(row, values) for row in artifact.plant.jacobian])
        places = [*range(count, count + n), *range(n)]
        for column, place in enumerate(places):
            step = 1e-6 * max(1.0, abs(values[place]))
            ahead, behind = values.copy(), values.copy()
            ahead[place] += step
            behind[place] -= step
            slope = (
                evaluate_signals(artifact.plant.residual, ahead) - evaluate_signals(artifact.plant.residual, behind)
            ) / (2 * step)
            assert rows[:, column] == pytest.approx(slope, rel=1e-6, abs=1e-7)


def test_a_run_with_delay_and_one_without_differ_and_both_settle() -> None:
    artifact = released("cart-pole")
    start = on_the_border(artifact, np.random.default_rng(2), 0.5)
    runs: list[SystemRun] = [
        simulate(artifact, SystemExperiment(start, {}, 3.0, delay_s=delay)) for delay in (0.0, artifact.sample_period_s)
    ]
    assert not np.array_equal(runs[0].state, runs[1].state)
    assert all(each.level[-1] < 0.05 * each.level[0] for each in runs)


# ---- refusals --------------------------------------------------------------------------------------------------------


def test_nothing_bounds_the_region_where_neither_domain_nor_limit_does() -> None:
    system = ql.DescriptorSystem.from_equations(
        ["x' = v", "v' = sin(x) + u"], state="x v", inputs="u", domain={"x": (-1, 1)}, name="half"
    )
    with pytest.raises(InputError, match=r"half: domain of v: got none, expected an interval"):
        design_feedback(RegionalRequest(system))


def test_no_feedback_is_said_to_exist_where_the_input_is_too_weak() -> None:
    system = ql.DescriptorSystem.from_equations(
        ["x' = 2*x + x^3 + u"], state="x", inputs="u", domain={"x": (-1, 1)}, name="weak"
    )
    strong = design_feedback(RegionalRequest(system, input_limits={"u": 10.0}, decay_rate=1.0))
    assert strong.extent[0] == pytest.approx(1.0, rel=0.02)
    # |u| <= 0.1 holds |x| < about 0.1 / 3: the region shrinks with the input and does not vanish.
    feeble = design_feedback(RegionalRequest(system, input_limits={"u": 0.1}, decay_rate=1.0))
    assert 0.02 < feeble.extent[0] < 0.1 / 3.0
    unreachable = ql.DescriptorSystem.from_equations(
        ["x' = x", "v' = u"], state="x v", inputs="u", domain={"x": (-1, 1), "v": (-1, 1)}, name="unreachable"
    )
    with pytest.raises(InfeasibleError, match="unreachable: no feedback was found"):
        release_system(RegionalRequest(unreachable, input_limits={"u": 1.0}))


def test_a_rate_that_is_not_proved_is_refused_with_one_that_would_be() -> None:
    asked = replace(request_of("dc-bus"), rate_hz=200.0)
    with pytest.raises(ClaimError, match=r"dc-bus: 200 Hz is not proved; \d+ Hz would be \(--rate-hz\)"):
        release_system(asked)
    unproved = release_system(asked, allow_unproved_rate=True)
    assert unproved.sampling is None
    assert verify_system(unproved).verified  # what is left is so; nothing is claimed of the rate


def written(folder: Path, source: str) -> str:
    (folder / "mine.py").write_text(f"import quasilpv as ql\n{source}\n", encoding="utf-8")
    return f"{folder / 'mine.py'}:plant"


MINE = (
    "plant = ql.DescriptorSystem.from_equations(['x1\\' = x2', 'x2\\' = sin(x1) + u'], state='x1 x2', inputs='u',"
    " domain={'x1': (-1, 1), 'x2': (-2, 2)}, name='mine')"
)


def test_the_commands_take_a_system_from_its_file_to_a_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["synth", written(tmp_path, MINE), "--input-limit", "u=20", "-o", "out/mine", "--json"]) == 0
    made = json.loads(capsys.readouterr().out)
    path = made["artifact"]["json"]
    assert run(["verify", path, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["verified"] is True
    assert run(["inspect", path, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["hash"] == made["hash"]
    assert run(["simulate", path, "--start", "x1=0.2", "--json", "-o", "out/run"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["largest_level"] <= answer["level_at_start"] < 1.0
    assert answer["final_level"] < 1e-4
    assert {entry.name for entry in Path("out/run").iterdir()} >= {"signals.png", "region.png"}
    twin = made["artifact"]["cbor"]
    assert run(["verify", twin, "--json"]) == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--input-limit", "w=20"], "input limit: got w"),
        (["--input-limit", "u=x"], "NAME=VALUE"),
        (["--input-limit", "u=1", "--input-limit", "u=2"], "u twice"),
        (["--objective", "best"], "objective: got best"),
        (["--decay", "-1"], "decay"),
        (["--encoder-bits", "17"], "--encoder-bits"),
        (["--share", "2"], "share"),
        (["--set", "q=1"], "q"),
        (["--objective", "least-gain"], "input limit"),
    ],
)
def test_a_wrong_use_is_one_line_and_exit_code_2(
    arguments: list[str],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["synth", written(tmp_path, MINE), *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    assert words in captured.err
    assert not Path("out/mine-plant/artifact.json").exists()


def test_options_of_systems_are_refused_for_robots_and_artifacts_of_robots_for_simulate(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["synth", "arm3", "--input-limit", "u=1"]) == 2
    assert "--input-limit" in capsys.readouterr().err
    path, _ = write_artifact(tmp_path, release(DesignRequest.of("arm2", "pid")).artifact)
    assert run(["simulate", str(path)]) == 2
    assert "design track" in capsys.readouterr().err
    other = tmp_path / "system.json"
    other.write_bytes(canonical_json(released("two-tanks").to_document()))
    for verb in (["robust", str(other)], ["hil", "serial-square", "--artifact", str(other)]):
        assert run(verb) == 2
        assert "one of a robot; of systems: verify, inspect, simulate, export" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments",
    [["--start", "y=1"], ["--parameter", "m=1"], ["--duration", "1e9"], ["--delay", "1"], ["--start", "h1"]],
)
def test_a_wrong_run_is_one_line_and_exit_code_2(
    arguments: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "artifact.json"
    path.write_bytes(canonical_json(released("two-tanks").to_document()))
    assert run(["simulate", str(path), *arguments]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("member", ["signals", "model", "law", "region", "plant", "witness", "sample_period_s", "name"])
def test_a_damaged_artifact_is_refused_by_both_sides(member: str) -> None:
    content = released("two-tanks").content()
    del content[member]
    with pytest.raises(InputError):
        validate(SystemArtifactDocument, content, "damaged")
    if member != "witness":  # which nothing reads at run time
        with pytest.raises(InputError):
            _runtime.SystemArtifact.parse(canonical_json(with_hash(content)))


def commands_of(path: Path) -> list[str]:
    """The commands at the top of an example: the indented ones of its description."""
    return [line.strip() for line in path.read_text(encoding="utf-8").splitlines() if line.startswith("    design ")]


@pytest.mark.full
@pytest.mark.parametrize("path", sorted((EXAMPLES / "systems").glob("*.py")), ids=lambda path: path.stem)
def test_the_commands_of_an_example_end_in_a_proved_controller_and_a_run_that_stays(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "examples").symlink_to(EXAMPLES)
    monkeypatch.chdir(tmp_path)
    synth, simulated = (shlex.split(line)[1:] for line in commands_of(path))
    assert run([*synth, "--json"]) == 0
    made = json.loads(capsys.readouterr().out)
    assert made["sampling"] != "not proved"
    assert run([*simulated, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["level_at_start"] < 1.0  # the start that the file names is in the region
    assert answer["final_level"] < 0.01
