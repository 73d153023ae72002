"""The bindings: canonical bytes equal in both languages, exceptions of the package, trajectory and closed loop."""

from __future__ import annotations

import json
import math
import struct
import threading
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from quasilpv import _runtime
from quasilpv.documents.canonical import canonical_cbor, canonical_json, parse_document, with_hash
from quasilpv.errors import InputError, PlantError
from quasilpv.scenarios import build_scenario
from quasilpv.systems.robots.registry import robot
from quasilpv.trajectories import serial_circle
from reference.random_arms import artifact_bytes, random_arm


def from_bits(bits: int) -> float:
    return float(struct.unpack("<d", struct.pack("<Q", bits))[0])


# Uniform over bit patterns: subnormals, huge and tiny exponents, long mantissas; and numbers on the edges of encodings.
any_double = st.integers(0, 2**64 - 1).map(from_bits).filter(math.isfinite)
edges = st.sampled_from(
    [0.0, -0.0, 5e-324, 2.2250738585072014e-308, 1.7976931348623157e308, 1e21, 1e-7, 9.999999999999999e20, 1e-6]
    + [float(2**53 + step) for step in (-2, -1, 0, 2)]
    + [65504.0, 65505.0, 5.960464477539063e-8, 3.4028234663852886e38, 0.1, 1 / 3, 1.5, -23.0, 255.0, 65536.0]
)
numbers = any_double | edges | edges.map(lambda x: -x) | st.integers(-(2**53) + 1, 2**53 - 1)
keys = st.text(st.characters(max_codepoint=127), max_size=8)
documents = st.dictionaries(
    keys,
    st.recursive(
        st.none() | st.booleans() | numbers | st.text(max_size=12),
        lambda inner: st.lists(inner, max_size=5) | st.dictionaries(keys, inner, max_size=5),
        max_leaves=30,
    ),
    max_size=6,
)


@given(documents)
@example({"a": 1e21, "b": 1e-7, "": -0.0, "\x7f": "\U0001f600 ü \x1f"})
@settings(max_examples=500)
def test_when_a_document_is_random_expect_the_same_canonical_bytes_in_both_languages(document: dict[str, Any]) -> None:
    assert _runtime.canonical_json(document) == canonical_json(document)
    assert _runtime.canonical_cbor(document) == canonical_cbor(document)


@given(documents)
@settings(max_examples=300)
def test_when_a_document_is_hashed_expect_both_twins_to_parse_to_one_tree_in_both_languages(
    document: dict[str, Any],
) -> None:
    hashed = with_hash(document)
    for data in (canonical_json(hashed), canonical_cbor(hashed)):
        assert _runtime.parse_document(data, "twin") == parse_document(data, "twin") == hashed


@given(st.binary(max_size=64) | st.binary(max_size=64).map(lambda tail: b"{" + tail))
@settings(max_examples=300)
def test_when_bytes_are_junk_expect_both_languages_to_refuse_them(data: bytes) -> None:
    for parse in (_runtime.parse_document, parse_document):
        with pytest.raises(InputError):
            parse(data, "junk")


@pytest.mark.parametrize("document", [{"a": math.nan}, {"a": math.inf}, {"ü": 1}, {"a": object()}, {1: 2}, {"a": b"x"}])
def test_when_a_tree_is_outside_the_data_model_expect_both_languages_to_refuse_it(document: dict[Any, Any]) -> None:
    for encode in (_runtime.canonical_json, canonical_json, _runtime.canonical_cbor, canonical_cbor):
        with pytest.raises(InputError):
            encode(document)


def test_when_a_tree_contains_itself_expect_an_error_and_no_crash() -> None:
    tree: dict[str, Any] = {}
    tree["self"] = tree
    with pytest.raises(InputError, match="levels"):
        _runtime.canonical_json(tree)


def test_when_a_file_is_missing_expect_the_input_error_of_the_package_with_its_parts() -> None:
    with pytest.raises(InputError) as caught:
        _runtime.Artifact.load("missing/artifact.json")
    assert caught.value.source == "missing/artifact.json"
    assert str(caught.value) == (
        f"missing/artifact.json: {caught.value.field}: got {caught.value.got}, expected {caught.value.expected}"
    )


