"""The scripts of tools/ away from the machine they were written on: other systems, and what is told while they run."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LISTS = [f"tools/packages/{name}" for name in ("apt.txt", "apt-test.txt")]
BASICS = ("bash", "cat", "dirname", "env", "grep", "head", "sed", "tr", "uname")  # what every system has
SYSTEMS = {
    "Fedora Linux 42": 'ID=fedora\nPRETTY_NAME="Fedora Linux 42"\n',
    "Ubuntu 24.04 LTS": 'ID=ubuntu\nID_LIKE=debian\nVERSION_CODENAME=noble\nPRETTY_NAME="Ubuntu 24.04 LTS"\n',
    "Debian GNU/Linux 11": 'ID=debian\nVERSION_CODENAME=bullseye\nPRETTY_NAME="Debian GNU/Linux 11"\n',
    "Debian GNU/Linux sid": 'ID=debian\nVERSION_CODENAME=forky\nPRETTY_NAME="Debian GNU/Linux sid"\n',
}


def entries(*lists: str) -> dict[str, str]:
    """By what a listed package is recognised where there is no dpkg."""
    lines = [line for file in lists for line in (ROOT / file).read_text(encoding="utf-8").splitlines()]
    return {line.split()[0]: line.split()[1] for line in lines if not line.startswith("#")}


class Elsewhere:
    """Another system: an os-release and a PATH of the programs that are there."""

    def __init__(self, folder: Path, release: str, programs: tuple[str, ...] = BASICS) -> None:
        self.bin = folder / "bin"
        self.bin.mkdir()
        for name in programs:
            (self.bin / name).symlink_to(str(shutil.which(name)))
        (folder / "os-release").write_text(release, encoding="utf-8")
        self.environment = {"PATH": str(self.bin), "OS_RELEASE": str(folder / "os-release")}

    def add(self, name: str, script: str) -> None:
        (self.bin / name).write_text(f"#!/usr/bin/env bash\n{script}\n", encoding="utf-8")
        (self.bin / name).chmod(0o755)

    def run(self, *lists: str, **environment: str) -> subprocess.CompletedProcess[str]:
        command = [ROOT / "tools/lib/packages.sh", *(lists or LISTS)]
        given = self.environment | environment
        return subprocess.run(command, env=given, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("name", SYSTEMS)
def test_when_the_system_is_another_expect_what_is_missing_by_name_and_no_installation(
    name: str, tmp_path: Path
) -> None:
    system = Elsewhere(tmp_path, SYSTEMS[name])
    system.add("apt-get", f"touch {tmp_path / 'installed'}")
    system.add("dpkg-query", "exit 1")
    done = system.run()
    assert done.returncode == 1
    first, *missing, last = done.stderr.splitlines()
    assert first.startswith(f"{name}: packages are installed on Debian 12 and 13 only.")
    assert "QUASILPV_PACKAGES=skip" in last
    # With no program but the basic ones, every command is missing; headers may be where compilers look.
    commands = {package for package, mark in entries(*LISTS).items() if mark.startswith(("command:", "python:"))}
    assert commands <= {line.split()[0] for line in missing} <= set(entries(*LISTS))
    assert not (tmp_path / "installed").exists()


def test_when_there_is_no_os_release_expect_the_kernel_named(tmp_path: Path) -> None:
    system = Elsewhere(tmp_path, "")
    (tmp_path / "os-release").unlink()
    done = system.run()
    assert done.returncode == 1
    assert done.stderr.startswith("Linux: packages are installed on Debian 12 and 13 only.")


@pytest.mark.skipif(shutil.which("dpkg-query") is None, reason="not a Debian system: not all of it need be there")
def test_when_all_is_there_on_another_system_expect_it_to_go_on(tmp_path: Path) -> None:
    system = Elsewhere(tmp_path, SYSTEMS["Fedora Linux 42"])
    done = system.run(PATH=os.environ["PATH"])
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_when_one_header_or_command_is_missing_expect_that_one_named(tmp_path: Path) -> None:
    (tmp_path / "list.txt").write_text(
        "# a list\n"
        "there        command:missing|bash          # either name will do\n"
        "libgone-dev  header:gone.h|gone/gone.h     # a library\n"
        "libhere-dev  header:elsewhere/here.h       # in a prefix of one's own\n",
        encoding="utf-8",
    )
    (tmp_path / "prefix/include/elsewhere").mkdir(parents=True)
    (tmp_path / "prefix/include/elsewhere/here.h").touch()
    system = Elsewhere(tmp_path, SYSTEMS["Fedora Linux 42"])
    done = system.run(str(tmp_path / "list.txt"), CMAKE_PREFIX_PATH=f"/nowhere:{tmp_path / 'prefix'}")
    assert done.returncode == 1
    assert done.stderr.splitlines()[1:-1] == ["  libgone-dev (gone.h|gone/gone.h)"]
    assert system.run(str(tmp_path / "list.txt"), QUASILPV_PACKAGES="skip").returncode == 0
    wrong = system.run(str(tmp_path / "list.txt"), QUASILPV_PACKAGES="no")
    assert (wrong.returncode, wrong.stderr) == (1, "QUASILPV_PACKAGES: got no, expected skip or nothing\n")


@pytest.mark.parametrize("suite", ["bookworm", "trixie"])
def test_on_debian_12_and_13_the_missing_packages_of_that_release_are_installed(suite: str, tmp_path: Path) -> None:
    (tmp_path / "list.txt").write_text(
        "libfoo6  [bookworm]  # old name\nlibfoo7 [trixie]\nbash header:never.h # there\n", encoding="utf-8"
    )
    system = Elsewhere(tmp_path, f"ID=debian\nVERSION_CODENAME={suite}\n")
    system.add("dpkg-query", "[[ ${*: -1} == bash ]] && echo installed")
    system.add("apt-get", f"echo $* >> {tmp_path / 'log'}")
    system.add("sudo", '"$@"')
    done = system.run(str(tmp_path / "list.txt"))
    assert done.returncode == 0, done.stderr
    installed = {"bookworm": "libfoo6", "trixie": "libfoo7"}[suite]
    update, install = (tmp_path / "log").read_text(encoding="utf-8").splitlines()
    assert update.endswith(" update")
    assert install.endswith(f" {installed}")
    assert f"installing with apt-get: {installed}\n" in done.stdout


def test_every_listed_package_says_by_what_it_is_recognised() -> None:
    for file in [*LISTS, "tools/packages/apt-full.txt"]:
        for package, mark in entries(file).items():
            assert re.fullmatch(r"(command|header|python):[\w.+/|-]+", mark), (file, package)


# ---- phases ----------------------------------------------------------------------------------------------------------


def test_while_phases_run_expect_what_is_left_and_how_long_it_took_the_last_time(tmp_path: Path) -> None:
    script = f"""
