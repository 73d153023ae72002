"""What leaves the project in files and objects of other tools says the same there."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
from scipy.io import loadmat

import quasilpv as ql
from quasilpv.cli.app import run
from quasilpv.errors import InputError
from quasilpv.exchange import arrays_of, frozen
from quasilpv.release import release
from quasilpv.synthesis import DesignRequest
from quasilpv.system_chain import SystemController


def pendulum() -> ql.DescriptorSystem:
    return ql.DescriptorSystem.from_equations(
        ["x' = v", "v' = 9*sin(x) - d*v + u", "y = x + v"],
        name="pendulum",
        state="x v y",
        inputs="u",
        domain={"x": (-1, 1), "v": (-3, 3), "d": (0, 1)},
        unknown="d",
    )


@cache
def made() -> SystemController:
    return ql.stabilise(pendulum(), decay_rate=1.0, input_limits={"u": 30.0})


def read(path: Path) -> dict[str, Any]:
    if path.suffix == ".npz":
        return dict(np.load(path))
    if path.suffix == ".mat":
        return dict(loadmat(str(path)))
    return dict(json.loads(path.read_text(encoding="utf-8")))


@pytest.mark.parametrize("suffix", [".npz", ".mat", ".json"])
def test_the_arrays_of_a_controller_are_read_back_as_they_are(suffix: str, tmp_path: Path) -> None:
    found = read(ql.export(made(), tmp_path / f"law{suffix}"))
    for name, value in arrays_of(made()).items():
        if isinstance(value, np.ndarray):
            assert np.array_equal(np.asarray(found[name]).reshape(value.shape), value)


def test_the_vertices_of_a_file_give_the_input_of_the_run_time(tmp_path: Path) -> None:
    found = read(ql.export(made(), tmp_path / "law.npz"))
    simulation = made().simulate(start={"x": 0.2, "v": 0.1}, duration_s=0.01)
    x = np.array([0.2, 0.1])
    values = pendulum().premise_values([0.2, 0.1, 0.3], {"d": 0.5})  # of d the gain does not depend
    weights = []
    for v, low, high in zip(values, found["premise_lower"], found["premise_upper"], strict=True):
        share = (v - low) / (high - low)
        weights += [(1 - share) / len(found["block_sizes"]), share / len(found["block_sizes"])]
    K = np.tensordot(weights, found["gain_vertices"], axes=1)
    assert simulation.run.input[0] == pytest.approx(K @ x, rel=1e-9)


def test_the_law_of_an_answer_and_the_artifact_of_a_robot_can_be_exported(tmp_path: Path) -> None:
    answer = ql.solve(pendulum(), "II.5", representation="uncertain", decay_rate=1.0)
    assert answer.law is not None
    found = read(ql.export(answer.law, tmp_path / "law.mat"))
    assert np.array_equal(found["gain_vertices"].reshape(answer.law.vertices.shape), answer.law.vertices)
    artifact = release(DesignRequest.of("arm2", "pid")).artifact
    found = read(ql.export(artifact, tmp_path / "robot.npz"))
    assert found["kp"].tolist() == list(artifact.law.kp)
    assert found["inertia_vertices"].shape[1:] == (2, 2)


def at_rest(damping: float) -> dict[str, float]:
    """The premises at x = 0, by name."""
    values = pendulum().premise_values([0.0, 0.0, 0.0], {"d": damping})
    return dict(zip(made().artifact.model.names, values.tolist(), strict=True))


def test_a_frozen_system_is_the_linearisation_of_its_equations() -> None:
    artifact = made().artifact
    A, B = frozen(artifact, at_rest(0.25))
    assert pytest.approx(np.array([[0, 1], [9, -0.25]])) == A
    assert pytest.approx(np.array([[0], [1]])) == B
    space = ql.state_space(made(), at_rest(0.25))
    assert isinstance(space, control.StateSpace)
    assert sorted(space.poles().real) == pytest.approx(sorted(np.linalg.eigvals(A).real))
    closed = ql.state_space(made(), at_rest(0.25), closed=True)
    assert closed.poles().real.max() < -1.0  # the decay rate that was asked for


def test_what_cannot_be_exported_is_said_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(InputError, match="format: got txt, expected one of npz, mat, json"):
        ql.export(made(), tmp_path / "law.txt")
    with pytest.raises(InputError, match="premise: got q"):
        ql.state_space(made(), {"q": 1.0})
    path = made().write(tmp_path / "out")
    assert run(["export", str(path), "-o", str(tmp_path / "law.mat")]) == 0
    assert loadmat(str(tmp_path / "law.mat"))["gain_vertices"].shape[1:] == (1, 2)
    assert run(["export", str(path), "-o", str(tmp_path / "law"), "--format", "csv"]) == 2
    assert capsys.readouterr().err.count("\n") == 2


def test_a_controller_is_what_its_file_says(tmp_path: Path) -> None:
    again = ql.controller(made().write(tmp_path))
    assert again.artifact == made().artifact
    assert again.verify().verified
    assert "SystemController(pendulum" in repr(again)
    assert "<table>" in again._repr_html_()
    assert len(repr(again).splitlines()) <= 10
    assert len(repr(again.simulate(start={"x": 0.1})).splitlines()) <= 10


def test_a_run_plots_itself_and_refuses_other_names() -> None:
    simulation = made().simulate(start={"x": 0.1}, duration_s=0.05)
    assert simulation.plot("region").axes
    with pytest.raises(InputError, match="plot: name: got torque"):
        simulation.plot("torque")
    with pytest.raises(InputError, match="option: got decay"):
        ql.stabilise(pendulum(), decay=1.0)  # type: ignore[call-arg]
