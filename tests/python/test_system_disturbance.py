"""Disturbances of general systems in runs: C++ against scipy, the certified L2 gain, documents and commands."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.artifact.system_store import write_system_artifact
from quasilpv.cli.app import run
from quasilpv.cli.disturbances import disturbances_of
from quasilpv.documents.system_artifact import SystemArtifactDocument
from quasilpv.errors import InputError
from quasilpv.experiments.system_run import SystemExperiment, SystemRun, disturbance_of, gain_of, scenario_of, simulate
from quasilpv.scenarios import NOISE_SEED
from quasilpv.scenarios.system_schema import (
    ConstantDisturbance,
    NoiseDisturbance,
    SineDisturbance,
    SystemDisturbance,
    SystemScenario,
)
from reference.released_systems import loaded, released, request_of
from test_l2_gain import released as released_for_gain

# ---- against scipy ---------------------------------------------------------------------------------------------------

SAMPLES = 15


def forms(artifact: SystemArtifactDocument) -> tuple[SystemDisturbance, ...]:
    """A step that begins and ends within samples, a sine on the rate of the last state, noise on the first input."""
    T, state, signal = artifact.sample_period_s, artifact.states[artifact.model.differential - 1], artifact.inputs[0]
    force = 0.02 * (signal.high or 1.0)
    speed = 0.02 * (state.high or 1.0) / T / SAMPLES
    return (
        ConstantDisturbance(signal=signal.name, value=force, begin_s=4.3 * T, end_s=11.6 * T),
        ConstantDisturbance(signal=state.name, value=0.3 * speed),
        SineDisturbance(signal=state.name, amplitude=speed, frequency_rad_s=0.4 / T, phase_rad=0.5),
        NoiseDisturbance(signal=signal.name, deviation=force, seed=4),
    )


def added_by_hand(
    artifact: SystemArtifactDocument, terms: tuple[SystemDisturbance, ...], noise: FloatArray, t: float, middle: float
) -> tuple[FloatArray, FloatArray]:
    """What acts at t, on rates and inputs; `middle` says on which side of an edge, `noise` what that of a sample is."""
    states, inputs = np.zeros(len(artifact.states)), np.zeros(len(artifact.inputs))
    names = [s.name for s in artifact.states], [s.name for s in artifact.inputs]
    for term in terms:
        if not term.begin_s <= middle < (np.inf if term.end_s is None else term.end_s):
            continue
        if isinstance(term, ConstantDisturbance):
            value = term.value
        elif isinstance(term, SineDisturbance):
            value = term.amplitude * np.sin(term.frequency_rad_s * t + term.phase_rad)
        else:
            value = noise[int(middle / artifact.sample_period_s)]
        if term.signal in names[0]:
            states[names[0].index(term.signal)] += value
        else:
            inputs[names[1].index(term.signal)] += value
    return states, inputs


def with_scipy(name: str, terms: tuple[SystemDisturbance, ...], noise: FloatArray) -> FloatArray:
    """The sampled loop from rest, from the matrices of the system: E (x' - w_x) = A x + B (u + w_u)."""
    artifact, system = released(name), request_of(name).system
    n, q, T = system.order, system.differential, artifact.sample_period_s
    controller = _runtime.SystemController(loaded(artifact))
    parameters = [0.5 * (s.low + s.high) for s in artifact.parameters]  # type: ignore[operator]
    named = dict(zip([s.name for s in artifact.parameters], parameters, strict=True))
    trim, inputs = (np.array([s.trim for s in own]) for own in (artifact.states, artifact.inputs))
    edges = sorted({time for term in terms for time in (term.begin_s, term.end_s) if time})

    def rates(t: float, xd: FloatArray, u: FloatArray, middle: float) -> FloatArray:
        pushed, pressed = added_by_hand(artifact, terms, noise, t, middle)
        x = np.concatenate([xd, np.zeros(n - q)])
        E, A, B, _C = system.evaluate(system.premise_values(x, named))
        if n > q:
            x[q:] = -np.linalg.solve(A[q:, q:], A[q:, :q] @ xd + B[q:] @ (u + pressed))
        return np.asarray(np.linalg.solve(E[:q, :q], (A @ x + B @ (u + pressed))[:q]) + pushed[:q])

    xd, found = np.zeros(q), []
    for k in range(SAMPLES):
        found.append(xd + trim[:q])
        u = controller.step(np.concatenate([xd, np.zeros(n - q)]) + trim, parameters)["input"] - inputs
        stops = [k * T, *(e for e in edges if k * T < e < (k + 1) * T), (k + 1) * T]
        for begin, end in pairwise(stops):
            arguments = (u, 0.5 * (begin + end))
            xd = solve_ivp(rates, (begin, end), xd, "Radau", args=arguments, rtol=1e-10, atol=1e-13).y[:, -1]
    return np.array(found)


@pytest.mark.parametrize("name", ["cart-pole", "dc-bus"])
def test_ida_and_rk4_under_disturbances_follow_what_scipy_finds(name: str) -> None:
    artifact = released(name)
    terms = forms(artifact)
    period = artifact.sample_period_s

    def ran(terms: tuple[SystemDisturbance, ...], steps: int) -> SystemRun:
        experiment = SystemExperiment({}, {}, SAMPLES * period, rk4_steps=steps, tolerance=1e-10, disturbances=terms)
        return simulate(artifact, experiment)

    noise = disturbance_of(ran(terms[3:], 20))[:, len(artifact.states)]
    expected = with_scipy(name, terms, noise)
    size = np.abs(expected - expected[0]).max(axis=0)
    assert (size > 0.0).all()
    for steps in (0, 20):
        error = np.abs(ran(terms, steps).state[:, : expected.shape[1]] - expected)
        assert (error <= 1e-7 * size).all()


def test_noise_is_white_of_its_deviation_and_of_its_seed() -> None:
    artifact = released("two-tanks")
    terms = [NoiseDisturbance(signal="u", deviation=1e-4, seed=seed) for seed in (1, 1, 2)]
    runs = [simulate(artifact, SystemExperiment({}, {}, 400.0, disturbances=(term,))) for term in terms]
    noise = disturbance_of(runs[0])[:, 2]
    assert noise.std() == pytest.approx(1e-4, rel=0.07)  # 2000 samples: 4.4 deviations
    assert abs(noise[1:] @ noise[:-1]) / (noise @ noise) < 0.1
    assert runs[0].first_difference(runs[1]) is None
    assert runs[0].first_difference(runs[2]) is not None
    assert not runs[0].scenario.is_nominal


# ---- the certified gain ----------------------------------------------------------------------------------------------


def gains(artifact: SystemArtifactDocument, signal: str) -> FloatArray:
    """Of runs from rest under sines of eight periods, with nearly all the energy that the certificate is of."""
    assert artifact.l2_gain is not None
    found = []
    for frequency in np.geomspace(0.3, 30.0, 7):
        pushed = 16.0 * np.pi / frequency
        amplitude = np.sqrt(2.0 * 0.95 * artifact.l2_gain[1] / pushed)
        term = SineDisturbance(signal=signal, amplitude=amplitude, frequency_rad_s=frequency, end_s=pushed)
        done = simulate(artifact, SystemExperiment({}, {}, pushed + 4.0, rk4_steps=1, disturbances=(term,)))
        answer = gain_of(done)
        assert answer is not None
        assert answer[1] < artifact.l2_gain[1]
        assert done.stayed
        found.append(answer[0])
    return np.array(found)


def test_no_disturbance_of_the_certified_energy_is_amplified_more_than_certified_and_a_smaller_gain_is_refuted() -> (
    None
):
    artifact = released_for_gain(
        ["x' = v", "v' = sin(x) + u"], disturbance={"u": 1.0}, performance={"x": 1.0, "u": 2.0}, rate_hz=1e3
    )
    assert artifact.l2_gain is not None
    worst = gains(artifact, "u").max()
    assert worst <= artifact.l2_gain[0]
    assert worst > 0.88 * artifact.l2_gain[0]  # a claim of 12 % less would be refuted by this disturbance


# ---- documents and commands ------------------------------------------------------------------------------------------


def test_a_document_keeps_its_disturbances_and_one_without_has_no_such_member() -> None:
    artifact = released("cart-pole")
    plain = scenario_of(artifact, SystemExperiment({}, {}), "test").to_document()
    assert "disturbances" not in plain
    assert SystemScenario.from_document(plain).is_nominal
    pushed = scenario_of(artifact, SystemExperiment({}, {}, disturbances=forms(artifact)), "test")
    assert SystemScenario.from_document(pushed.to_document()) == pushed


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"signal": "j"}, "disturbances[0].signal: got j"),  # an algebraic state has no rate
        ({"kind": "ramp"}, "disturbances[0]"),
        ({"value": "much"}, "disturbances[0].value"),
        ({"begin_s": -1.0}, "disturbances[0].begin_s"),
    ],
)
def test_a_wrong_document_names_the_term(change: dict[str, Any], words: str) -> None:
    artifact = released("dc-bus")
    term = ConstantDisturbance(signal="u", value=1.0)
    document = scenario_of(artifact, SystemExperiment({}, {}, disturbances=(term,)), "test").to_document()
    document["disturbances"][0].update(change)
    with pytest.raises(InputError) as refused:
        SystemScenario.from_document(document).require_names_of(artifact, "test")
    assert words in str(refused.value)