def test_when_a_trajectory_is_evaluated_expect_both_languages_to_agree() -> None:
    planned = serial_circle(robot("arm3").model)
    loaded = _runtime.Trajectory.parse(canonical_json(planned.to_document()))
    assert (loaded.name, loaded.joints, loaded.hash) == (planned.name, planned.joints, planned.hash)
    assert loaded.duration_s == planned.duration_s
    rng = np.random.default_rng(3)
    for time_s in (-1.0, 0.0, *rng.uniform(0, planned.duration_s, 1000), planned.duration_s, 10.0):
        for mine, theirs in zip(loaded.evaluate(time_s), planned.evaluate(time_s), strict=True):
            np.testing.assert_allclose(mine, theirs, rtol=1e-12, atol=1e-11)


def closed_loop_inputs(rk4_step_sizes: int = 1) -> tuple[_runtime.Artifact, _runtime.Trajectory, _runtime.Scenario]:
    """The nominal arm under computed torque."""
    arm3 = robot("arm3")
    law = {
        "kind": "ctc",
        "gp": [6661.98] * 3,
        "gd": [141.3717] * 3,
        "gi": [1.04646e5] * 3,
        "velocity_filter_time_constant_s": 2e-3,
        "disturbance_observer_bandwidth_rad_s": 0.0,
    }
    planned = serial_circle(arm3.model)
    scenario = build_scenario(arm3, planned, plant="nominal").to_document()
    scenario["integrator"] = {"kind": "rk4", "steps_per_sample": rk4_step_sizes}
    return (
        _runtime.Artifact.parse(artifact_bytes(arm3.model, law, arm3.limits.to_document())),
        _runtime.Trajectory.parse(canonical_json(planned.to_document())),
        _runtime.Scenario.parse(json.dumps(scenario).encode()),
    )


def test_when_the_loop_is_run_twice_expect_identical_columns_of_one_row_per_sample() -> None:
    inputs = closed_loop_inputs()
    first, second = _runtime.run_closed_loop(*inputs), _runtime.run_closed_loop(*inputs)
    assert first.keys() == second.keys()
    np.testing.assert_allclose(first["time_s"], np.arange(3000) * 1e-3, rtol=0, atol=1e-12)
    for name, column in first.items():
        assert column.shape in ((3000,), (3000, 3)), name
        np.testing.assert_array_equal(column, second[name], err_msg=name)


def test_when_the_loop_runs_in_one_thread_expect_another_thread_to_make_progress() -> None:
    inputs = closed_loop_inputs(rk4_step_sizes=200)
    started, ticks = threading.Event(), 0

    def simulate() -> None:
        started.set()
        _runtime.run_closed_loop(*inputs)

    thread = threading.Thread(target=simulate)
    thread.start()
    started.wait()
    while thread.is_alive():
        ticks += 1
        thread.join(timeout=1e-3)
    assert ticks > 5


def test_when_controller_and_trajectory_differ_in_joints_expect_one_line() -> None:
    _, trajectory, scenario = closed_loop_inputs()
    arm, _ = random_arm(2, np.random.default_rng(0))
    gains = {name: [1.0, 1.0] for name in ("gp", "gd", "gi")}
    law = {"kind": "ctc", **gains, "velocity_filter_time_constant_s": 1e-3, "disturbance_observer_bandwidth_rad_s": 0.0}
    data = artifact_bytes(arm, law, {"torque_nm": [1e3] * 2, "slew_nm_per_s": [1e6] * 2})
    with pytest.raises(InputError, match="joints"):
        _runtime.run_closed_loop(_runtime.Artifact.parse(data), trajectory, scenario)


def test_when_the_plant_leaves_the_finite_numbers_expect_the_plant_error_of_the_package() -> None:
    artifact, trajectory, _ = closed_loop_inputs()
    arm3 = robot("arm3")
    scenario = build_scenario(arm3, serial_circle(arm3.model)).to_document()
    scenario["integrator"] = {"kind": "rk4", "steps_per_sample": 1}
    scenario["initial"]["speed_rad_s"] = [1e15, 0.0, 0.0]
    with pytest.raises(PlantError):
        _runtime.run_closed_loop(artifact, trajectory, _runtime.Scenario.parse(json.dumps(scenario).encode()))
