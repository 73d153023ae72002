"""What is installed is complete: a wheel that does the main job alone, a C++ package that other projects find."""

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
import yaml

from quasilpv import _runtime
from quasilpv.experiments.designs import kept_design
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import write_run_files
from quasilpv.extras import EXTRAS, missing_extra
from quasilpv.scenarios import Sensors, tracking_experiment
from quasilpv.synthesis import DesignRequest, Specification

ROOT = Path(__file__).parents[2]
BUILT = ROOT / "build" / "release"


def run(*command: str | Path, cwd: Path) -> str:
    """Output of a command that must succeed, without the source tree on Python's path; all it said if it does not."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    words = [str(word) for word in command]
    result = subprocess.run(words, cwd=cwd, env=environment, capture_output=True, text=True, check=False)
    assert result.returncode == 0, f"{command}\n{result.stdout}\n{result.stderr}"
    return result.stdout


def test_every_place_that_says_the_version_says_the_same() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    assert f"project(quasilpv VERSION {version} " in (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    minor = version.rpartition(".")[0]
    for example in ("downstream", "downstream_core"):
        asked = (ROOT / "examples" / example / "CMakeLists.txt").read_text(encoding="utf-8")
        assert f"find_package(quasilpv {minor} REQUIRED" in asked


def requirement_names(lines: list[str]) -> dict[str, str]:
    """Name and version of each requirement."""
    pairs = (re.fullmatch(r"([\w.-]+) ?(>=[\d.]+)?.*", line) for line in lines)
    return {pair[1].lower(): pair[2] or "" for pair in pairs if pair}


def test_the_recipe_of_conda_asks_for_what_the_package_asks_for() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    text = (ROOT / "packaging/conda/meta.yaml").read_text(encoding="utf-8")
    recipe = yaml.safe_load(re.sub(r"  # \[.*\]$", "", text, flags=re.MULTILINE))
    run = requirement_names(recipe["requirements"]["run"])
    assert run.pop("python") == project["project"]["requires-python"]
    run["matplotlib"] = run.pop("matplotlib-base")
    assert run == requirement_names(project["project"]["dependencies"])
    built = requirement_names(recipe["requirements"]["host"])
    assert requirement_names(project["build-system"]["requires"]).items() <= built.items()
    assert recipe["package"] == {"name": project["project"]["name"], "version": project["project"]["version"]}
    assert recipe["build"]["entry_points"] == [f"design = {project['project']['scripts']['design']}"]
    assert recipe["about"]["license"] == project["project"]["license"]
    assert set(recipe) == {"package", "source", "build", "requirements", "test", "about"}
    assert recipe["source"] == {"git_url": "../.."}  # not the path: build trees and environments lie in the folder


def test_the_recipe_of_lcm_makes_what_the_other_one_asks_for() -> None:
    text = (ROOT / "packaging/conda/lcm/meta.yaml").read_text(encoding="utf-8")
    recipe = yaml.safe_load(re.sub(r"  # \[.*\]$", "", text, flags=re.MULTILINE))
    assert recipe["source"]["git_rev"] == f"v{recipe['package']['version']}"
    host = (ROOT / "packaging/conda/meta.yaml").read_text(encoding="utf-8").partition("host:")[2].partition("run:")[0]
    assert f"    - {recipe['package']['name']}\n" in host
    assert "pin_subpackage('lcm'" in recipe["build"]["run_exports"][0]  # the executables link it


def test_the_dockerfile_builds_with_the_script_of_the_wheels_and_runs_as_nobody_special() -> None:
    text = (ROOT / "packaging/Dockerfile").read_text(encoding="utf-8")
    lines = [line for line in re.sub(r"\\\n", "", text).splitlines() if line and not line.startswith("#")]
    words = [line.split() for line in lines]
    assert {word[0] for word in words} <= {"FROM", "RUN", "COPY", "WORKDIR", "ENV", "USER", "CMD"}
    assert [word[1] for word in words if word[0] == "FROM"] == ["debian:12", "debian:12-slim"]
    [build] = [word[1] for word in words if word[0] == "RUN" and word[1].startswith("tools/")]
    assert os.access(ROOT / build, os.X_OK)
    assert words[[word[0] for word in words].index("USER")][1] != "root"
    for line in lines:  # nothing is left to a question, and no list of packages grows old in a layer
        if "apt-get install" in line:
            assert "--yes --no-install-recommends" in line
            assert line.index("apt-get update") < line.index("apt-get install")
    json.loads(lines[-1].removeprefix("CMD "))


def test_a_package_of_an_extra_that_is_missing_is_named_with_the_extra() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    for module, extra in EXTRAS.items():
        assert module in requirement_names(extras[extra])
        error = missing_extra(ModuleNotFoundError(f"No module named '{module}'", name=f"{module}.core"))
        assert f"pip install 'quasilpv[{extra}]'" in str(error)
    assert missing_extra(ModuleNotFoundError("No module named 'numpy'", name="numpy")) is None


def test_the_extension_links_neither_lcm_nor_libsodium() -> None:
    dynamic = run("readelf", "--dynamic", "--wide", _runtime.__file__, cwd=ROOT)
    libraries = set(re.findall(r"\(NEEDED\).*\[lib([a-z_]+)", dynamic))
    assert "stdc" in libraries
    assert libraries.isdisjoint({"lcm", "sodium", "glib"})


# ---- the wheel -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def clean_environment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment that holds the wheel and what its metadata asks for, nothing else."""
    folder = tmp_path_factory.mktemp("packaging")
    build = ("-m", "pip", "wheel", "--no-build-isolation", "--no-deps", "--wheel-dir", folder, ROOT)
    run(sys.executable, *build, cwd=folder)
    [wheel] = folder.glob("quasilpv-*.whl")
    run(sys.executable, "-m", "venv", folder / "venv", cwd=folder)
    run(folder / "venv/bin/python", "-m", "pip", "install", wheel, cwd=folder)
    return folder / "venv"


