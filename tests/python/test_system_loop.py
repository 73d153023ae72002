"""Controllers of general systems at work: the step in C++, the plant, the commands, what both sides refuse."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.artifact import write_artifact
from quasilpv.artifact.system_store import read_system_artifact
from quasilpv.cli.app import run
from quasilpv.documents.canonical import canonical_json, with_hash
from quasilpv.documents.programs import evaluate_signals
from quasilpv.documents.strict_model import validate
from quasilpv.documents.system_artifact import SystemArtifactDocument
from quasilpv.errors import InputError
from quasilpv.experiments.system_run import SystemExperiment, SystemRun, simulate
from quasilpv.release import release
from quasilpv.synthesis import DesignRequest
from reference.released_systems import (
    ASKED,
    EXAMPLES,
    loaded,
    on_the_border,
    released,
    request_of,
    runs_from_the_border,
)

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


# ---- commands -------------------------------------------------------------------------------------------------------


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
    assert run(["hil", "serial-square", "--artifact", str(other)]) == 2
    others = "one of a robot; of systems: verify, robust, inspect, simulate, hil, animate, export"
    assert others in capsys.readouterr().err
    assert run(["robust", str(path), "--delay", "0.001"]) == 2
    assert "--delay" in capsys.readouterr().err


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
def test_the_commands_of_an_example_end_in_a_proved_controller_whose_runs_stay(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "examples").symlink_to(EXAMPLES)
    monkeypatch.chdir(tmp_path)
    synth, simulated, *others = (shlex.split(line)[1:] for line in commands_of(path))
    assert run([*synth, "--json"]) == 0
    made = json.loads(capsys.readouterr().out)
    assert made["sampling"] != "not proved"
    artifact = read_system_artifact(made["artifact"]["json"])
    assert artifact is not None
    for start, level, flags, left in runs_from_the_border(artifact, 10_000):
        assert (left, flags) == (None, 0), start
        assert (np.diff(level) <= 1e-12).all(), start
    assert run([*simulated, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["level_at_start"] < 1.0  # the start that the file names is in the region
    assert answer["final_level"] < 0.01
    for other in others:  # further designs
        assert run([*other, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["sampling"] != "not proved"
