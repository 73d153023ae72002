"""The grid check of systems: it finds what is so, and fails where the loop does."""

from __future__ import annotations

import json
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import quasilpv as ql
from quasilpv.cli.app import run
from quasilpv.documents.canonical import canonical_json
from quasilpv.documents.system_artifact import SystemArtifactDocument
from quasilpv.errors import InputError
from quasilpv.experiments import system_grid
from quasilpv.experiments.system_grid import grid_check
from quasilpv.synthesis.regional.request import RegionalRequest
from quasilpv.system_release import release_system
from reference.released_systems import changed, released


@cache
def linear() -> tuple[SystemArtifactDocument, float]:
    """x' = x + u and its gain."""
    system = ql.DescriptorSystem.from_equations(
        ["x' = x + u"], state="x", inputs="u", domain={"x": (-1, 1)}, name="linear"
    )
    artifact = release_system(RegionalRequest(system, decay_rate=2.0, input_limits={"u": 4.0}, rate_hz=1000.0))
    return artifact, artifact.law.gain.blocks[0].vertices[0][0][0]


@pytest.mark.parametrize("period_s", [0.1, 0.3, 0.7])
def test_of_a_linear_plant_it_finds_its_contraction(period_s: float) -> None:
    artifact, gain = linear()
    found = grid_check(changed(artifact, sample_period_s=period_s, sampling=None), points=20)
    factor = math.exp(period_s) + (math.exp(period_s) - 1.0) * gain
    assert found.passed == (abs(factor) < 1.0) == (period_s < 0.6)
    if found.passed:
        assert found.growth == pytest.approx(factor**2, rel=1e-6)
    else:
        assert found.growth.max() >= 1.0
    assert found.input.max() == pytest.approx(0.999 * abs(gain) * artifact.region.lyapunov[0][0] ** 0.5 / 4.0, rel=0.1)


def test_a_delay_of_a_sample_that_breaks_the_loop_is_found() -> None:
    # x+ = e^T x + (e^T - 1) K x_before: its two poles have the product (1 - e^T) K.
    artifact, gain = linear()
    slow = changed(artifact, sample_period_s=0.4, sampling=None)
    assert (1.0 - math.exp(0.4)) * gain > 1.0
    assert grid_check(slow, points=20).passed
    assert not grid_check(slow, delay_s=0.4, points=20).passed
    with pytest.raises(InputError, match=r"delay: got 0\.5 s"):
        grid_check(slow, delay_s=0.5)


def test_what_is_proved_passes_and_the_worst_point_is_worst() -> None:
    artifact = released("dc-bus")
    found = grid_check(artifact, points=100)
    assert found.passed
    assert len(found.growth) > 100  # the local search found worse ones
    assert found.growth.argmax() >= 100
    P, trim = np.array(artifact.region.lyapunov), np.array([s.trim for s in artifact.states[:2]])
    level = np.einsum("ki,ij,kj->k", found.state - trim, np.linalg.inv(P), found.state - trim)
    assert (level <= 1.0).all()
    assert {0.0, 1.0} < set(np.round((found.parameters[:, 0] - 200.0) / 400.0, 12))


def test_the_command_says_that_it_is_sampled_and_fails_where_the_loop_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(system_grid, "POINTS", 40)
    path = tmp_path / "artifact.json"
    path.write_bytes(canonical_json(released("two-tanks").to_document()))
    assert run(["robust", str(path), "--json", "-o", str(tmp_path / "out")]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["evidence"] == "sampled"
    assert answer["worst_growth"] < 1.0
    assert (tmp_path / "out" / "grid-check.png").exists()
    assert run(["robust", str(path)]) == 0
    assert "sampled, not a proof" in capsys.readouterr().out
    slow = changed(linear()[0], sample_period_s=0.9, sampling=None)
    path.write_bytes(canonical_json(slow.to_document()))
    assert run(["robust", str(path)]) == 1
