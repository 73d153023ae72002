"""Laws of general systems that estimate states: their documents, commands, runs, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quasilpv import _runtime
from quasilpv.artifact.system_store import read_system_artifact, write_system_artifact
from quasilpv.cli.app import run
from quasilpv.documents.strict_model import validate
from quasilpv.documents.system_artifact import SystemArtifactDocument
from quasilpv.errors import ClaimError, InfeasibleError, InputError
from quasilpv.experiments.processes import Talk
from quasilpv.experiments.system_grid import grid_check
from quasilpv.experiments.system_hil import require_identical, run_system_over_lcm
from quasilpv.experiments.system_run import SystemExperiment, scenario_of, simulate_scenario
from quasilpv.synthesis.regional.observer import SampledSlopes, unseen_modes
from quasilpv.synthesis.regional.request import RegionalRequest
from quasilpv.system_release import release_system
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.telemetry import LOG_NAME, read_log
from quasilpv.telemetry.replay import replay
from reference.observed_systems import OBSERVED, observed, with_observer
from reference.released_systems import EXAMPLES, changed, loaded, released
from two_processes import executable


def test_artifacts_from_before_there_were_observers_load_and_keep_their_hash(tmp_path: Path) -> None:
    new = released("two-tanks")
    content = {name: value for name, value in new.content().items() if name != "observer"}
    law = {name: value for name, value in content["law"].items() if name != "premise_fault_s"}
    old = changed(new)  # of version 2
    assert old.hash == new.hash
    old = validate(SystemArtifactDocument, {**content, "law": law, "schema_version": 1}, "old")
    assert "observer" not in old.content()
    path = write_system_artifact(tmp_path, old)[0]
    assert read_system_artifact(path) == old
    assert _runtime.SystemArtifact.load(str(path)).hash == old.hash
    with pytest.raises(InputError, match="observer"):
        validate(SystemArtifactDocument, {**content, "law": law, "schema_version": 1, "observer": None}, "old")
    with pytest.raises(InputError, match="observer"):
        validate(SystemArtifactDocument, content, "new")


@pytest.mark.parametrize(
    ("members", "words"),
    [
        ({"measured": ["h2", "h1"]}, "observer.measured"),
        ({"measured": ["u"]}, "observer.measured"),
        ({"gain": [[1.0, 0.0], [0.0, 1.0]]}, "observer.gain"),
        ({"lyapunov": [[1.0, 0.0], [0.0, -1.0]]}, "observer.lyapunov"),
        ({"start": [0.0]}, "observer.start"),
        ({"weight": 0.0}, "observer.weight"),
    ],
)
def test_an_observer_that_does_not_fit_is_refused_by_its_field(members: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        with_observer(observed("two-tanks"), **members)


def test_the_commands_take_measured_states_from_the_file_to_a_run_and_its_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    tanks = str(EXAMPLES / "systems/two_tanks.py:two_tanks")
    asked = ["--decay", "0.05", "--input-limit", "u=0.006", "--rate-hz", "10", "--measured", "h2"]
    assert run(["synth", tanks, *asked, "--start-estimate", "h1=0.27", "-o", "out/tanks"]) == 0
    said = capsys.readouterr().out
    assert "h1 0.27" in said
    path = "out/tanks/artifact.json"
    assert run(["verify", path, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["verified"] is True
    assert run(["inspect", path, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["observer"]
    assert told["measured"] == ["h2"]
    assert told["start"] == {"h1": pytest.approx(0.27)}
    assert 0.0 < told["largest_error"]["h1"] < 0.15
    arguments = ["simulate", path, "--start", "h1=0.26", "--start", "h2=0.23", "--json", "-o", "out/run"]
    assert run(arguments) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["largest_error"] == {"h1": pytest.approx(0.01)}
    assert abs(answer["final_error"]["h1"]) < 1e-4
    assert answer["largest_level"] <= answer["start_level"] < 1.0
    assert run(["simulate", path, "--start", "h1=0.38", "-o", "out/far"]) == 0
    assert "estimates start too far" in capsys.readouterr().err
    capsys.readouterr()
    assert run(["log", "replay", f"out/run/{LOG_NAME}"]) == 0
    assert {path.name for path in Path("out/run").iterdir()} >= {"signals.png", "region.png"}


def test_over_lcm_every_sample_is_that_of_one_process_and_the_log_has_the_estimates(tmp_path: Path) -> None:
    for program in ("qlpv-controller", "qlpv-simulator"):
        executable(program)
    artifact = observed("two-tanks")
    scenario = scenario_of(artifact, SystemExperiment({"h1": 0.26, "h2": 0.23}, {}, 20.0, noise={"h2": 1e-4}), "test")
    over_lcm = run_system_over_lcm(artifact, scenario, tmp_path, Talk("lockstep"))
    alone = simulate_scenario(artifact, scenario, "test")
    require_identical(over_lcm.run, alone)
    assert list(alone.estimation_error) == ["h1"]
    assert np.abs(alone.estimation_error["h1"]).max() == pytest.approx(0.01)
    log = read_log(tmp_path / LOG_NAME)
    told = log["measurement"].samples["value"]
    assert (told[:, 0] == 0.0).all()  # h1, which is not measured
    assert (told[:, 1] != 0.0).all()
    heard = log["telemetry"].samples
    np.testing.assert_array_equal(heard["measured"][:, 0], alone.measured[heard["seq"], 0])
    shown = replay(log)
    assert shown.first_difference is None
    assert shown.compared > 0.9 * shown.samples


def test_a_missing_measurement_holds_the_input_and_what_is_not_measured_is_not_missed() -> None:
    artifact = observed("two-tanks")
    controller = _runtime.SystemController(loaded(artifact))
    first = controller.step([0.0, 0.23], [])
    missed = controller.step([0.25, float("nan")], [])
    assert missed["flags"] == 1
    assert missed["input"] == first["input"]
    assert controller.step([float("nan"), 0.23], [])["flags"] == 0  # what is not measured is not missed


@pytest.mark.parametrize(
    ("asked", "error", "words"),
    [
        ({"measured": ("h3",)}, InputError, "measured: got h3"),
        ({"measured": ("h1", "h2")}, InputError, "every differential state"),
        ({"measured": ("h1", "h1")}, InputError, "each name once"),
        ({"measured": ("h2",), "start_estimate": {"h2": 0.2}}, InputError, "start estimate: got h2"),
        ({"start_estimate": {"h2": 0.2}}, InputError, "no state is estimated"),
    ],
)
def test_what_cannot_be_measured_or_estimated_is_refused(asked: dict[str, Any], error: type, words: str) -> None:
    with pytest.raises(error, match=words):
        RegionalRequest(OBSERVED["two-tanks"][0](), **asked)


def test_outputs_stand_for_the_states_that_they_show() -> None:
    def tanks(outputs: list[str]) -> DescriptorSystem:
        return DescriptorSystem.from_equations(
            ["h1' = -h1 + u", "h2' = h1 - h2"],
            state="h1 h2",
            inputs="u",
            outputs=outputs,
            domain={"h1": (-1, 1), "h2": (-1, 1)},
            name="tanks",
        )

    assert RegionalRequest(tanks(["2*h2"]), measured=("outputs",)).measured == ("h2",)
    with pytest.raises(InputError, match="output 2 of 2"):
        RegionalRequest(tanks(["h2", "h1 + h2"]), measured=("outputs",))


def test_points_of_the_region_are_checked_with_estimates_that_are_exact() -> None:
    found = grid_check(observed("two-tanks"), points=40)
    assert found.passed


def test_a_state_that_no_measurement_tells_of_is_named() -> None:
    cart = DescriptorSystem.from_equations(
        ["p' = v", "v' = u", "w' = -w + u"],
        state="p v w",
        inputs="u",
        domain={"p": (-1, 1), "v": (-1, 1), "w": (-1, 1)},
        name="cart",
    )
    with pytest.raises(InfeasibleError, match="measure p too"):
        release_system(RegionalRequest(cart, decay_rate=0.3, input_limits={"u": 3.0}, measured=("v",)))


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize(
    ("measured", "missing"),
    [("v", "p"), ("pv", ""), ("p", ""), ("a", "p"), ("w", "p"), ("vw", "p"), ("s", "p"), ("ps", "")],
)
def test_whether_a_state_is_seen_does_not_depend_on_rounding(measured: str, missing: str, seed: int) -> None:
    """p' = v, v' = a + s, a' = 0 (a is told, or an integrator), w' = -w + a, s' = -2 s: in changing units, rounded."""
    rng, names = np.random.default_rng(seed), "pvaws"
    A = np.array([[0, 1, 0, 0, 0], [0, 0, 1, 0, 1], [0, 0, 0, 0, 0], [0, 0, 1, -1, 0], [0, 0, 0, 0, -2.0]])
    units = np.diag(10.0 ** rng.uniform(-4, 4, 5))
    shape = rng.normal(size=(5, 5)) + 5.0 * np.eye(5)
    region = units @ shape @ shape.T @ units
    root = np.linalg.cholesky(region)
    slope = units @ A @ np.linalg.inv(units)
    slope = root @ (np.linalg.inv(root) @ slope @ root) @ np.linalg.inv(root)  # what rounding makes of it
    samples = SampledSlopes(region, tuple(name in measured for name in names), slope[None], slope[None], 0.5)
    found = "".join(names[k] for k in unseen_modes(samples))
    assert found == missing


def test_a_premise_of_an_algebraic_state_is_refused_by_name() -> None:
    singular = DescriptorSystem.from_equations(
        ["x' = -x + a + u", "v' = x", "0 = a + a^3 - x"],
        state="x v a",
        inputs="u",
        domain={"x": (-1, 1), "v": (-1, 1), "a": (-1, 1)},
        name="singular",
    )
    with pytest.raises(InputError, match="premises of differential states"):
        RegionalRequest(singular, measured=("v",))


def test_a_rate_that_is_too_slow_is_refused_with_one_that_is_not() -> None:
    make, asked = OBSERVED["two-tanks"]
    with pytest.raises(ClaimError, match="10 Hz would be"):
        release_system(RegionalRequest(make(), **{**asked, "rate_hz": 2.0}))
