"""What names a system: the catalogue, a name in a Python file, an entry point of a package."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from quasilpv.cli import run
from quasilpv.errors import InputError
from quasilpv.studies import Question, Sweep, Verdict
from quasilpv.studies.checkpoint import Checkpoint
from quasilpv.studies.engines import in_processes
from quasilpv.studies.region import Task
from quasilpv.systems.catalogue import SYSTEMS, system_kind, system_names

OSCILLATOR = '''
import sympy as sp
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.descriptor.equations import rate
from beside import FRICTION

print("loaded")


def oscillator(r=1.0, states=2, power_w=(1, 2), *, swapped=False):
    """An oscillator of uncertain stiffness."""
    x, v, p = sp.symbols("x v p", real=True)
    motion = [rate(x) - v, rate(v) + (1 + p / 2) * x + sp.Rational(FRICTION) * v]
    return DescriptorSystem.from_equations(
        motion[::-1] if swapped else motion,
        name=f"oscillator{[states for _ in range(states)]}", state=(x, v), inputs=(), domain={p: (-r, r)}, unknown=(p,),
    )


fixed = oscillator(r=0.25)


def divides(r=1.0):
    return 1 / (r - 1.0)


def leaves(r=1.0):
    raise SystemExit("no more")


def not_at_rest(r=1.0):
    x = sp.Symbol("x")
    return DescriptorSystem.from_equations([rate(x) - 9], name="falling", state=(x,), inputs=(), domain={})


def needs(r): ...


def makes_nothing(): ...


three = 3
'''
LINE_OF = {
    words: rf"own.py:{next(n for n, line in enumerate(OSCILLATOR.splitlines(), 1) if words in line)}: "
    for words in ("return 1 / ", "raise SystemExit", "rate(x) - 9")
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "own.py").write_text(OSCILLATOR)
    (tmp_path / "beside.py").write_text("FRICTION = '1/5'\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_an_entry_of_the_catalogue_is_found_by_its_id() -> None:
    assert all(system_kind(name) is kind for name, kind in SYSTEMS.items())
    assert all(kind.stem == kind.id and not kind.fingerprint for kind in SYSTEMS.values())


def test_a_function_in_a_file_is_a_family_with_the_parameters_that_have_numbers_for_defaults(folder: Path) -> None:
    kind = system_kind("own.py:oscillator")
    assert {name: parameter.default for name, parameter in kind.parameters.items()} == {
        "r": 1.0,
        "states": 2.0,
        "swapped": 0.0,
    }
    assert not any(parameter.affine for parameter in kind.parameters.values())
    assert kind.summary == "An oscillator of uncertain stiffness."
    made = kind.system(r=0.5, states=3.0, swapped=1.0)  # a whole number and a truth stay what they are in the file
    assert made.premises[0].bounds == (-0.5, 0.5)
    assert made.name == "oscillator[3, 3, 3]"
    np.testing.assert_allclose(made.evaluate([0.0]).A @ [1.0, 0.0], [-1.0, 0.0])


def test_a_reference_resolves_from_any_folder_and_is_executed_once(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    question = Question("own.py:oscillator", "I.1", parameters=(("r", 0.3),))
    assert question.system == f"{folder.resolve()}/own.py:oscillator"
    monkeypatch.chdir("/")
    assert system_kind(question.system) is system_kind(question.system)
    assert Sweep(question, ()).at({}).verdict is Verdict.FEASIBLE
    printed = capsys.readouterr()
    assert printed.out == ""  # a verb's stdout is its result
    assert printed.err.count("loaded") == 1


def test_a_system_in_a_file_has_no_parameters(folder: Path) -> None:
    assert system_kind("own.py:fixed").system().premises[0].bounds == (-0.25, 0.25)
    with pytest.raises(InputError, match=r"own\.py:fixed: parameter: got r, expected no parameter"):
        system_kind("own.py:fixed").system(r=1.0)


def test_what_is_kept_of_a_file_is_not_taken_for_another_content_of_it(folder: Path) -> None:
    def checkpoint() -> Path:
        return Checkpoint(folder / "kept", Question("own.py:oscillator", "I.1"), ("r", "states")).path

    before = checkpoint()
    assert before.name.startswith("own-oscillator-I.1-")
    assert checkpoint() == before
    (folder / "own.py").write_text(OSCILLATOR.replace("1 + p / 2", "1 + p / 3"))
    assert checkpoint() != before


@pytest.mark.parametrize(
    ("reference", "words"),
    [
        ("own.py", r"systems: system: got own.py, expected FILE.py:NAME"),
        ("own.py:", r"expected FILE.py:NAME"),
        ("own.py:a.b", r"expected FILE.py:NAME"),
        ("none.py:a", r"none.py: file: got No such file or directory"),
        (".py:a", r"expected FILE.py:NAME"),
        ("own.py:oscilator", r"own.py: name: got oscilator, expected one of .*did you mean oscillator\?"),
        ("own.py:three", r"own-three: got the int 3, expected a DescriptorSystem"),
        ("own.py:needs", r"own.py:needs: parameter r: got no default"),
        ("own.py:divides", LINE_OF["return 1 / "] + r"code: got ZeroDivisionError: float division by zero"),
        ("own.py:leaves", LINE_OF["raise SystemExit"] + r"code: got SystemExit: no more"),
        ("own.py:not_at_rest", LINE_OF["rate(x) - 9"] + r"falling: equation 1: drift at x = 0: got 9"),
        ("own.py:makes_nothing", r"own.py: makes_nothing\(\): got the NoneType None"),
        ("syntax.py:a", r"syntax.py:2: code: got SyntaxError"),
        ("imports.py:a", r"imports.py:1: code: got ModuleNotFoundError"),
        ("ex-I.7", r"expected one of ex-I.1.*did you mean ex-.*; or FILE.py:NAME"),
    ],
)
def test_when_a_reference_leads_to_no_system_expect_one_line_and_exit_2(
    folder: Path, reference: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "syntax.py").write_text("a = 1\nb = (\n")
    (folder / "imports.py").write_text("import nothing_of_that_name\n")
    with pytest.raises(InputError, match=words):
        system_kind(reference).system()
    capsys.readouterr()
    assert run(["complexity", reference, "-c", "I.1"]) == 2
    shown = [line for line in capsys.readouterr().err.splitlines() if line != "loaded"]
    assert len(shown) == 1


def test_an_entry_point_of_a_package_is_known_by_its_name(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    about = folder / "toys-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: toys\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[quasilpv.systems]\ntoy = own:oscillator\nbroken = imports:a\n")
    (folder / "imports.py").write_text("import nothing_of_that_name\n")
    monkeypatch.syspath_prepend(str(folder))
    assert system_names()[-2:] == ["toy", "broken"]
    assert system_kind("toy").system(r=0.5).premises[0].bounds == (-0.5, 0.5)
    assert system_kind("toy").fingerprint == "toys 1.0"
    with pytest.raises(InputError, match=r"entry point broken \(.*imports.py:1\): code: got ModuleNotFoundError"):
        system_kind("broken")


def test_the_list_shows_why_a_package_cannot_be_loaded(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    about = folder / "toys-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: toys\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[quasilpv.systems]\nbroken = imports:a\n")
    (folder / "imports.py").write_text("import nothing_of_that_name\n")
    monkeypatch.syspath_prepend(str(folder))
    assert run(["list", "--json"]) == 0
    listed = {entry["id"]: entry["summary"] for entry in json.loads(capsys.readouterr().out)["systems"]}
    assert "cannot be loaded" in listed["broken"]
    assert "ModuleNotFoundError" in listed["broken"]


# ---- documents -------------------------------------------------------------------------------------------------------

EXAMPLES = Path(__file__).parents[2] / "examples"
DOCUMENT = {
    "schema": "quasilpv.system",
    "schema_version": 1,
    "name": "oscillator",
    "parameters": {"r": 0.5, "d": {"default": 0.2, "summary": "damping", "unit": "1/s"}},
    "state": ["x", "v"],
    "equations": ["x' = v", "v' = -(1 + p/2)*x - d*v"],
    "domain": {"p": ["-r", "r"]},
    "unknown": ["p"],
}


def written(folder: Path, **changes: object) -> str:
    path = folder / "own.json"
    path.write_text(json.dumps({**DOCUMENT, **changes}))
    return str(path)


def test_the_document_of_the_example_is_the_system_of_the_example() -> None:
    code = system_kind(f"{EXAMPLES}/own_system.py:dc_bus").system(deviation_max_v=6.0)
    document = system_kind(f"{EXAMPLES}/dc_bus.json").system(deviation_max_v=6.0)
    assert document.premises == code.premises
    for field in "EABC":
        np.testing.assert_array_equal(getattr(document, field).constant, getattr(code, field).constant)
        np.testing.assert_array_equal(getattr(document, field).coefficients, getattr(code, field).coefficients)


def test_a_document_is_a_family_with_its_parameters(folder: Path) -> None:
    kind = system_kind(written(folder))
    assert kind.parameters["d"].unit == "1/s"
    made = kind.system(r=0.25, d=0.1)
    assert made.premises[0].bounds == (-0.25, 0.25)
    assert made.A.constant.tolist() == [[0.0, 1.0], [-1.0, -0.1]]  # 0.1 is 1/10 rounded once
    at_rest = {"equilibrium": {"state": {"x": "r"}}, "domain": {"p": [-1, 1], "x": [-2, 2]}}
    with pytest.raises(InputError, match=r"oscillator: equation 2: drift at x = 0: got -p/4 - 0.5|drift"):
        system_kind(written(folder, **at_rest)).system()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"schema": "other"}, r"own.json: schema: got .other."),
        ({"schema_version": 2}, r"own.json: schema_version: got 2"),
        ({"extra": 1}, r"own.json: extra: got 1"),
        ({"name": None}, r"own.json: name: got null"),
        ({"state": "x v"}, r"own.json: state: got .x v."),
        ({"state": []}, r"own.json: state"),
        ({"equations": [1]}, r"own.json: equations.0: got 1"),
        ({"domain": {"p": [1]}}, r"own.json: domain.p"),
        ({"domain": {"p": ["-q", "q"]}}, r"own.json: domain of p: column 2: got q"),
        ({"domain": {"p": ["r", "-r"]}}, r"domain of p: got .*reversed"),
        ({"parameters": {"r": True}}, r"own.json: parameters.r"),
        (
            {"parameters": {"x": 1.0, "r": 1.0, "d": 1.0}},
            r"own.json: parameters.x: got x, expected a name that is no state",
        ),
        ({"equations": ["x' = v", "v' = __import__('os').system('touch owned')"]}, r"equation 2: column 17: got '"),
        ({"equations": ["x' = v"]}, r"oscillator: equations: got 1 equations, expected 2"),
    ],
)
def test_when_a_document_says_nothing_expect_the_member_named(
    folder: Path, changes: dict[str, object], words: str
) -> None:
    with pytest.raises(InputError, match=words) as raised:
        system_kind(written(folder, **changes)).system()
    assert "\n" not in str(raised.value)
    assert not (folder / "owned").exists()


@pytest.mark.parametrize("content", [b"", b"{", b"[1, 2]", b"\xff\xfe", b'{"name": "a", "name": "b"}', b"[" * 100_000])
def test_when_a_file_is_no_document_expect_one_line(folder: Path, content: bytes) -> None:
    (folder / "own.json").write_bytes(content)
    with pytest.raises(InputError, match=r"own.json: "):
        system_kind("own.json")
    with pytest.raises(InputError, match=r"none.json: file: got No such file"):
        system_kind("none.json")


@pytest.mark.full
def test_worker_processes_resolve_a_relative_reference(folder: Path) -> None:
    question = Question("own.py:oscillator", "I.1")
    tasks = [Task(question, ("r",), ((r,),)) for r in (0.3, 0.5)]
    verdicts = [answer.verdict for answer in in_processes(2)(tasks)]
    assert verdicts == [Verdict.FEASIBLE, Verdict.INFEASIBLE]  # a common quadratic function exists for r < 0.39799


def test_a_stop_while_a_users_code_runs_is_no_error_of_that_code(tmp_path: Path) -> None:
    code = "import os, signal\n\n\ndef plant():\n    os.kill(os.getpid(), signal.SIGTERM)\n"
    (tmp_path / "own.py").write_text(code, encoding="utf-8")
    command = [sys.executable, "-m", "quasilpv", "solve", f"{tmp_path / 'own.py'}:plant", "-c", "I.2"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 128 + signal.SIGTERM
    assert "code that runs" not in done.stderr
