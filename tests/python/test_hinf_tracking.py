"""The law `hinf-tracking` from condition to gate: the reduced theorem, what its checker proves, and what is shipped."""

from __future__ import annotations

import copy
import importlib
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quasilpv.arrays import FloatArray
from quasilpv.certificate import gate, verify
from quasilpv.certificate import shipped as read_shipped
from quasilpv.certificate.exact.matrices import rational
from quasilpv.certificate.laws.hinf_tracking import unknown_terms
from quasilpv.conditions.tracking.iii10 import tracking_condition
from quasilpv.conditions.tracking.iii10_reduced import UnknownTorques, reduced_tracking_condition
from quasilpv.documents.canonical import canonical_json, with_hash
from quasilpv.errors import ClaimError, InfeasibleError
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import track
from quasilpv.polytopes import BlockPolytope
from quasilpv.release import release
from quasilpv.scenarios import Sensors, tracking_experiment
from quasilpv.synthesis import DesignRequest, Specification, hinf
from quasilpv.synthesis.hinf import friction_bound_nm_s, hinf_tracking, unknown_torques
from quasilpv.synthesis.torque.schedule import full_schedule
from quasilpv.systems.robots.registry import robot
from reference.checked import frozen_hinf_law, inequalities
from reference.mutants import BLOCKS, Mutant

Document = dict[str, Any]

RATE_HZ = 4000.0
POINTS = 2000
CONDITION = "quasilpv.conditions.tracking.iii10_reduced"


@cache
def kept(robot_id: str = "arm2") -> Document:
    return release(DesignRequest.of(robot_id, "hinf-tracking", Specification(rate_hz=RATE_HZ))).artifact.content()


# ---- the reduced theorem ---------------------------------------------------------------------------------------------


def test_when_the_theorem_is_reduced_expect_the_optimum_of_its_statement_with_slack_matrices() -> None:
    # (2 + z) w' = u + d - delta w with z in [-1, 1] measured and |delta| <= 1.5 unknown
    polytope = BlockPolytope.uncertain(([-1.0], [1.0]), ([-1.5], [1.5]))
    constant = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    none = np.zeros((3, 3))
    literal = tracking_condition(
        polytope.vertices(np.diag([1.0, 2.0, 1.0]), [np.diag([0.0, 1.0, 0.0]), none]),
        polytope.vertices(constant, [none, np.diag([0.0, -1.0, 0.0])]),
        np.array([[0.0], [1.0], [0.0]]),
        np.array([[1.0, 0.0, 0.0]]),
        decay=0.3,
        gain_limit=100.0,
        blocks=polytope.block_index,
        shared_gain=polytope.shared_gain,
    )
    unknown = UnknownTorques(np.ones((1, 1)), np.array([[0.0, 1.0, 0.0]]), np.array([1.5]))
    known = BlockPolytope.takagi_sugeno([-1.0], [1.0])
    inertia = known.vertices([[2.0]], [[[1.0]]])
    reduced = reduced_tracking_condition(inertia, unknown, decay=0.3, gain_limit=100.0)
    best, expected = reduced.problem.solve(), literal.problem.solve()
    assert best.objective == pytest.approx(expected.objective, rel=1e-3)
    without = reduced_tracking_condition(inertia, replace(unknown, radius=np.zeros(1)), decay=0.3, gain_limit=100.0)
    assert without.problem.solve().objective < 0.9 * best.objective  # the unknown term does cost something


@pytest.mark.parametrize("robot_id", ["arm2", "arm3"])
def test_when_states_and_payloads_are_drawn_expect_the_torque_as_a_sum_of_unknown_terms_within_bounds(
    robot_id: str,
) -> None:
    arm = robot(robot_id)
    unknown, n = unknown_torques(arm), arm.model.joints
    rng = np.random.default_rng(3)
    for _ in range(200):
        plant = arm.with_payload_fraction(rng.uniform())
        friction = rng.uniform(-friction_bound_nm_s(arm), friction_bound_nm_s(arm), n)
        theta = rng.uniform(*np.array(arm.domain.angle_rad).T)
        omega = rng.uniform(*np.array(arm.domain.speed_rad_s).T)
        alpha, W = np.cumsum(theta), np.cumsum(omega)
        D, g = plant.inertia_constants, plant.gravity_constants
        pairs = [(k, j) for k in range(n) for j in range(n) if k != j]
        delta = [D[k, j] * np.sin(alpha[k] - alpha[j]) * W[j] for k, j in pairs]
        delta += [*(g * np.sin(alpha) / alpha), *friction]
        assert (np.abs(delta) <= unknown.radius * (1 + 1e-12)).all()
        torque = unknown.torque.T @ (np.array(delta) * (unknown.state @ np.concatenate([theta, omega, np.zeros(n)])))
        np.testing.assert_allclose(
            torque, plant.coriolis(theta, omega) + plant.gravity(theta) + friction * omega, rtol=1e-10, atol=1e-9
        )


