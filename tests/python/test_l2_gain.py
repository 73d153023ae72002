"""Designs for the least L2 gain: against Riccati's equation, in a run of the nonlinear plant, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import solve_continuous_are

import quasilpv as ql
from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.vertex_tables import VertexTable
from quasilpv.certificate.systems import verify_system
from quasilpv.cli.app import run
from quasilpv.documents.system_artifact import SystemArtifactDocument
from quasilpv.errors import InputError
from quasilpv.synthesis.regional.request import RegionalRequest
from quasilpv.system_release import release_system
from reference.released_systems import changed

ASKED: dict[str, Any] = {"objective": "least-l2-gain", "decay_rate": 0.2, "input_limits": {"u": 40.0}, "share": 0.3}

PUSHED_S = 4.0


def released(equations: list[str], **asked: Any) -> SystemArtifactDocument:
    system = ql.DescriptorSystem.from_equations(
        equations, state="x v", inputs="u", domain={"x": (-1, 1), "v": (-3, 3)}, name="plant"
    )
    return release_system(RegionalRequest(system, **{**ASKED, **asked}), allow_unproved_rate=True)


def riccati_gain(A: FloatArray, B: FloatArray, Bw: FloatArray, C: FloatArray) -> float:
    """The least gain of ``x' = A x + B u + Bw w``, ``z = (C x, u)``: bisection over a stabilising solution."""
    low, high = 0.0, 100.0
    for _ in range(60):
        g = 0.5 * (low + high)
        R = np.diag([1.0, -(g**2)])
        try:
            X = solve_continuous_are(A, np.hstack([B, Bw]), C.T @ C, R)
            good = np.linalg.eigvalsh(X)[0] >= -1e-9
        except (np.linalg.LinAlgError, ValueError):
            good = False
        low, high = (low, g) if good else (g, high)
    return high


def test_of_a_linear_plant_the_gain_is_that_of_riccati_but_for_what_is_given_up() -> None:
    artifact = released(
        ["x' = v", "v' = 2*x - 0.5*v + u"], disturbance={"u": 1.0}, performance={"x": 1.0, "u": 1.0}, share=0.01
    )
    assert artifact.l2_gain is not None
    A, B = np.array([[0.0, 1.0], [2.0, -0.5]]), np.array([[0.0], [1.0]])
    best = riccati_gain(A, B, B, np.array([[1.0, 0.0]]))
    assert best * (1.0 - 1e-6) <= artifact.l2_gain[0] <= 1.12 * best
    assert verify_system(artifact).verified


def test_sizes_are_units_of_disturbance_and_performance() -> None:
    one, other = (
        released(["x' = v", "v' = sin(x) + u"], disturbance={"v": w}, performance={"x": z})
        for w, z in ((1.0, 0.5), (4.0, 2.0))
    )
    assert one.l2_gain is not None
    assert other.l2_gain is not None
    assert other.l2_gain[0] == pytest.approx(one.l2_gain[0], rel=1e-3)


def test_a_disturbed_run_from_rest_stays_below_the_gain_and_in_the_region() -> None:
    artifact = released(["x' = v", "v' = 3*sin(x) + u"], disturbance={"v": 1.0}, performance={"x": 0.2, "u": 20.0})
    assert artifact.l2_gain is not None
    gain, energy = artifact.l2_gain
    table, P = VertexTable.of(artifact.law.gain), np.array(artifact.region.lyapunov)

    def force(x: FloatArray) -> float:
        z = np.array([[np.sinc(x[0] / np.pi)]]) if len(table.lower) else np.zeros((1, 0))
        return float((table.evaluate(z * 3.0 if table.upper[0] > 1.5 else z)[0] @ x)[0])

    ratios = []
    for frequency in (0.0, 0.5, 1.0, 2.0, 5.0):
        size = np.sqrt(0.99 * energy / PUSHED_S)

        def rates(t: float, s: FloatArray, omega: float = frequency, size: float = size) -> FloatArray:
            u, w = force(s[:2]), size * np.cos(omega * t) if t < PUSHED_S else 0.0
            return np.array([s[1], 3.0 * np.sin(s[0]) + u + w, (s[0] / 0.2) ** 2 + (u / 20.0) ** 2, w * w])

        found = solve_ivp(rates, (0.0, 12.0), np.zeros(4), rtol=1e-8, atol=1e-10, max_step=0.05)
        x = found.y[:2]
        assert (np.einsum("ik,ij,jk->k", x, np.linalg.inv(P), x) < 1.0).all()
        ratios.append(np.sqrt(found.y[2, -1] / found.y[3, -1]))
    assert max(ratios) < gain
    assert max(ratios) > 0.3 * gain  # the bound is one of this plant, not of any


def test_a_gain_that_is_claimed_too_small_is_found() -> None:
    artifact = released(["x' = v", "v' = sin(x) + u"], disturbance={"u": 1.0}, performance={"x": 1.0})
    witness = artifact.content()["witness"]
    small = changed(artifact, witness={**witness, "l2 gain": [[0.5 * witness["l2 gain"][0][0]]]})
    failed = verify_system(small).failed
    assert failed
    assert all(name.startswith("L2 gain") for name in failed)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({}, "disturbance: got none"),
        ({"disturbance": {"u": 1.0}}, "performance: got none"),
        ({"disturbance": {"y": 1.0}, "performance": {"x": 1.0}}, "disturbance: got y"),
        ({"disturbance": {"u": -1.0}, "performance": {"x": 1.0}}, "disturbance u: got -1"),
        ({"objective": "fastest", "decay_rate": None, "disturbance": {"u": 1.0}}, "only least-l2-gain"),
    ],
)
def test_what_has_no_meaning_is_refused(asked: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        released(["x' = v", "v' = sin(x) + u"], **asked)


def test_the_command_prints_gain_and_energy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    source = (
        'import quasilpv as ql\nplant = ql.DescriptorSystem.from_equations(["x\' = v", "v\' = sin(x) + u"],'
        " state='x v', inputs='u', domain={'x': (-1, 1), 'v': (-2, 2)}, name='mine')\n"
    )
    Path("mine.py").write_text(source, encoding="utf-8")
    options = [
        "--objective",
        "least-l2-gain",
        "--disturbance",
        "u=1",
        "--performance",
        "x=0.1",
        "--input-limit",
        "u=20",
    ]
    assert run(["synth", "mine.py:plant", *options, "-o", "out", "--json"]) == 0
    made = json.loads(capsys.readouterr().out)
    assert made["l2_gain"] > 0.0
    assert made["energy_s"] > 0.0
    assert run(["inspect", made["artifact"]["json"], "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["l2_gain"] == made["l2_gain"]
