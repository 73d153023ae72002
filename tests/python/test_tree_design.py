"""The chain for robots in space: bounds of the inertia, design, gate from the artifact alone, and what is refused."""

from copy import deepcopy
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from flint import fmpq

from quasilpv.artifact import Artifact
from quasilpv.certificate import gate, shipped, verify
from quasilpv.certificate.gate.margin import inertia_margin
from quasilpv.certificate.gate.proof import RobustGate, growth_rates
from quasilpv.certificate.laws.dob_acceleration import loop_data
from quasilpv.certificate.robot.tree import TreeData
from quasilpv.certificate.robot.tree_range import TreePair
from quasilpv.errors import ClaimError, InputError
from quasilpv.release import checked_artifact
from quasilpv.synthesis import DesignRequest, specification_for, synthesise
from quasilpv.synthesis.acceleration.sampled_loop import AccelerationLaw, SampledLoop
from quasilpv.synthesis.chain_range import find_range
from quasilpv.synthesis.tracking_design import TrackingDesign
from reference.tree_artifacts import small_robot


@cache
def designed() -> TrackingDesign:
    """For the small robot with friction, at 5 % torque activity."""
    robot = small_robot(coulomb_nm=0.3)
    return synthesise(DesignRequest(robot, "dob-acceleration", specification_for(robot, torque_activity=0.05)))


@cache
def released() -> Artifact:
    """The same with its evidence."""
    return checked_artifact(designed())


def content() -> dict[str, Any]:
    return deepcopy(dict(released().content()))


def test_when_a_robot_in_space_is_designed_for_expect_a_proved_artifact_without_programs() -> None:
    artifact = released()
    assert artifact.programs == {}
    assert artifact.law.feedback.ki == 0.0  # Coulomb friction is stated
    assert artifact.verification is not None
    found = artifact.verification["gate"]
    assert found["passed"]
    assert found["proved"]
    assert artifact.verification["certificate"]["verified"]
    assert found["needed_range"][0] < found["sampled_range"][0]
    assert found["sampled_range"][1] < found["needed_range"][1] < 1.02 * found["sampled_range"][1]
    # The design inertia is s times the empty robot's, so that the lower bound is tight.
    scale = artifact.verification["report"]["inertia_scale"]
    assert found["needed_range"][0] == pytest.approx(1.0 / scale, rel=1e-5)


def test_when_the_robot_does_not_stick_expect_integral_action() -> None:
    robot = small_robot()
    made = synthesise(DesignRequest(robot, "dob-acceleration", specification_for(robot, torque_activity=0.05)))
    assert made.law["feedback"]["ki"] < 0.0


def test_when_ratios_are_sampled_expect_them_inside_the_proved_range() -> None:
    robot = small_robot(links=0.1, rotors=0.2)
    found = find_range(robot, robot.tree)
    rng = np.random.default_rng(3)
    low, high = np.array(robot.domain.angle_rad).T
    q = rng.uniform(low, high, (500, 3))
    inverse = np.linalg.inv(np.linalg.cholesky(robot.tree.inertia(q)))
    for true in (robot.lightest(), *robot.heaviest(), robot.loaded(0.3)):
        ratios = np.linalg.eigvalsh(inverse @ true.inertia(q) @ inverse.transpose(0, 2, 1))
        assert found.lowest.bound < ratios.min()
        assert ratios.max() < found.highest.bound


def test_when_the_checker_samples_expect_the_extremes_of_the_trees_themselves() -> None:
    document, robot = content(), small_robot(coulomb_nm=0.3)
    pair = TreePair(TreeData.of(shipped(document)))
    scale = document["verification"]["report"]["inertia_scale"]
    q = np.array([[0.3, -0.8, 1.1], [0.0, 1.0, -0.4]])
    inverse = np.linalg.inv(np.linalg.cholesky(scale * robot.tree.inertia(q)))
    heavy = [np.linalg.eigvalsh(inverse @ t.inertia(q) @ inverse.transpose(0, 2, 1))[:, -1] for t in robot.heaviest()]
    np.testing.assert_allclose(pair.ratios(q, "highest"), np.max(heavy, axis=0), rtol=1e-12)
    np.testing.assert_allclose(pair.ratios(q, "lowest"), 1.0 / scale, rtol=1e-12)


