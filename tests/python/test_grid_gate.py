"""The gate of torque-level laws: its loops against the law run sample by sample, its verdicts, and the command line."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flint import fmpq

from quasilpv.arrays import FloatArray
from quasilpv.artifact import Artifact, write_artifact
from quasilpv.certificate import gate
from quasilpv.certificate.gate.grid import GridGate, growth_curves
from quasilpv.cli import run
from quasilpv.documents.canonical import canonical_json, with_hash
from quasilpv.errors import InputError
from quasilpv.figures.growth import growth_figure
from quasilpv.polytopes import BlockPolytope
from quasilpv.release import release
from quasilpv.synthesis import DesignRequest, Specification
from quasilpv.systems.robots.registry import robot
from reference.checked import frozen_torque_law, grid_gate, vertex_table
from reference.step import DobTorque, OutputStage, Sample

Document = dict[str, Any]

RATE_HZ = 4000.0
ANSWER = {
    "passed": bool,
    "proved": bool,
    "evidence": str,
    "inertia_margin": list,
    "delay_margin_s": float,
    "needed_range": list,
    "worst_growth_rate_per_s": float,
    "where": dict,
    "growth_rates_per_s": dict,
    "inertia_factors": list,
    "grid": dict,
}


@cache
def kept() -> Document:
    return release(DesignRequest.of("arm2", "dob-torque", Specification(rate_hz=RATE_HZ))).artifact.content()


def document() -> Document:
    return copy.deepcopy(kept())


@cache
def verdict() -> GridGate:
    return grid_gate(kept())


# ---- the loop, from the formulas -------------------------------------------------------------------------------------


def scheduled(table: Document, z: float) -> FloatArray:
    """X(z) of a table with one premise."""
    (low,), (high,) = table["lower"], table["upper"]
    below, above = map(np.array, table["blocks"][0]["vertices"])
    share = (z - low) / (high - low)
    return np.asarray((1.0 - share) * below + share * above)


class FrozenArm:
    """The law of an artifact of arm2, frozen at a posture, and the arm with a payload under its torque."""

    def __init__(self, content: Document, theta: FloatArray, fraction: float, delay_samples: float) -> None:
        self.law, self.T, z = content["law"], content["sample_period_s"], float(np.cos(theta[1]))
        self.M, self.K, self.L = (scheduled(self.law[name], z) for name in ("inertia", "feedback", "observer"))
        self.mobility = np.linalg.inv(robot("arm2").with_payload_fraction(fraction).inertia(theta))
        self.late = delay_samples * self.T

    def step(self, state: FloatArray) -> FloatArray:
        """State: theta, omega, the law's four estimates, d_f, e_I, and the torque of the sample before, 2 each."""
        theta, omega, held = state[0:2], state[2:4], state[16:18]
        controller = DobTorque(
            lambda y: self.K,
            lambda y: self.L,
            self.law["filter_time_constant_s"],
            lambda y: self.M,
            lambda y: np.zeros(2),
            OutputStage(np.full(2, 1e15), np.full(2, 1e21), self.T),
            x=state[4:12],
            d_f=state[12:14],
            integral=state[14:16],
        )
        zero = np.zeros(2)
        torque = controller.step(Sample(theta, zero, zero, zero, zero)).torque_applied
        for duration, acting in ((self.late, held), (self.T - self.late, torque)):
            pull = self.mobility @ acting
            theta, omega = theta + duration * omega + duration**2 / 2 * pull, omega + duration * pull
        assert controller.x is not None
        assert controller.d_f is not None
        assert controller.integral is not None
        return np.concatenate([theta, omega, controller.x, controller.d_f, controller.integral, torque])

    def growth_rate(self) -> float:
        """From the map whose columns are the unit states after one sample, its units balanced."""
        units = np.repeat([1, self.T**-1, 1, self.T**-1, self.T**-2, self.T**-3, self.T**-2, self.T, self.T**-2], 2)
        columns = np.array([self.step(unit) for unit in np.diag(units)]).T / units[:, None]
        return float(np.log(np.abs(np.linalg.eigvals(columns)).max()) / self.T)


