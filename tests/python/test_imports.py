"""What is loaded when: nothing with the package, no library of mathematics with help pages."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from quasilpv.cli.verbs import VERBS

HEAVY = {
    *("numpy", "scipy", "sympy", "mpmath", "flint", "cvxpy", "clarabel", "matplotlib", "PIL", "joblib"),
    *("lcm", "mcap", "viser", "cbor2", "rich"),
}
"""Libraries that take long to load, alone or together. pydantic is the parser's own, see the test."""

MOST_OWN = 40
"""Modules of the package behind a help page; a verb that loads its work loads hundreds."""

PROBE = """
import sys
{statement}
import json
own = [name for name in sys.modules if name.split(".")[0] == "quasilpv"]
sys.stderr.write(json.dumps([sorted({{name.split(".")[0] for name in sys.modules}}), own]))
"""


def loaded_after(statement: str) -> tuple[set[str], list[str]]:
    """Top-level packages, and modules of this package, that a statement loads in a process of its own."""
    command = [sys.executable, "-c", PROBE.format(statement=statement)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    packages, own = json.loads(done.stderr)
    return set(packages), own


def test_the_package_alone_loads_nothing_else() -> None:
    packages, own = loaded_after("import quasilpv")
    assert own == ["quasilpv"]
    assert not packages & {*HEAVY, "pydantic", "typer"}


@pytest.mark.parametrize("verb", [*VERBS, ""])
def test_help_loads_no_library_the_verb_works_with(verb: str) -> None:
    words = [verb, "--help"] if verb else ["--help"]
    packages, own = loaded_after(f"from quasilpv.cli import run; assert run({words!r}) == 0")
    assert packages & HEAVY == set()
    assert len(own) <= MOST_OWN
    assert "quasilpv.cli.verbs" in own  # it was this package that answered


def test_the_work_of_a_verb_loads_what_is_counted_here() -> None:
    packages, own = loaded_after("from quasilpv.cli import run; assert run(['list']) == 0")
    assert packages & HEAVY >= {"numpy", "sympy"}
    assert len(own) > MOST_OWN