@pytest.mark.full
def test_when_the_wheel_is_installed_alone_expect_the_package_and_its_extension_to_import(
    clean_environment: Path,
) -> None:
    code = "import quasilpv, quasilpv._runtime; print(quasilpv.__file__)"
    location = run(clean_environment / "bin/python", "-c", code, cwd=clean_environment)
    assert Path(location.strip()).is_relative_to(clean_environment)


@pytest.mark.full
def test_when_the_wheel_is_installed_alone_expect_the_commands_to_run(clean_environment: Path) -> None:
    listing = run(clean_environment / "bin/design", "list", cwd=clean_environment)
    for name in ("dob-acceleration", "pid", "ctc", "ctc-dob", "serial-square", "serial-circle"):
        assert name in listing
    for executable in ("qlpv-controller", "qlpv-simulator"):
        assert "--help" in run(clean_environment / "bin" / executable, "--help", cwd=clean_environment)


@pytest.mark.full
def test_when_the_wheel_is_installed_alone_expect_no_headers_and_no_archives_in_it(clean_environment: Path) -> None:
    [wheel] = clean_environment.parent.glob("quasilpv-*.whl")
    listed = run(sys.executable, "-m", "zipfile", "--list", wheel, cwd=clean_environment)
    assert "quasilpv/_runtime" in listed
    assert not any(suffix in listed for suffix in (".hpp", ".a ", ".cmake"))


@pytest.mark.full
def test_when_the_wheel_is_installed_alone_expect_the_demo_to_do_the_main_job(
    clean_environment: Path, tmp_path: Path
) -> None:
    command = clean_environment / "bin/design"
    made = json.loads(run(command, "demo", "--json", "-o", "demo", cwd=tmp_path))
    assert made["verification"]["certificate"]["verified"] is True
    default_bits = Sensors().encoder_bits  # the default law runs with coarser encoders as well
    rows = [run for run in made["runs"] if run["sensors"]["encoder_bits"] == default_bits]
    best = {row["scenario"]: row for row in rows if row["controller"] == "dob-acceleration"}
    assert {"serial-square", "serial-circle"} <= set(best)
    for row in rows:
        if row["scenario"].startswith("serial") and row["controller"] in {"pid", "ctc", "ctc-dob"}:
            assert best[row["scenario"]]["rms_x_m"] < row["rms_x_m"] / 10
        assert (tmp_path / "demo" / row["scenario"] / "comparison.png").stat().st_size > 0
    assert "verified" in run(command, "verify", made["artifact"]["json"], cwd=tmp_path)


# ---- the C++ package -------------------------------------------------------------------------------------------------