@pytest.mark.parametrize("delay_samples", [0.0, 0.5])
def test_when_the_written_law_is_run_from_every_unit_state_expect_the_growth_rates_of_the_gate(
    delay_samples: float,
) -> None:
    plants = verdict().plants
    for fraction, loop in plants.loops(delay_s=delay_samples / RATE_HZ):
        rates = loop.growth_rates()
        for row in range(0, len(rates), 21):
            arm = FrozenArm(kept(), plants.angles[row], fraction, delay_samples)
            assert rates[row] == pytest.approx(arm.growth_rate(), rel=1e-4)


def test_when_a_loop_the_gate_calls_unstable_is_simulated_expect_it_to_grow_at_the_reported_rate() -> None:
    fast = document()
    fast["sample_period_s"] *= 4.0
    found = grid_gate(fast)
    worst, delay_s = found.worst_case
    assert worst.growth_rate_per_s > 0.0
    arm = FrozenArm(fast, np.array(worst.angle_rad), worst.payload_fraction, delay_s / fast["sample_period_s"])
    state, growth = np.full(18, 1e-6), []
    for _ in range(1500):
        state = arm.step(state)
        size = float(np.linalg.norm(state[:2]))
        growth.append(np.log(size / 1e-6))
        state = state * (1e-6 / size)  # the loop is linear, the output stage far from its limits
    # A growing oscillation: the average over many of its periods.
    assert np.mean(growth[300:]) / arm.T == pytest.approx(worst.growth_rate_per_s, rel=1e-3)


def test_when_inertias_are_rebuilt_from_the_artifact_expect_the_robots_own() -> None:
    plants, arm2 = verdict().plants, robot("arm2")
    law = frozen_torque_law(kept(), plants.angles)
    scale = kept()["verification"]["report"]["inertia_scale"]
    for row, theta in enumerate(plants.angles):
        np.testing.assert_allclose(law.inertia[row], scale * arm2.model.inertia(theta), rtol=1e-12)
        for fraction, inertia in plants.inertia.items():
            own = arm2.with_payload_fraction(fraction).inertia(theta)
            np.testing.assert_allclose(inertia[row], own, rtol=1e-12)


@pytest.mark.parametrize("partition", [[[0, 1, 2]], [[0], [1], [2]], [[2], [0, 1]]])
def test_when_a_table_is_evaluated_expect_the_polytope_of_the_design_and_clamping_outside(
    partition: list[list[int]],
) -> None:
    rng = np.random.default_rng(3)
    polytope = BlockPolytope.grouped([-1.0, 0.0, 2.0], [1.0, 0.5, 3.0], partition)
    vertices = rng.normal(size=(sum(2 ** len(block) for block in partition), 2, 3))
    table = vertex_table(polytope.to_document(vertices))
    points = rng.uniform([-1.5, -0.2, 1.5], [1.5, 0.7, 3.5], size=(50, 3))
    weights = polytope.weights(polytope.saturate(points)[0])
    np.testing.assert_allclose(table.evaluate(points), np.tensordot(weights, vertices, axes=1), atol=1e-12)


# ---- the verdict -----------------------------------------------------------------------------------------------------


def test_when_the_gate_answers_expect_exactly_the_documented_members_and_no_claim_of_a_proof() -> None:
    answer = verdict().to_document()
    assert {key: type(value) for key, value in answer.items()} == ANSWER
    assert (answer["passed"], answer["proved"]) == (True, False)
    assert answer["where"].keys() == {"angle_rad", "payload_fraction", "delay_s"}
    assert answer["worst_growth_rate_per_s"] == max(answer["growth_rates_per_s"].values()) < 0.0
    json.dumps(answer, allow_nan=False)


def test_when_limits_are_reported_expect_stability_inside_and_none_just_outside() -> None:
    found, delay = verdict(), verdict().specified_delay_s
    assert found.factors is not None
    low, high = found.factors
    assert low < 1.0 < high
    for inside, outside in ((low, low / 1.01), (high, high * 1.01)):
        assert found.plants.is_stable(inside, delay)
        assert not found.plants.is_stable(outside, delay)
    margin = found.delay_margin_s
    assert margin is not None
    assert margin > delay
    assert found.plants.is_stable(delay_s=margin)
    assert not found.plants.is_stable(delay_s=margin + 0.01 / RATE_HZ)


