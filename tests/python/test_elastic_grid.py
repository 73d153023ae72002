"""Laws of elastic joints that claim nothing: `design robust` looks at a grid again, from the artifact alone."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quasilpv.arrays import FloatArray
from quasilpv.artifact import Artifact, write_artifact
from quasilpv.certificate import Evidence, gate, verify
from quasilpv.certificate.gate import elastic_grid
from quasilpv.certificate.gate.elastic_grid import ElasticGridGate, ElasticLoopPoint
from quasilpv.certificate.gate.two_mass import Exclusion
from quasilpv.cli import run
from quasilpv.errors import InputError
from quasilpv.figures.gate import gate_figure
from quasilpv.loops.elastic_loop import ElasticPlant, MotorLaw, growth_rate
from quasilpv.release import checked_artifact
from quasilpv.synthesis import DesignRequest, synthesise
from quasilpv.synthesis.elastic import motor_pid
from quasilpv.synthesis.elastic.arms import links_of
from quasilpv.systems.robots.spatial_robot import SpatialRobot
from reference.elastic_robots import elastic_ur5

ROBOT = elastic_ur5(uncertainty=2.0)


@pytest.fixture(scope="module")
def gridded() -> Iterator[Artifact]:
    """A `motor-pid` none of whose gains is proved."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(motor_pid, "POSTURES", 4)
        patch.setattr(elastic_grid, "POSTURES", 3)
        patch.setattr(motor_pid.TwoMassExclusion, "decide", lambda _: Exclusion(False, True, 1, 100.0))
        yield checked_artifact(synthesise(DesignRequest.of(ROBOT, "motor-pid")))


def expected_rates(robot: SpatialRobot, content: dict[str, Any], loop: ElasticLoopPoint) -> list[float]:
    """Of a loop of the grid, from the robot itself, which the gate has never seen; one per corner of the load."""
    law = content["law"]
    gains, B, K = (np.array(law[name]) for name in ("observer", "rotor_inertia_kg_m2", "stiffness_nm_rad"))
    kp, kd, ki = (law["feedback"][name] for name in ("kp", "kd", "ki"))
    correction, source = law["correction_bandwidth_rad_s"], law["correction_source"]
    frozen = MotorLaw(1e-3, np.array([kp, kd, ki]), gains, B, K, correction, source)
    drives = [joint.drive for joint in robot.joints if joint.drive is not None]
    pull = np.array([drive.stiffness_nm_rad[int(loop.gears == "stiffest")] for drive in drives])
    drag = pull * np.array([drive.damping_least_s for drive in drives])

    def links(tree: Any) -> FloatArray:
        return np.asarray(links_of(tree).inertia(loop.angle_rad[None])[0])

    trees = robot.heaviest() if loop.loaded else (robot.lightest(),)
    return [growth_rate(frozen, ElasticPlant(links(tree), loop.rotors * B, pull, drag), loop.delay_s) for tree in trees]


def test_when_nothing_is_proved_expect_a_grid_again_whose_loops_are_the_robots(gridded: Artifact) -> None:
    assert gridded.witness is None
    assert gridded.verification is not None
    assert gridded.verification["report"]["evidence"] == "gridded"
    assert "gate" not in gridded.verification
    with pytest.raises(InputError, match=r"witness: .*gridded"):
        verify(gridded)
    found = gate(gridded)
    assert isinstance(found, ElasticGridGate)
    assert found.passed
    assert found.evidence is Evidence.SAMPLED
    assert {loop.delay_s for loop in found.loops} == {0.0, 5e-4}
    assert {(loop.loaded, loop.gears) for loop in found.loops} == {
        (loaded, gears) for loaded in (False, True) for gears in ("softest", "stiffest")
    }
    for loop in found.loops[:: len(found.loops) // 7]:
        rates = expected_rates(ROBOT, gridded.content(), loop)
        assert min(abs(loop.growth_rate_per_s - rate) for rate in rates) < 1e-6
    assert gate_figure(found).axes


def test_when_a_person_asks_expect_numbers_of_a_grid_and_no_word_of_a_proof(
    gridded: Artifact, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_artifact(tmp_path, gridded)
    assert run(["robust", str(tmp_path / "artifact.json")]) == 0
    said = capsys.readouterr().out
    assert "passed: numerical (grid): stable at every point of the grid" in said
    assert "proved" not in said
    assert run(["robust", str(tmp_path / "artifact.json"), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["proved"] is False
    assert answer["what"] == "numerical (grid)"


def test_when_a_loop_of_the_grid_is_unstable_expect_the_gate_not_passed_and_where(
    gridded: Artifact, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    content = copy.deepcopy(gridded.content())
    content["law"]["feedback"]["kd"] = -3000.0
    broken = Artifact.from_document(content)
    found = gate(broken)
    assert isinstance(found, ElasticGridGate)
    assert not found.passed
    document = found.to_document()
    assert document["worst_growth_rate_per_s"] == max(loop.growth_rate_per_s for loop in found.loops) > 0.0
    assert len(document["where"]["angle_rad"]) == 6
    write_artifact(tmp_path, broken)
    assert run(["robust", str(tmp_path / "artifact.json")]) == 1
    assert "NOT passed: numerical (grid): a loop of the grid is not stable" in capsys.readouterr().out
