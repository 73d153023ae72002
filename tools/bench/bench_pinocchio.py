"""Pinocchio's recursive Newton-Euler algorithm, compiled on demand against headers and libraries of the `pin` wheel.

It stays out of the main build: the wheel is no dependency of the C++ side, and its headers are slow to compile. The
build is kept in build/bench-pinocchio.
"""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from bench_report import ROOT

SOURCE = Path(__file__).resolve().parent / "pinocchio"
BUILD = ROOT / "build" / "bench-pinocchio"


@dataclass(frozen=True)
class Competitor:
    """A program, or the reason why there is none (exactly one of the two)."""

    program: Path | None = None
    missing: str = ""


def rnea_program(*, may_build: bool) -> Competitor:
    """The program `rnea` (tools/bench/pinocchio/rnea.cpp).

    Args:
        may_build: False takes only what an earlier call has built.
    """
    program = BUILD / "rnea"
    prefix = wheel_prefix()
    if prefix is None:
        return Competitor(missing="the wheel `pin` with its C++ headers is not installed in this environment")
    if not may_build:
        return Competitor(program) if program.is_file() else Competitor(missing="not built in a quick run")
    if not program.is_file():
        print("building the Pinocchio competitor in build/bench-pinocchio", file=sys.stderr)
    configure = ["cmake", "-S", str(SOURCE), "-B", str(BUILD), "-G", "Ninja", f"-DPINOCCHIO_PREFIX={prefix}"]
    for command in (configure, ["cmake", "--build", str(BUILD)]):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            last = [*(done.stdout + done.stderr).split("\n"), ""][-3:]
            return Competitor(missing=f"its build failed: {' '.join(last).strip()}")
    return Competitor(program)


def wheel_prefix() -> Path | None:
    """Folder of the wheel that holds include/ and lib/, None if it is not installed."""
    try:
        prefix = Path(str(metadata.distribution("libpinocchio").locate_file("cmeel.prefix")))
    except metadata.PackageNotFoundError:
        return None
    return prefix if (prefix / "include" / "pinocchio").is_dir() else None
