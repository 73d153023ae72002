"""Every number of every document is finite and bounded, and both languages draw the same line."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterator
from typing import Any, TypeAlias

import numpy as np
import pytest

from quasilpv import _runtime
from quasilpv.artifact import Artifact
from quasilpv.documents.canonical import canonical_json, parse_strict_json, with_hash
from quasilpv.errors import InputError
from quasilpv.scenarios import Rk4Integrator, Scenario, SineTorque, build_scenario
from quasilpv.systems.robots.registry import robot
from quasilpv.trajectories import Trajectory, rest, serial_square
from reference.artifacts import LAWS, arm3_document
from test_scenarios import five_bar_document, spring_disc_document

Path: TypeAlias = tuple[str | int, ...]

EXTREMES = (1e308, -1e308, 1e101, 1e100, 1e99, 1e13, 1e12, 1e11, 1e6, -1.0, 0.0, 1e-11, 1e-13, 1e-99, 1e-101, 5e-324)
FEW = (1e308, 1e99, -1.0, 0.0)
FREE = {"payloads", "parameters", "witness", "verification", "task"}
"""Members that nobody reads at run time: anything may be in there."""


def numbers(tree: Any, path: Path = ()) -> Iterator[Path]:
    """Where the numbers of a document are; of long arrays the first and the last."""
    if isinstance(tree, dict):
        for key, member in tree.items():
            if key not in FREE:
                yield from numbers(member, (*path, key))
    elif isinstance(tree, list):
        for i in sorted({*range(min(len(tree), 3)), len(tree) - 1} & {*range(len(tree))}):
            yield from numbers(tree[i], (*path, i))
    elif isinstance(tree, int | float) and not isinstance(tree, bool):
        yield path


def replaced(tree: Any, path: Path, value: float) -> Any:
    changed = copy.deepcopy(tree)
    parent = changed
    for key in path[:-1]:
        parent = parent[key]
    parent[path[-1]] = value
    return changed


def refusal(read: Callable[[], object]) -> str | None:
    """The line of a refusal, None if it is accepted."""
    try:
        read()
    except InputError as error:
        return str(error).replace("\n", "a second line")
    return None


def scenario_documents() -> dict[str, Any]:
    arm = robot("arm3")
    square = build_scenario(
        arm,
        serial_square(arm.model),
        integrator=Rk4Integrator(),
        external_torque=(SineTorque(joint=0, amplitude_nm=1.0, frequency_rad_s=2.0, phase_rad=0.5),),
        torque_limit_nm=(1.0, 2.0, 3.0),
    ).to_document()
    square["sensors"]["velocity_filter_time_constant_s"] = 1e-3
    ida = build_scenario(arm, serial_square(arm.model)).to_document()
    documents = {"square": square, "ida": ida, "five-bar": five_bar_document(), "disc": spring_disc_document()}
    return {name: json.loads(json.dumps(document)) for name, document in documents.items()}


def hashed(document: Any) -> bytes:
    return canonical_json(with_hash({key: value for key, value in document.items() if key != "hash"}))


def readers(kind: str, document: Any) -> tuple[Callable[[], object], Callable[[], object]]:
    """How Python and C++ read a document."""
    if kind == "scenario":
        data = json.dumps(document).encode()
        return lambda: Scenario.from_document(document), lambda: _runtime.Scenario.parse(data)
    data = hashed(document)
    if kind == "trajectory":
        return lambda: Trajectory.from_document(json.loads(data)), lambda: _runtime.Trajectory.parse(data)
    return lambda: Artifact.from_document(document), lambda: _runtime.Artifact.parse(data)


def require_agreement(kind: str, document: Any, values: tuple[float, ...]) -> None:
    for path in fields(document):
        for value in values:
            python, cpp = (refusal(read) for read in readers(kind, replaced(document, path, value)))
            assert (python is None) == (cpp is None), (path, value, python, cpp)


@pytest.mark.parametrize("name", scenario_documents())
def test_both_languages_refuse_the_same_numbers_of_a_scenario(name: str) -> None:
    document = scenario_documents()[name]
    assert readers("scenario", document)[0]() is not None
    require_agreement("scenario", document, EXTREMES if name == "square" else FEW)
    for path in fields(document):
        for value in (1e308, -1e308, 1.1e16):
            assert refusal(readers("scenario", replaced(document, path, value))[0]) is not None, (path, value)


def fields(tree: Any) -> list[Path]:
    """Where the numbers of a document are, the last one of every field: indices of arrays aside, each name once."""
    return list({tuple(key for key in path if isinstance(key, str)): path for path in numbers(tree)}.values())


@pytest.mark.parametrize("kind", LAWS)
def test_both_languages_refuse_the_same_numbers_of_an_artifact(kind: str) -> None:
    document = json.loads(json.dumps(arm3_document(kind)))
    assert [refusal(read) for read in readers("artifact", document)] == [None, None]
    law_only = kind != "pid"  # the rest is the same for all
    for path in fields(document):
        if law_only and path[0] != "law":
            continue
        for value in FEW if law_only else EXTREMES:
            python, cpp = (refusal(read) for read in readers("artifact", replaced(document, path, value)))
            assert (python is None) == (cpp is None), (path, value, python, cpp)


def test_both_languages_refuse_the_same_numbers_of_a_trajectory() -> None:
    trajectory = rest("rest", 2, 1.0)
    document = json.loads(json.dumps(trajectory.to_document()))
    require_agreement("trajectory", document, EXTREMES)


@pytest.mark.parametrize("before", [b"\xef\xbb\xbf", b"\x00", b"\xff\xfe", b" ", b"\n\t"])
def test_both_languages_refuse_the_same_bytes_before_a_document(before: bytes) -> None:
    data = before + json.dumps(scenario_documents()["ida"]).encode()
    python = refusal(lambda: parse_strict_json(data, "scenario.json"))
    cpp = refusal(lambda: _runtime.Scenario.parse(data, "scenario.json"))
    assert (python is None) == (cpp is None) == (not before.strip()), (python, cpp)


def test_when_a_run_is_shorter_than_a_sample_or_longer_than_memory_expect_one_line() -> None:
    artifact = _runtime.Artifact.parse(hashed(arm3_document()))
    trajectory = _runtime.Trajectory.parse(hashed(rest("rest", 3, 1.0).to_document()))
    document = scenario_documents()["ida"]
    for duration, expected in ((1e-4, "at least one sample"), (8.6e4, "a shorter run")):
        scenario = _runtime.Scenario.parse(json.dumps({**document, "duration_s": duration}).encode())
        line = refusal(lambda scenario=scenario: _runtime.run_closed_loop(artifact, trajectory, scenario))  # type: ignore[misc]
        assert line is not None
        assert expected in line
    assert np.isfinite(artifact.sample_period_s)
