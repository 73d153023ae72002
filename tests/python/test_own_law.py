"""The page about an own law is done as written, on a copy of the sources: built, tested, and run as two processes."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs/how-to/your-own-law.md"
BLOCK = re.compile(
    r"`(?P<path>[\w/.]+)`[.:]?[^`]*?\n\n```(?P<language>python|cpp|diff)\n(?P<text>.*?)^```$", re.S | re.M
)


def say(*command: str | Path, cwd: Path, **environment: str) -> str:
    """Output of a command that must succeed; all it said if it does not."""
    words = [str(word) for word in command]
    result = subprocess.run(
        words, cwd=cwd, env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, f"{words}\n{result.stdout[-4000:]}\n{result.stderr[-4000:]}"
    return result.stdout


def copied_sources(folder: Path) -> Path:
    """The files under version control, and new ones that are not ignored."""
    git = ("git", "-c", f"safe.directory={ROOT}", "ls-files", "--cached", "--others", "--exclude-standard")
    for name in sorted(set(say(*git, cwd=ROOT).splitlines())):
        if (ROOT / name).exists():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name, follow_symlinks=False)
    return folder


def apply_page(sources: Path) -> dict[str, list[str]]:
    """Writes the files of the page and makes its changes. Returns their paths, by language of the block."""
    done: dict[str, list[str]] = {}
    for block in BLOCK.finditer(PAGE.read_text(encoding="utf-8")):
        path, language, text = block["path"], block["language"], block["text"]
        if language == "diff":
            patch = f"--- a/{path}\n+++ b/{path}\n{text}"
            command = ["git", "apply", "--recount", "-"]
            subprocess.run(command, cwd=sources, input=patch, text=True, check=True)
        else:
            assert not (sources / path).exists()
            (sources / path).write_text(text, encoding="utf-8")
        done.setdefault(language, []).append(path)
    return done


def test_the_page_is_one_file_of_each_language_for_the_law_and_lines_of_registries(tmp_path: Path) -> None:
    sources = copied_sources(tmp_path)
    say("git", "init", "--quiet", cwd=sources)  # so that `git apply` means these files
    done = apply_page(sources)
    assert done["cpp"] == ["cpp/controller/src/laws/slotine_li.cpp"]
    laws = [path for path in done["python"] if "/laws/" in path]
    assert laws == ["python/design/quasilpv/certificate/laws/slotine_li.py"]
    assert [path.rpartition("/")[2] for path in done["diff"]] == ["registry.py", "registry.cpp", "registry.py"]
    bin_folder = Path(sys.executable).parent
    say(bin_folder / "ruff", "check", *done["python"], cwd=sources)
    say(bin_folder / "ruff", "format", "--check", *done["python"], cwd=sources)
    say(
        bin_folder / "clang-format",
        "--dry-run",
        "-Werror",
        *done["cpp"],
        "cpp/controller/src/laws/registry.cpp",
        cwd=sources,
    )


@pytest.mark.full
def test_when_the_page_is_followed_expect_the_law_designed_verified_tracked_and_run_over_lcm(tmp_path: Path) -> None:
    sources, site, work = (tmp_path / name for name in ("sources", "site", "work"))
    for folder in (sources, work):
        folder.mkdir()
    say("git", "init", "--quiet", cwd=copied_sources(sources))
    apply_page(sources)
    pip = (sys.executable, "-m", "pip", "install", "--no-build-isolation", "--no-deps", "--target", site, sources)
    say(*pip, cwd=work, CCACHE_BASEDIR=str(sources))
    # -S: no .pth files, so that the editable installation of these sources is not found. Executables are looked for
    # beside the interpreter.
    packages = sysconfig.get_paths()
    places = {"PYTHONPATH": os.pathsep.join([str(site), packages["purelib"], packages["platlib"]])}
    interpreter = site / "bin/python"
    interpreter.symlink_to(Path(sys.executable).resolve())
    python = (interpreter, "-S")
    design = (*python, "-c", "import sys; from quasilpv.cli.app import main; sys.exit(main())")
    where = say(*python, "-c", "import quasilpv._runtime as r; print(r.__file__)", cwd=work, **places)
    assert Path(where.strip()).is_relative_to(site)
    [commands] = re.findall(r"```sh\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    lines = commands.splitlines()
    for line in lines[:-2]:
        say(*design, *shlex.split(line)[1:], cwd=work, **places)
    tracked, hil = (
        json.loads(say(*design, *shlex.split(line)[1:], "--json", cwd=work, **places)) for line in lines[-2:]
    )
    schemas = sources / "tests/python/test_law_schemas.py"
    say(*python, "-m", "pytest", "-q", "-p", "no:cacheprovider", schemas, cwd=work, **places)
    [row] = tracked
    assert row["controller"] == hil["controller"] == "slotine-li"
    assert 0.0 < row["rms_x_m"] < 0.1  # of a square of 0.4 m, against 450 N m and a payload it does not know
    assert hil["identical_to_in_process"] is True