def test_when_the_checker_bounds_the_unknown_terms_itself_expect_those_of_the_design() -> None:
    for robot_id in ("arm2", "arm3", "fivebar"):
        arm = robot(robot_id)
        content = release(DesignRequest.of(robot_id, "pid", Specification())).artifact.content()
        terms, unknown = unknown_terms(read_shipped(content), rational(friction_bound_nm_s(arm))), unknown_torques(arm)
        assert len(terms) == len(unknown.radius)
        for k, term in enumerate(terms):
            assert float(term.radius.p) / float(term.radius.q) == pytest.approx(unknown.radius[k], rel=1e-14)
            assert [int(b.p) for b in term.torque.entries()] == unknown.torque[k].tolist()
            assert [int(c.p) for c in term.state.entries()] == unknown.state[k].tolist()


# ---- what is certified -----------------------------------------------------------------------------------------------


def gain_at(law: Document, M: FloatArray, Y: FloatArray) -> FloatArray:
    """``Y E^-T P^-1`` by explicit inverses."""
    n = M.shape[-1]
    E = np.tile(np.eye(3 * n), (len(M), 1, 1))
    E[:, n : 2 * n, n : 2 * n] = M
    return np.asarray(Y @ np.linalg.inv(np.array(law["lyapunov"]) @ E))


def test_when_points_of_the_box_and_unknown_torques_are_drawn_expect_decay_l2_gain_and_gain_limit() -> None:
    content = kept()
    law, claim = content["law"], content["witness"]["feedback"]
    rng = np.random.default_rng(5)
    table = law["inertia"]
    share = rng.uniform(size=POINTS)
    share[:200] = rng.integers(0, 2, 200)
    M, Y = (
        np.array([(1 - s) * low + s * high for s in share])
        for low, high in (np.array(law[name]["blocks"][0]["vertices"]) for name in ("inertia", "numerator"))
    )
    assert table["premises"] == 1
    n, K = M.shape[-1], gain_at(law, M, Y)
    unknown = unknown_torques(robot("arm2"))
    delta = rng.choice([-1.0, 1.0], size=(POINTS, len(unknown.radius))) * unknown.radius
    torque = K - np.einsum("pk,ki,kj->pij", delta, unknown.torque, unknown.state)
    eye, none = np.broadcast_to(np.eye(n), M.shape), np.zeros_like(M)
    system = np.block([[none, eye, none], [np.linalg.inv(M) @ torque], [eye, none, none]])
    R = np.linalg.inv(np.linalg.cholesky(np.array(law["lyapunov"])))
    fast = R @ system @ np.linalg.inv(R)  # V = |R xi|^2
    assert np.linalg.eigvalsh((fast + fast.swapaxes(1, 2)) / 2)[:, -1].max() <= -claim["decay_per_s"] * (1 - 1e-9)
    drive = np.concatenate([none, np.linalg.inv(M), none], axis=1)
    for frequency in np.geomspace(0.1, 1e4, 40):
        response = np.linalg.solve(1j * frequency * np.eye(3 * n) - system, drive)[:, :n]
        assert np.linalg.norm(response, ord=2, axis=(1, 2)).max() ** 2 <= claim["gamma"]
    scale = np.repeat([1.0, claim["bandwidth_rad_s"], 1.0 / claim["bandwidth_rad_s"]], n)
    light = np.maximum(1.0, claim["inertia_unit_kg_m2"] * np.linalg.norm(np.linalg.inv(M), ord=2, axis=(1, 2)))
    assert (np.linalg.norm(K * scale, ord=2, axis=(1, 2)) < claim["gain_limit"] * light).all()


def changed(change: Callable[[Document], None]) -> Document:
    document = copy.deepcopy(kept())
    change(document)
    return document


def scale_numerator(document: Document) -> None:
    vertices = document["law"]["numerator"]["blocks"][0]["vertices"]
    vertices[0] = (-np.array(vertices[0])).tolist()


