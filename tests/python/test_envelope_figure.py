"""The operating envelope as people see it: read from an artifact, printed, and drawn against a run."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from quasilpv import _runtime
from quasilpv.artifact import Artifact, read_artifact, summary, write_artifact
from quasilpv.artifact.envelope import OperatingEnvelope
from quasilpv.experiments.result import Variant
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import track
from quasilpv.figures.envelope import envelope_figure
from quasilpv.figures.gallery import write_gallery
from quasilpv.release import release
from quasilpv.scenarios import Sensors, tracking_experiment
from quasilpv.synthesis import DesignRequest, Specification
from reference.runs import synthetic_result
from test_figures import assert_readable

KINDS = ("dob-acceleration", "dob-torque")


@cache
def artifact(kind: str) -> Artifact:
    return release(DesignRequest.of("arm2", kind, Specification(rate_hz=4000.0))).artifact


def envelope(kind: str) -> OperatingEnvelope:
    found = OperatingEnvelope.of(artifact(kind))
    assert found is not None
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_when_an_artifact_has_an_envelope_expect_both_twins_and_the_runtime_to_load_it(
    kind: str, tmp_path: Path
) -> None:
    for path in write_artifact(tmp_path, artifact(kind)):
        assert read_artifact(path).witness == artifact(kind).witness
        assert _runtime.Artifact.load(str(path)).hash == artifact(kind).hash


@pytest.mark.parametrize("kind", KINDS)
def test_when_an_artifact_is_inspected_expect_levels_and_bounds_without_matrices(kind: str) -> None:
    shown = summary(artifact(kind))["envelope"]
    assert json.loads(json.dumps(shown)) == shown
    witness = (artifact(kind).witness or {})["envelope"]
    assert shown["box_set"]["level"] == witness["box_set"]["level"]
    assert shown["torque_set"]["bounds"] == witness["torque_set"]["bounds"]
    assert not any(key in {"P", "X", "Q", "F"} for part in shown.values() if isinstance(part, dict) for key in part)


def test_when_a_law_has_no_envelope_expect_none() -> None:
    baseline = release(DesignRequest.of("arm2", "pid")).artifact
    assert OperatingEnvelope.of(baseline) is None
    assert summary(baseline)["envelope"] is None


@pytest.mark.parametrize("kind", KINDS)
def test_when_the_border_of_a_set_is_drawn_expect_it_as_wide_as_the_bound_says(kind: str) -> None:
    """The bounds were computed from the whole matrix, the border from its block of one joint."""
    found = envelope(kind)
    for part in (found.box, found.torque, found.peak):
        for joint in range(2):
            width = np.abs(part.border(joint, 2.0, points=721)[:, 0]).max()
            assert width == pytest.approx(2.0 * part.angle_bound_rad[joint], rel=2e-3)


@pytest.mark.parametrize("kind", KINDS)
def test_when_the_stated_margin_is_used_expect_the_stated_levels_at_the_tightest_joint(kind: str) -> None:
    found = envelope(kind)
    for part in (found.box, found.peak):
        assert part.scale is not None
        largest = part.largest_scale(found.reference_margin_rad)
        assert (part.scale <= largest).all()
        assert part.scale.min() == pytest.approx(largest.min(), rel=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_when_the_envelope_is_drawn_expect_no_text_cut_or_over_another(kind: str) -> None:
    assert_readable(envelope_figure(replace(synthetic_result(Variant(kind), 2), envelope=envelope(kind))))


def test_when_the_run_has_an_envelope_expect_its_figure_in_the_gallery_and_else_none(tmp_path: Path) -> None:
    result = synthetic_result(Variant(KINDS[0]), 2, samples=200)
    assert not any(file.stem == "envelope" for file in write_gallery(result, tmp_path))
    with pytest.raises(ValueError, match="states no operating envelope"):
        envelope_figure(result)
    files = write_gallery(replace(result, envelope=envelope(KINDS[0])), tmp_path)
    assert sum(file.stem == "envelope" for file in files) == 1


@pytest.mark.full
def test_when_encoders_are_exact_expect_the_settled_run_in_its_peak_set_and_beyond_it_otherwise(
    tmp_path: Path,
) -> None:
    design = release(DesignRequest.of("arm3", "dob-acceleration", Specification())).artifact
    square = tracking_experiment("serial-square")
    for bits, is_inside in ((0, True), (20, False)):
        result = track(
            RunSetup(square, design, plant="perturbed", sensors=Sensors(encoder_bits=bits), log=False), tmp_path
        )
        assert result.envelope is not None
        peak_set, run = result.envelope.peak, result.run
        errors = np.stack(
            [run.true_angle_rad - run.reference_angle_rad, run.true_speed_rad_s - run.reference_speed_rad_s]
        )
        for joint in range(3):
            peak = np.abs(errors[0, :, joint]).max() / peak_set.angle_bound_rad[joint]
            settled = errors[:, run.time_s > 0.1, joint]
            sizes = np.linalg.norm(np.linalg.solve(np.linalg.cholesky(peak_set.covariance[joint]), settled), axis=0)
            assert (sizes.max() <= peak) == is_inside
