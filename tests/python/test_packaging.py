"""The wheel is complete: what it needs is declared, and what it ships runs without the source tree."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def run(*command: str | Path, cwd: Path) -> str:
    """Output of a command that must succeed; its whole output is shown when it does not."""
    result = subprocess.run([str(word) for word in command], cwd=cwd, capture_output=True, text=True, check=False)
    assert result.returncode == 0, f"{command}\n{result.stdout}\n{result.stderr}"
    return result.stdout


@pytest.fixture(scope="module")
def clean_environment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment that holds the wheel and what its metadata asks for, nothing else."""
    folder = tmp_path_factory.mktemp("packaging")
    run(
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--no-build-isolation",
        "--no-deps",
        "--wheel-dir",
        folder,
        ROOT,
        cwd=folder,
    )
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