set -euo pipefail
source {ROOT}/tools/lib/phases.sh
plan quick build lint tests
phase build bash -c 'echo compiled'
check lint bash -c 'echo "a finding"; exit 3'
check tests true
finish
"""

    def run() -> tuple[int, list[str]]:
        done = subprocess.run(["bash", "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.stderr == ""
        return done.returncode, [re.sub(r"\d+ s", "N s", line) for line in done.stdout.splitlines()]

    status, lines = run()
    assert status == 1
    assert lines[0] == "build        ok        N s   left: lint tests"
    assert lines[1] == "lint         FAILED    N s   left: tests"
    assert lines[2:5] == ["--- exit status 3; the last lines of build/log/lint.log:", "a finding", "---"]
    assert lines[5] == "tests        ok        N s"
    assert lines[6] == "bash: FAILED: lint (N s)"
    kept = tmp_path / "build/log/seconds-quick"
    assert [line.split()[0] for line in kept.read_text(encoding="utf-8").splitlines()] == ["build", "tests"]
    kept.write_text("build 70\ntests 130\n", encoding="utf-8")
    assert run()[1][:2] == [
        "build        ok        N s   left: lint tests, at least 3 min",
        "lint         FAILED    N s   left: tests, about 3 min",
    ]


def test_every_phase_of_the_test_command_is_planned_in_its_order() -> None:
    text = (ROOT / "tools/test").read_text(encoding="utf-8")
    planned = [name for names in re.findall(r"phases\+?=\(([^)]*)\)", text) for name in names.split()]
    run = re.findall(r"^ *(?:phase|check) (\S+)", text.replace('"$preset"', "asan\ncheck tsan", 1), flags=re.MULTILINE)
    assert run == planned


# ---- tools/try-debian ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("arguments", [[], ["sid"], ["trixie", "--mirror"], ["--fast"]])
def test_when_try_debian_is_used_wrongly_expect_its_usage_and_exit_2(arguments: list[str]) -> None:
    done = subprocess.run([ROOT / "tools/try-debian", *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stdout.startswith("./tools/try-debian bookworm|trixie ")


@pytest.mark.skipif(os.geteuid() == 0 and shutil.which("setpriv") is None, reason="no way to be another user")
def test_when_try_debian_cannot_work_expect_one_line(tmp_path: Path) -> None:
    command = [ROOT / "tools/try-debian", "trixie", "--folder", tmp_path]
    as_user = ["setpriv", "--reuid=65534", "--clear-groups"] if os.geteuid() == 0 else []
    user = subprocess.run([*as_user, *command], capture_output=True, text=True, check=False)
    assert (user.returncode, user.stdout) == (2, "")
    assert re.fullmatch(r".*/tools/try-debian: got user \S+, expected root: .*\n", user.stderr)
    if os.geteuid() == 0:
        elsewhere = Elsewhere(tmp_path, "", (*BASICS, "id"))
        root = subprocess.run(command, env=elsewhere.environment, capture_output=True, text=True, check=False)
        assert (root.returncode, root.stdout) == (2, "")
        assert re.fullmatch(r".*/tools/try-debian: got no debootstrap, expected .*\n", root.stderr)
    assert sorted(path.name for path in tmp_path.iterdir()) in ([], ["bin", "os-release"])