@pytest.mark.parametrize(("side", "factor"), [("highest", 0.995), ("lowest", 1.005)])
def test_when_a_bound_lies_inside_the_sampled_range_expect_it_refused(side: str, factor: float) -> None:
    document = content()
    pair = TreePair(TreeData.of(shipped(document)))
    sampled = pair.sampled[0 if side == "lowest" else 1].inertia_ratio
    document["witness"]["chain"][side]["bound"] = factor * sampled
    found = gate(document)
    assert isinstance(found, RobustGate)
    assert found.needed is None
    assert not found.passed
    assert not verify(document).verified


@pytest.mark.parametrize(
    ("change", "claim"),
    [
        (lambda d: d["payloads"]["load"].update(mass_kg=2.0), "inertia"),
        (lambda d: d["payloads"]["load"].update(com_box_m=[[-0.2, 0.2], [0.0, 0.0], [0.02, 0.06]]), "inertia"),
        (lambda d: d["payloads"].update(link_tolerance=0.3), "inertia"),
        (lambda d: d["payloads"].update(rotor_tolerance=[0.0, 0.0, 0.9]), "inertia"),
        (lambda d: d["robot"]["parameters"]["joints"][1].update(mass_kg=9.0), "inertia"),
        (lambda d: d["law"]["inertia"]["joints"][2].update(rotor_inertia_kg_m2=1e-3), "inertia"),
        (lambda d: d["law"]["inertia"].update(gravity_m_s2=[0.0, 0.0, -9.0]), "gravity"),
        (lambda d: d["law"]["gravity_load"].update(first_moment_kg_m=[0.1, 0.0, 0.0]), "gravity"),
    ],
)
def test_when_an_artifact_contradicts_its_proof_expect_the_claim_to_fail(change: Any, claim: str) -> None:
    document = content()
    change(document)
    found = verify(document)
    assert not found.verified
    assert any(name.startswith(claim) for name in found.failed)


def test_when_the_laws_chain_moves_otherwise_or_the_witness_is_missing_expect_a_refusal() -> None:
    document = content()
    document["law"]["inertia"]["joints"][1]["translation_m"] = [0.0, 0.1, 0.05]
    with pytest.raises(InputError, match=r"law.inertia.joints\[1\].translation_m"):
        gate(document)
    document = content()
    del document["witness"]["chain"]
    with pytest.raises(InputError, match=r"witness\.chain"):
        gate(document)
    document = content()
    document["witness"]["chain"]["lowest"]["storages"].pop()
    with pytest.raises(InputError, match=r"witness\.chain"):
        gate(document)


def test_when_there_is_no_integral_action_expect_the_exact_loop_to_have_the_roots_of_the_designs_own() -> None:
    document = content()
    data = loop_data(shipped(document))
    law = AccelerationLaw(
        data.sample_period_s,
        np.array([data.kp, data.kd, data.ki]),
        np.array(data.observer),
        data.filter_time_constant_s,
    )
    assert data.ki == 0.0
    for delay in (0.0, 0.5, 1.25):
        loop = SampledLoop(law, delay * 1e-3)
        ratios = np.array([0.7, 1.0, 1.6])
        exact = growth_rates(data, fmpq(*delay.as_integer_ratio()), ratios)
        np.testing.assert_allclose(exact, [loop.growth_rate(1.0 / ratio) for ratio in ratios], rtol=1e-6, atol=1e-4)
    margin, found = inertia_margin(data, fmpq(1, 2)), SampledLoop(law, 5e-4).inertia_margin()
    assert margin is not None
    assert found is not None
    np.testing.assert_allclose(margin.to_floats(), found, rtol=1e-4)


def test_when_a_controller_is_planar_expect_a_refusal() -> None:
    robot = small_robot()
    with pytest.raises(InputError, match=r"one for robots in space: .*dob-acceleration"):
        synthesise(DesignRequest.of(robot, "dob-torque"))


def test_when_the_delay_of_the_robot_is_longer_expect_the_gate_asked_for_it() -> None:
    robot = replace(small_robot(), delay_s=(0.0, 1.2e-3))
    assert specification_for(robot).delay_samples == pytest.approx(1.2)
    assert specification_for(robot).torque_activity == 0.02
    assert specification_for(small_robot()).delay_samples == 0.5


def test_when_torque_limits_cannot_carry_the_load_expect_the_release_refused() -> None:
    robot = small_robot(coulomb_nm=0.3)
    weak = replace(robot, joints=tuple(replace(joint, torque_nm=5.0) for joint in robot.joints))
    with pytest.raises(ClaimError, match="torque limit"):
        checked_artifact(replace(designed(), robot=weak))
