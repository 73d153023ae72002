"""`dob-acceleration` for arms whose drives control the torque in their joints: proved on condition, links read."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quasilpv import _runtime
from quasilpv.artifact import Artifact
from quasilpv.certificate import gate, verify
from quasilpv.certificate.gate.proof import RobustGate
from quasilpv.cli.robust import _answer
from quasilpv.documents.canonical import canonical_json
from quasilpv.errors import InputError
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import track
from quasilpv.release import checked_artifact
from quasilpv.scenarios.registry import tracking_experiment
from quasilpv.synthesis import DesignRequest, default_controller, synthesise
from reference.elastic_robots import elastic_ur5

T = 1e-3
ROBOT = elastic_ur5(side="both", uncertainty=2.0, torque_loop=True)


@cache
def designed() -> Artifact:
    return checked_artifact(synthesise(DesignRequest.of(ROBOT, default_controller(ROBOT))))


def changed(path: tuple[str, ...], value: Any) -> Artifact:
    content = designed().content()
    member = content
    for name in path[:-1]:
        member = member[name]
    member[path[-1]] = value
    return Artifact.from_document(content)


def test_when_drives_control_torques_expect_the_default_law_proved_on_condition() -> None:
    artifact = designed()
    assert artifact.law.kind == "dob-acceleration"
    assert artifact.law.angle_side == "link"
    assert artifact.verification is not None
    report = artifact.verification["report"]
    assert report["evidence"] == "proved on condition"
    assert report["worst_elastic_growth_rate_per_s"] < 0.0
    assert verify(artifact).verified
    found = gate(artifact)
    assert isinstance(found, RobustGate)
    assert found.passed
    assert "whatever the link does" in found.to_document()["on_condition"]
    assert _answer(found)[1].endswith("whatever the link does")


def test_when_the_gain_of_the_torque_loops_is_another_expect_the_range_refused() -> None:
    """With the whole rotors in the links' equations the inertia leaves the range that is claimed."""
    verdict = verify(changed(("payloads", "torque_gain"), 1.0))
    assert any("M_t" in name for name in verdict.failed)


def test_when_encoders_sit_on_both_sides_expect_the_law_to_read_the_links() -> None:
    def runtime(artifact: Artifact) -> _runtime.Controller:
        return _runtime.Controller(_runtime.Artifact.parse(canonical_json(artifact.to_document()), "test"))

    law = {name: member for name, member in designed().content()["law"].items() if name != "angle_side"}
    reading, plain = runtime(designed()), runtime(changed(("law",), law))
    rng, zero = np.random.default_rng(3), np.zeros(6)
    for k in range(20):
        link = 0.1 + 1e-4 * rng.normal(size=6)
        motor = link + 1e-3
        gears = {"link_angle_rad": link, "motor_angle_rad": motor}
        both = reading.step(motor, zero + 0.1, zero, zero, zero, k, gears=gears)
        alone = plain.step(link, zero + 0.1, zero, zero, zero, k)
        np.testing.assert_array_equal(both.torque_applied, alone.torque_applied)


def test_when_gears_give_inside_torque_loops_expect_a_stable_run(tmp_path: Path) -> None:
    setup = RunSetup(
        tracking_experiment("ur5-circle").by(ROBOT), designed(), plant="perturbed", transport_delay_s=T / 2, log=False
    )
    metrics = track(setup, tmp_path).metrics
    assert metrics.rms_tool_m < 1.2e-3
    assert metrics.share_at_limit == 0.0


def test_when_a_joint_of_the_arm_is_rigid_expect_it_refused_by_name() -> None:
    first, *others = ROBOT.joints
    with pytest.raises(InputError, match=r"shoulder_pan\.stiffness: got rigid"):
        synthesise(DesignRequest.of(replace(ROBOT, joints=(replace(first, drive=None), *others)), "dob-acceleration"))