NO_TRANSPORT = [f"-DCMAKE_DISABLE_FIND_PACKAGE_{name}=ON" for name in ("LCM", "Sodium", "SUNDIALS", "CLI11")]
"""To CMake, these are not on this machine."""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Headers, libraries and package files in a prefix of their own."""
    prefix = tmp_path_factory.mktemp("installed")
    run("cmake", "--install", BUILT, "--component", "development", "--prefix", prefix, cwd=prefix)
    said = "".join(path.read_text() for path in prefix.rglob("*.cmake"))
    # The folder, not a name that ends in the same: /quasilpv is no part of ${DIR}/quasilpvTargets.cmake.
    assert not re.search(rf"(?<![\w.}}]){re.escape(str(ROOT))}\b", said)
    return prefix


def build_example(name: str, installed: Path, folder: Path, *options: str) -> Path:
    """Build a project of examples away from the source tree against an installation. Returns its build folder."""
    shutil.copytree(ROOT / "examples" / name, folder / "source")
    search = f"-DCMAKE_PREFIX_PATH={installed}"
    run("cmake", "-S", folder / "source", "-B", folder / "build", "-G", "Ninja", search, *options, cwd=folder)
    run("cmake", "--build", folder / "build", cwd=folder)
    return folder / "build"


@pytest.fixture(scope="module")
def downstream(installed: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The program of examples/downstream."""
    return build_example("downstream", installed, tmp_path_factory.mktemp("downstream")) / "closed_loop"


@pytest.mark.full
def test_when_a_project_asks_for_the_core_expect_the_answers_of_the_bindings_on_a_machine_without_transport(
    installed: Path, tmp_path: Path
) -> None:
    program = build_example("downstream_core", installed, tmp_path / "project", *NO_TRANSPORT) / "hold"
    kept_design(DesignRequest.of("arm3", "pid", Specification()), folder=tmp_path / "cache")
    [file] = (tmp_path / "cache").rglob("artifact.json")
    controller = _runtime.Controller(_runtime.Artifact.load(str(file)))
    rest, angle = np.zeros(3), np.full(3, 0.25)
    for seq in range(4):
        report = controller.step(angle, angle, rest, rest, rest, seq)
    said = [float(line) for line in run(program, file, "0.25", "4", cwd=tmp_path).split()]
    assert said == report.torque_applied[:3].tolist()
    assert all(torque > 0.0 for torque in said)  # against gravity
    assert not re.search(r"lcm|sodium|glib", run("ldd", program, cwd=tmp_path))


@pytest.mark.full
def test_on_a_machine_without_lcm_and_libsodium_the_core_builds_and_its_test_passes() -> None:
    folder = ROOT / "build" / "core"  # as deep as BUILT, whose objects are then the same to ccache
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    options = ("-DQUASILPV_CORE_ONLY=ON", "-DCMAKE_BUILD_TYPE=Release", *NO_TRANSPORT)
    run("cmake", "-S", ROOT, "-B", folder, "-G", "Ninja", *options, cwd=folder)
    run("cmake", "--build", folder, "--parallel", "2", cwd=folder)
    assert "100% tests passed" in run("ctest", "--test-dir", folder, cwd=folder)


@pytest.mark.full
def test_when_another_project_runs_the_loop_of_the_installed_library_expect_the_run_of_the_bindings(
    downstream: Path, tmp_path: Path
) -> None:
    experiment = tracking_experiment("serial-square")
    artifact = kept_design(DesignRequest.of("arm3", "pid", Specification()), folder=tmp_path / "cache")
    files = write_run_files(tmp_path, RunSetup(experiment, artifact, plant="perturbed", sensors=Sensors()))
    said = run(downstream, files.artifact, files.trajectory, files.scenario, cwd=tmp_path)
    columns = _runtime.run_closed_loop(
        _runtime.Artifact.load(str(files.artifact)),
        _runtime.Trajectory.load(str(files.trajectory)),
        _runtime.Scenario.load(str(files.scenario)),
    )
    worst = float(np.max(np.abs(columns["angle_rad"] - columns["reference_angle_rad"])))
    assert f"{columns['time_s'].size} samples" in said
    assert float(said.split()[-2]) == worst


@pytest.mark.full
def test_when_the_downstream_program_is_given_a_missing_file_expect_one_line_and_exit_2(downstream: Path) -> None:
    done = subprocess.run([downstream, "a", "b", "c"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("closed_loop: a: ")
    assert done.stderr.count("\n") == 1
