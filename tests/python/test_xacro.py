"""Xacro: evaluated only where its reader says that it is trusted, once, into a URDF that is read like any other."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from quasilpv.cli import run
from quasilpv.descriptions.robot_file import read_description
from quasilpv.descriptions.xacro import expanded
from quasilpv.errors import InputError

DATA = Path(__file__).parents[1] / "data/robots"
NAMES = ("two_links.urdf.xacro", "rod.xacro")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    for name in NAMES:
        shutil.copy(DATA / name, tmp_path / name)
    return tmp_path / NAMES[0]


def test_a_trusted_file_is_evaluated_into_a_urdf_beside_the_robot_file(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = file.parent / "made/robot.toml"
    assert run(["robot", "show", str(file), "--trust-xacro", "--tip", "flange", "-o", str(out)]) == 0
    assert "2 joints to flange" in capsys.readouterr().out
    urdf = out.with_suffix(".urdf")
    assert f'description = "{urdf}"' in out.read_text()
    made, plain = read_description(urdf), read_description(DATA / "two_links.urdf")
    bare, fingers = made.chain("flange", {}), plain.chain("flange", {"slide": 0.0, "copy": 0.0})
    for q in np.random.default_rng(1).uniform(-2.0, 2.0, (3, 2)):
        assert_allclose(bare.tool_pose(q).translation_m, fingers.tool_pose(q).translation_m, atol=1e-14)
    assert_allclose(bare.joints[0].inertia.matrix, fingers.joints[0].inertia.matrix, atol=1e-15)
    assert made.joints[0].torque == 50.0


def test_without_that_word_nothing_is_evaluated_and_the_line_says_which_word(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["robot", "show", str(file)]) == 2
    assert "got xacro macros, expected a URDF: expand a trusted file with --trust-xacro" in capsys.readouterr().err
    assert sorted(path.name for path in file.parent.iterdir()) == sorted(NAMES)


def test_a_robot_file_names_no_xacro(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    toml = file.parent / "robot.toml"
    toml.write_text(f'description = "{file.name}"\n')
    assert run(["robot", "show", str(toml)]) == 2
    assert "xacro macros" in capsys.readouterr().err
    assert run(["robot", "show", str(toml), "--trust-xacro"]) == 2
    assert "--trust-xacro: got --trust-xacro, expected nothing with a robot.toml" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (("${length} 0 0", "${lenght} 0 0"), "lenght"),
        (("rod.xacro", "rods.xacro"), "rods.xacro"),
        (("</robot>", ""), "no element|token|mismatched|line"),
    ],
)
def test_what_cannot_be_evaluated_is_one_line(
    file: Path, change: tuple[str, str], reason: str, capfd: pytest.CaptureFixture[str]
) -> None:
    file.write_text(file.read_text().replace(*change))
    with pytest.raises(InputError, match=reason) as caught:
        expanded(file)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_where_xacrodoc_is_not_installed_expect_a_line_that_names_it(
    file: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "xacrodoc", None)
    assert run(["robot", "show", str(file), "--trust-xacro"]) == 2
    assert "library xacrodoc: got not installed, expected xacrodoc, which evaluates xacro" in capsys.readouterr().err