CHANGES: dict[str, Callable[[Document], None]] = {
    "decay and L2 gain": scale_numerator,
    "decay rate": lambda document: document["witness"]["feedback"].update(decay_per_s=-1.0),
    "feedback: P": lambda document: document["law"]["lyapunov"][0].__setitem__(0, 0.0),
    "gain limit: P": lambda document: document["witness"]["feedback"].update(beta=1e3),
    "gain limit: Y": lambda document: document["witness"]["feedback"].update(gain_limit=1.0),
    "gamma": lambda document: document["witness"]["feedback"].update(gamma=1e-14),
    "friction": lambda document: document["witness"]["feedback"].update(friction_nm_s=1e4),
    "speeds": lambda document: document["domain"]["speed_rad_s"][0].__setitem__(1, 1e4),
}


@pytest.mark.parametrize("name", CHANGES)
def test_when_a_number_of_the_artifact_is_changed_expect_the_claim_it_matters_for_to_fail(name: str) -> None:
    assert verify(kept()).verified
    failed = verify(changed(CHANGES[name])).failed
    of_the_bounded_real = name in ("gamma", "friction", "speeds")
    assert any(("decay and L2 gain" if of_the_bounded_real else name) in claim for claim in failed)


# ---- errors planted in the builder -----------------------------------------------------------------------------------

FIRST_ROW = "[decreasing, constant(B), E[i] @ P @ C.T, E[i] @ P @ unknown.state.T]"
MUTANTS = (
    Mutant("11 closed loop sign", "E[i].T + B @ Y[i])", "E[i].T - B @ Y[i])"),
    Mutant("11 chain", "he(A @ P @ E[i].T + B @ Y[i])", "he(B @ Y[i])"),
    Mutant("11 inertia", "he(A @ P @ E[i].T + B", "he(A @ P + B"),
    Mutant("11 decay", " + (E[i] @ P @ E[i].T) * (2 * decay)", ""),
    Mutant("11 decay sign", " + (E[i] @ P @ E[i].T) * (2 * decay)", " - (E[i] @ P @ E[i].T) * (2 * decay)"),
    Mutant("11 unknown", "decreasing + multiplier * np.outer(b, b)", "decreasing"),
    Mutant("11 unknown sign", "decreasing + multiplier", "decreasing - multiplier"),
    Mutant("12", FIRST_ROW, FIRST_ROW.replace("constant(B)", "zeros(size, n)")),
    Mutant("13", FIRST_ROW, FIRST_ROW.replace("E[i] @ P @ C.T", "zeros(size, n)")),
    Mutant("14", FIRST_ROW, FIRST_ROW.replace("E[i] @ P @ unknown.state.T", "zeros(size, terms)")),
    Mutant("14 inertia", FIRST_ROW, FIRST_ROW.replace("E[i] @ P @ unknown", "P @ unknown")),
    Mutant("22", "-(gamma * one), zeros(n, n)", "-(gamma * one) - one, zeros(n, n)"),
    Mutant("33", "constant(-one), zeros(n, terms)", "constant(-2 * one), zeros(n, terms)"),
    Mutant("44", "None, -multipliers]", "None, multipliers * -2]"),
    Mutant("gain limit", "limit = beta * gain_limit", "limit = beta * (3 * gain_limit)"),
    Mutant("gain limit, P", "P - beta * states", "P"),
    Mutant("sum", 'problem.negative(f"{name} {i}"', 'i and problem.negative(f"{name} {i}"', BLOCKS),
)
BANDWIDTH, MUTANT_DECAY, MUTANT_FRICTION = 24.0, 0.3, 60.0


def shipped(module: Any) -> Document:
    """What a builder, wrong or not, leads to on arm2 with much friction."""
    arm = robot("arm2")
    chosen, unknown = full_schedule(arm), unknown_torques(arm)
    unknown.radius[-arm.model.joints :] = MUTANT_FRICTION
    unit = 4.0
    condition = module.reduced_tracking_condition(
        chosen.inertia / unit, unknown.in_units(BANDWIDTH, unit), decay=MUTANT_DECAY, gain_limit=60.0
    )
    solution = condition.problem.solve_inside(0.02)
    assert solution.values, "this error leaves nothing to ship: plant another"
    point = condition.point(solution).scaled(BANDWIDTH, unit, unknown)

    def ship(document: Document) -> None:
        document["law"]["numerator"] = chosen.polytope.to_document(point.Y)
        document["law"]["lyapunov"] = point.P.tolist()
        document["witness"]["feedback"] = {
            "decay_per_s": point.decay,
            "gamma": point.gamma,
            "gain_limit": point.gain_limit,
            "beta": point.beta,
            "bandwidth_rad_s": point.rate,
            "inertia_unit_kg_m2": point.inertia_unit,
            "friction_nm_s": MUTANT_FRICTION,
            "tau": point.tau.tolist(),
        }

    return changed(ship)