def test_what_a_person_types_becomes_terms() -> None:
    typed = ["u=0.5", "u=step:1,2", "u=step:1,2,3", "v=sine:2,10", "v=sine:2,10,0.3", "u=noise:0.1"]
    assert disturbances_of(typed, None) == (
        ConstantDisturbance(signal="u", value=0.5),
        ConstantDisturbance(signal="u", value=1.0, begin_s=2.0),
        ConstantDisturbance(signal="u", value=1.0, begin_s=2.0, end_s=3.0),
        SineDisturbance(signal="v", amplitude=2.0, frequency_rad_s=10.0),
        SineDisturbance(signal="v", amplitude=2.0, frequency_rad_s=10.0, phase_rad=0.3),
        NoiseDisturbance(signal="u", deviation=0.1, seed=NOISE_SEED + 6),
    )


@pytest.mark.parametrize(
    "typed", ["u", "=1", "u=x", "u=step:1", "u=step:1,3,2", "u=sine:1", "u=noise:-1", "q=1", "u=a:1"]
)
def test_a_wrong_disturbance_is_one_line_and_exit_code_2(
    typed: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_system_artifact(tmp_path, released("cart-pole"))[0]
    assert run(["simulate", str(path), "--disturbance", typed]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_the_command_says_that_no_proof_is_of_a_disturbed_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_system_artifact(tmp_path, released("cart-pole"))[0]
    options = ["--duration", "0.5", "--rk4", "2"]
    assert run(["simulate", str(path), *options, "--disturbance", "u=step:2,0.1", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["disturbed"] == ["u"]
    assert answer["largest_level"] > answer["level_at_start"] == 0.0
    assert run(["simulate", str(path), *options, "--disturbance", "u=step:2,0.1"]) == 0
    assert "without disturbance" in capsys.readouterr().err
    assert run(["simulate", str(path), *options, "--disturbance", "w=100"]) == 1


def test_a_parameter_beyond_what_is_assumed_and_a_delay_are_said_to_be_beside_the_proof(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    artifact = released("dc-bus")
    path = str(write_system_artifact(tmp_path, artifact)[0])
    (P,) = artifact.parameters
    for value, beyond in ((P.low, []), (P.high, []), (P.high + 1e-3, ["P"]), (P.low - 1.0, ["P"])):
        assert run(["simulate", path, "--parameter", f"P={value!r}", "--duration", "0.01", "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["beyond_assumed"] == beyond
        assert run(["simulate", path, "--parameter", f"P={value!r}", "--duration", "0.01"]) == 0
        assert ("the proof assumes P in" in capsys.readouterr().err) == bool(beyond)
    for delay_s in (0.0, artifact.sample_period_s):
        assert run(["simulate", path, "--delay", repr(delay_s), "--duration", "0.01"]) == 0
        assert ("the proof is without delay" in capsys.readouterr().err) == (delay_s > 0.0)
