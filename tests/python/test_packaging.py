"""What is installed is complete: a wheel that does the main job alone, a C++ package that other projects find."""

import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from quasilpv import _runtime
from quasilpv.experiments.designs import kept_design
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import write_run_files
from quasilpv.scenarios import Sensors, tracking_experiment
from quasilpv.synthesis import DesignRequest, Specification

ROOT = Path(__file__).parents[2]
BUILT = ROOT / "build" / "release"
SUITE = platform.freedesktop_os_release().get("VERSION_CODENAME", "")


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


def runtime_packages(suite: str) -> set[str]:
    """What a release of Debian has of the list: all lines but those marked ``[codename]`` of another one."""
    lines = (ROOT / "tools/packages/apt-runtime.txt").read_text(encoding="utf-8").splitlines()
    words = [line.partition("#")[0].split() for line in lines if not line.startswith("#")]
    return {package for package, *marks in words if not marks or marks == [f"[{suite}]"]}


def test_the_installation_guide_names_the_packages_of_the_list() -> None:
    guide = (ROOT / "docs/how-to/install.md").read_text(encoding="utf-8")
    lines = [line for line in guide.splitlines() if line.startswith("apt-get install ")]
    named = [set(line.partition("#")[0].split()[2:]) for line in lines]
    assert named == [runtime_packages("bookworm"), runtime_packages("trixie")]


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
@pytest.mark.skipif(SUITE not in ("bookworm", "trixie"), reason="not Debian 12 or 13")
def test_the_libraries_that_the_wheel_links_are_those_of_the_listed_packages(clean_environment: Path) -> None:
    [extension] = clean_environment.glob("lib/*/site-packages/quasilpv/_runtime*.so")
    programs = [extension, *clean_environment.glob("bin/qlpv-*")]
    dynamic = run("readelf", "--dynamic", "--wide", *programs, cwd=clean_environment)
    libraries = set(re.findall(r"\(NEEDED\).*\[(lib[^]]+)\]", dynamic))
    owners = run(
        "dpkg-query", "--search", *(f"*-linux-gnu/{name}" for name in sorted(libraries)), cwd=clean_environment
    )
    packages = {line.split(":")[0] for line in owners.splitlines()} - {"libc6", "libgcc-s1", "libstdc++6"}
    assert len(programs) == 3
    assert packages == runtime_packages(SUITE) - {"python3-venv"}


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
    assert set(best) == {"serial-square", "serial-circle"}
    for row in rows:
        if row["controller"] in {"pid", "ctc", "ctc-dob"}:
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
    assert str(ROOT) not in "".join(path.read_text() for path in prefix.rglob("*.cmake"))
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
def test_on_a_machine_without_lcm_and_libsodium_the_core_builds_and_its_test_passes(tmp_path: Path) -> None:
    options = ("-DQUASILPV_CORE_ONLY=ON", "-DCMAKE_BUILD_TYPE=Debug", *NO_TRANSPORT)
    run("cmake", "-S", ROOT, "-B", tmp_path, "-G", "Ninja", *options, cwd=tmp_path)
    run("cmake", "--build", tmp_path, "--parallel", "2", cwd=tmp_path)
    assert "100% tests passed" in run("ctest", "--test-dir", tmp_path, cwd=tmp_path)


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