def test_when_the_specified_delay_is_beyond_the_margin_expect_no_pass() -> None:
    margin = verdict().delay_margin_s
    assert margin is not None
    for beyond, passed in ((-0.01, True), (0.01, False)):
        samples = margin * RATE_HZ + beyond
        assert grid_gate(kept(), delay_samples=fmpq(*samples.as_integer_ratio())).passed is passed


def test_when_a_delay_between_the_steps_is_specified_expect_it_tried() -> None:
    found = grid_gate(kept(), delay_samples=fmpq(77, 100))
    assert found.passed
    assert found.specified_delay_s == pytest.approx(0.77 / RATE_HZ)


def faster(content: Document) -> None:
    """Gains for four times the rate."""
    content["sample_period_s"] *= 4.0


def stiffer(content: Document) -> None:
    """One number of one vertex."""
    content["law"]["feedback"]["blocks"][0]["vertices"][1][0][0] *= 20.0


def heavier(content: Document) -> None:
    content["payloads"]["mass_scale"] = [1.0, 30.0]


def lighter_table(content: Document) -> None:
    """The observer's model of the robot: a twentieth of the inertia."""
    for vertex in content["law"]["inertia"]["blocks"][0]["vertices"]:
        vertex[:] = [[entry / 20.0 for entry in row] for row in vertex]


CHANGES: tuple[Callable[[Document], None], ...] = (faster, stiffer, heavier, lighter_table)


@pytest.mark.parametrize("change", CHANGES)
def test_when_a_number_is_changed_and_the_hash_made_again_expect_exit_1(
    change: Callable[[Document], None], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    changed = document()
    change(changed)
    file = tmp_path / "artifact.json"
    file.write_bytes(canonical_json(with_hash(changed)))
    assert run(["robust", str(file), "--json"]) == 1
    answer = json.loads(capsys.readouterr().out)
    assert (answer["passed"], answer["proved"]) == (False, False)
    assert answer["worst_growth_rate_per_s"] > 0.0
    assert answer["inertia_factors"] is None
    assert run(["robust", str(file)]) == 1
    assert "NOT passed: a loop of the grid is not stable" in capsys.readouterr().out


def test_when_a_premise_leaves_its_box_expect_the_field_named() -> None:
    narrow = document()
    for name in ("inertia", "feedback", "observer"):
        narrow["law"][name]["upper"][0] = 0.9
    with pytest.raises(InputError, match="box of premise 0"):
        grid_gate(narrow)


def test_when_a_law_has_no_gate_expect_those_that_have_one_named() -> None:
    with pytest.raises(InputError, match=r"pid.*dob-acceleration, dob-torque"):
        gate(release(DesignRequest.of("arm2", "pid")).artifact.content())


# ---- the command and the figure --------------------------------------------------------------------------------------


def test_when_the_command_checks_a_design_expect_exit_0_its_json_and_a_figure(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_artifact(tmp_path, Artifact.from_document(kept()))[0]
    assert run(["robust", str(path), "--json", "-o", str(tmp_path)]) == 0
    assert json.loads(capsys.readouterr().out) == verdict().to_document()
    assert {file.name for file in tmp_path.glob("growth-rate.*")} == {"growth-rate.png"}
    assert run(["robust", str(path)]) == 0
    assert "a grid check, not a proof" in capsys.readouterr().out


def test_when_growth_is_drawn_expect_one_curve_per_delay_that_crosses_zero_at_the_limits() -> None:
    curves = growth_curves(verdict(), points=9)
    assert [curve.delay_s * RATE_HZ for curve in curves] == pytest.approx([0.0, 0.5, 1.0])
    specified = curves[1]
    assert verdict().factors is not None
    low, high = verdict().factors or (0.0, 0.0)
    inside = (specified.factors > low) & (specified.factors < high)
    assert (specified.rates_per_s[inside] < 0.0).all()
    assert (specified.rates_per_s[~inside] > 0.0).all()
    axes = growth_figure(verdict(), curves).axes[0]
    drawn = [line for line in axes.get_lines() if len(line.get_xdata()) == 9]  # type: ignore[arg-type]
    assert len(drawn) == 3