def holds(document: Document) -> bool:
    return all(claim.holds for claim in inequalities(document))


def test_when_the_builder_is_right_expect_the_checker_to_agree() -> None:
    assert holds(shipped(importlib.import_module(CONDITION)))


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: mutant.block)
def test_when_the_builder_errs_expect_the_checker_to_refuse(monkeypatch: pytest.MonkeyPatch, mutant: Mutant) -> None:
    assert not holds(shipped(mutant.loaded(monkeypatch, CONDITION)))


# ---- the gate and the shipped law ------------------------------------------------------------------------------------


def test_when_the_law_is_frozen_expect_the_gain_of_the_formula() -> None:
    content = kept()
    angles = np.random.default_rng(2).uniform(*np.array(content["domain"]["angle_rad"]).T, size=(50, 2))
    law = frozen_hinf_law(content, angles)
    table = content["law"]["inertia"]
    omega = (np.cos(angles[:, 1]) - table["lower"][0]) / (table["upper"][0] - table["lower"][0])
    M, Y = (
        np.array([(1 - w) * low + w * high for w in omega])
        for low, high in (np.array(content["law"][name]["blocks"][0]["vertices"]) for name in ("inertia", "numerator"))
    )
    K = gain_at(content["law"], M, Y)
    frozen = -np.concatenate([law.proportional, law.derivative, law.integral], axis=2)
    np.testing.assert_allclose(frozen, K, rtol=1e-9)


def test_when_a_design_is_released_expect_its_gate_passed_and_not_called_a_proof() -> None:
    found = kept()["verification"]["gate"]
    assert found["passed"] is True
    assert found["proved"] is False
    assert found["worst_growth_rate_per_s"] < 0.0
    fast = changed(lambda document: document["law"].update(velocity_filter_time_constant_s=0.02))
    assert not gate(fast).passed


def test_when_the_bound_on_friction_is_that_of_the_robot_expect_a_design_for_the_five_bar(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With the 10 N m s of the arms, 2500 times its inertia per second, no gain of this size passes the gate."""
    specification, entry = Specification(rate_hz=RATE_HZ, disturbance_frequency_rad_s=50.0), robot("fivebar")
    content = release(DesignRequest.of("fivebar", "hinf-tracking", specification)).artifact.content()
    assert content["verification"]["certificate"]["verified"]
    assert content["verification"]["gate"]["passed"]
    assert content["witness"]["feedback"]["friction_nm_s"] == friction_bound_nm_s(entry)
    monkeypatch.setattr(hinf, "FRICTION_BOUNDS_NM_S", {})
    with pytest.raises(InfeasibleError):
        hinf_tracking(entry, specification)


def test_when_the_robot_holds_a_spring_expect_a_refusal() -> None:
    with pytest.raises(InfeasibleError, match="know gravity, no spring"):
        hinf_tracking(robot("spring-disc"), Specification(rate_hz=RATE_HZ))


@pytest.mark.full
def test_when_the_arm_tracks_the_square_expect_millimetres_and_both_twins_of_the_artifact(tmp_path: Path) -> None:
    arm = robot("arm3")  # whose drives are too slow for what noise makes of this law's torque at this rate
    with pytest.raises(ClaimError, match="slew limit of joint 0"):
        release(DesignRequest.of(arm, "hinf-tracking", Specification(rate_hz=RATE_HZ)))
    fast = replace(arm, limits=replace(arm.limits, slew_nm_per_s=tuple(2.0 * own for own in arm.limits.slew_nm_per_s)))
    artifact = release(DesignRequest.of(fast, "hinf-tracking", Specification(rate_hz=RATE_HZ))).artifact
    assert canonical_json(artifact.to_document()) == canonical_json(with_hash(artifact.content()))
    experiment = tracking_experiment("serial-square")
    for plant in ("nominal", "perturbed"):
        result = track(RunSetup(experiment, artifact, plant=plant, sensors=Sensors()), tmp_path / plant)  # type: ignore[arg-type]
        assert max(result.metrics.rms_x_m, result.metrics.rms_y_m) < 8e-3
