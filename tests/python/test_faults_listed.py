"""The page of the faults against the tests: each number has a test, and every test that the page names exists."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
NUMBERS = range(1, 28)
REAL_PROCESSES = (2, 7, 11, 13, 14, 15, 16, 17, 19, 20, 21, 22, 23, 24, 25, 26, 27)

PAGE = (ROOT / "docs/reference/faults.md").read_text(encoding="utf-8")


def find_tests(pattern: str, files: str) -> dict[str, Path]:
    """Tests with a name of this pattern, and the file of each."""
    return {
        name: path
        for path in sorted((ROOT / "tests").glob(files))
        for name in re.findall(pattern, path.read_text(encoding="utf-8"), flags=re.MULTILINE)
    }


CPP_TESTS = find_tests(r"^TEST(?:_F|_P)?\(\w+,\s*(\w+)\)", "cpp/*_test.cpp")
PYTHON_TESTS = find_tests(r"^def (test_\w+)\(", "python/test_*.py")


def number_of(test: str) -> int:
    """The fault whose number the name carries, or 0."""
    number = re.match(r"(?:test_)?F(\d+)_", test)
    return int(number[1]) if number else 0


def rows() -> dict[int, set[str]]:
    """Number of each fault on the page, and the tests that its row names."""
    lines = re.findall(r"^\| F(\d+) \|.*\| ([^|]*) \|$", PAGE, flags=re.MULTILINE)
    return {int(number): set(re.findall(r"`(\w+)`", tests)) for number, tests in lines}


def test_every_fault_has_a_row_and_every_row_a_fault() -> None:
    assert sorted(rows()) == list(NUMBERS)


@pytest.mark.parametrize("number", NUMBERS)
def test_every_fault_has_a_test_of_its_number_and_its_row_names_only_tests_that_exist(number: int) -> None:
    existing = {name for name in CPP_TESTS | PYTHON_TESTS if number_of(name) == number}
    assert existing
    assert rows()[number]
    assert rows()[number] <= existing


def test_every_claim_about_the_control_thread_names_a_test_that_exists() -> None:
    section = PAGE.partition("## What the control thread does not do")[2].partition("\n## ")[0]
    named = re.findall(r"^\| .* \| `(\w+)` \|$", section, flags=re.MULTILINE)
    assert len(named) == 4
    assert set(named) <= CPP_TESTS.keys() | PYTHON_TESTS.keys()


@pytest.mark.parametrize("number", REAL_PROCESSES)
def test_every_fault_of_a_process_is_tested_with_the_real_processes(number: int) -> None:
    files = {path for name, path in PYTHON_TESTS.items() if number_of(name) == number}
    assert any("two_processes" in path.read_text(encoding="utf-8") for path in files)


def test_every_claim_about_general_systems_names_tests_that_exist() -> None:
    section = PAGE.partition("## General systems")[2].partition("\n## ")[0]
    named = set(re.findall(r"`(\w+_\w+_\w+)`", section))
    assert len(named) == 8
    assert named <= CPP_TESTS.keys() | PYTHON_TESTS.keys()
