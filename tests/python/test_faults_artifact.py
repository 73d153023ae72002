"""Fault F8: a damaged artifact is refused, in process by the runtime and on the command line of both programs."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from quasilpv.artifact import write_artifact
from quasilpv.errors import InputError
from quasilpv.release import release
from quasilpv.synthesis import DEFAULT_CONTROLLER, DesignRequest, Specification
from two_processes import Experiment, finish

pytest_plugins = ["two_processes"]


def flipped(data: bytes, bit: int) -> bytes:
    damaged = bytearray(data)
    damaged[bit // 8] ^= 1 << bit % 8
    return bytes(damaged)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Both twins of the default design."""
    folder = tmp_path_factory.mktemp("default")
    write_artifact(folder, release(DesignRequest.of("arm3", DEFAULT_CONTROLLER, Specification())).artifact)
    return folder


@pytest.fixture(params=["artifact.json", "artifact.cbor"])
def twin(request: pytest.FixtureRequest, folder: Path) -> tuple[str, bytes]:
    """Name and content of a file that the runtime accepts."""
    data = (folder / request.param).read_bytes()
    parse(data, request.param)
    return request.param, data


def parse(data: bytes, name: str) -> None:
    pytest.importorskip("quasilpv._runtime").Artifact.parse(data, name)


@pytest.mark.parametrize("flips", [1000, pytest.param(20000, marks=pytest.mark.full)])
def test_F8_when_any_bit_of_the_default_artifact_is_flipped_expect_refusal_in_one_line(
    twin: tuple[str, bytes], flips: int
) -> None:
    name, data = twin
    for bit in random.Random(flips).sample(range(8 * len(data)), flips):
        with pytest.raises(InputError, match=rf"^{name}: .*got .*, expected ") as refusal:
            parse(flipped(data, bit), name)
        assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("stride", [37, pytest.param(1, marks=pytest.mark.full)])
def test_F8_when_the_default_artifact_is_truncated_at_any_byte_expect_refusal(
    twin: tuple[str, bytes], stride: int
) -> None:
    name, data = twin
    for size in range(0, len(data), stride):
        with pytest.raises(InputError):
            parse(data[:size], name)


@pytest.mark.parametrize("side", ["controller", "simulator"])
def test_F8_when_a_damaged_artifact_is_given_expect_exit_2_one_line_and_nothing_published(
    experiment: Experiment, side: str
) -> None:
    path = experiment.folder / "artifact.json"
    data = path.read_bytes()
    chance = random.Random(88)
    damages = [flipped(data, chance.randrange(8 * len(data))) for _ in range(25)]
    damages += [data[: chance.randrange(len(data))] for _ in range(5)]
    for damaged in damages:
        path.write_bytes(damaged)
        code, report, errors = finish(experiment.start(getattr(experiment, f"{side}_command")()))
        assert (code, report) == (2, {})
        assert len(errors.splitlines()) == 1
        assert str(path) in errors
