"""How far intervals of parameters can grow: against margins that are known by hand, and against a plant by hand."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import quasilpv as ql
from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.artifact.system_store import write_system_artifact
from quasilpv.cli.app import run
from quasilpv.documents.system_artifact import SystemArtifactDocument
from quasilpv.synthesis.regional.request import RegionalRequest
from quasilpv.system_release import release_system
from quasilpv.system_release.parameter_margin import DECAY, FALLS, ParameterMargin, grown, parameter_margins
from reference.released_systems import loaded, released


def scalar(drift: str, unknown: str, decay_rate: float = 0.5) -> SystemArtifactDocument:
    """``x' = drift x + u`` with parameters within 0.5 of 0."""
    system = ql.DescriptorSystem.from_equations(
        [f"x' = ({drift})*x + u"],
        state="x",
        inputs="u",
        domain={"x": (-1, 1), **dict.fromkeys(("p", "q") if "q" in drift else ("p",), (-0.5, 0.5))},
        unknown=unknown,
        name="scalar",
    )
    return release_system(RegionalRequest(system, decay_rate=decay_rate, input_limits={"u": 4.0}, speed=8.0))


def margins_of(artifact: SystemArtifactDocument) -> dict[tuple[tuple[str, ...], str], ParameterMargin]:
    return {(margin.names, margin.claim): margin for margin in parameter_margins(artifact)}


def test_of_one_state_the_margins_are_those_that_are_found_by_hand() -> None:
    # x' = (1 + p + q) x + K x: V falls as exp(-2 a t) just where 1 + p + q + K <= -a.
    artifact = scalar("1 + p + q", "p q")
    K = float(np.mean([block.vertices for block in artifact.law.gain.blocks]))
    found = margins_of(artifact)
    for claim, rate in ((DECAY, artifact.region.decay_rate_per_s), (FALLS, 0.0)):
        for names in (("p",), ("q",), ("p", "q")):
            left = -1.0 - K - rate - 0.5 * (2 - len(names))  # for the parameters that grow; the other one is at its end
            exact = left / (0.5 * len(names))
            margin = found[names, claim]
            assert margin.refuted is not None
            assert margin.proved <= exact <= margin.refuted
            assert margin.refuted <= 1.001 * exact
            if claim == FALLS:  # the speed bounds the other claim too
                assert margin.proved >= 0.985 * exact


def test_a_parameter_that_the_law_is_told_has_no_margin_beyond_the_box_of_its_premise() -> None:
    [decay, falls] = parameter_margins(scalar("1 + p", ""))
    for margin in (decay, falls):
        assert margin.proved < 1.01
        assert "told" in margin.reason


def rate_of_bus(
    P: FloatArray, controller: _runtime.SystemController, i: float, v: float, power: float
) -> tuple[float, float]:
    """V and V' of the DC bus, from its equations as they are printed."""
    u = float(controller.step([i, v, 0.0], [power])["input"][0])
    j = -power / 48.0 * v / (48.0 + v)
    rates = np.array([(-0.05 * i - v + u) / 0.002, (i - j) / (0.005 + 0.00005 * v)])
    x: FloatArray = np.array([i, v])
    return float(x @ np.linalg.solve(P, x)), float(2.0 * rates @ np.linalg.solve(P, x))


def test_what_is_refuted_of_the_dc_bus_rises_by_its_equations_and_what_is_proved_falls() -> None:
    artifact, rng = released("dc-bus"), np.random.default_rng(3)
    P, controller = np.array(artifact.region.lyapunov), _runtime.SystemController(loaded(artifact))
    root = np.linalg.cholesky(P)
    for (_, claim), margin in margins_of(artifact).items():
        rate = artifact.region.decay_rate_per_s if claim == DECAY else 0.0
        assert margin.refuted is not None
        assert margin.at is not None
        assert 1.0 <= margin.proved < margin.refuted < 1.1 * margin.proved
        V, rising = rate_of_bus(P, controller, *margin.at.state.tolist(), margin.at.parameters[0])
        assert V <= 1.0
        assert rising > -2.0 * rate * V
        for power in grown(artifact.parameters, margin.proved)["P"]:
            for _ in range(200):
                direction = rng.normal(size=2)
                x = rng.uniform() * root @ (direction / np.linalg.norm(direction))
                V, rising = rate_of_bus(P, controller, *x.tolist(), power)
                assert rising <= -2.0 * rate * V + 1e-9


def test_the_command_prints_what_is_proved_and_what_is_refuted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("quasilpv.experiments.system_grid.POINTS", 20)
    path = write_system_artifact(tmp_path, released("dc-bus"))[0]
    assert run(["robust", str(path), "--json"]) == 0
    decay, falls = json.loads(capsys.readouterr().out)["parameter_margins"]
    assert (decay["claim"], falls["claim"]) == ("decay", "V falls")
    assert falls["refuted"]["P"][1] > falls["proved"]["P"][1] > 600.0
    assert set(falls["refuted_at"]) == {"i", "v", "P"}
    assert run(["robust", str(path)]) == 0
    assert "proved in" in capsys.readouterr().out
