"""The page of the faults against the tests: each number has a test, and every test that it names exists."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
NUMBERS = range(1, 19)
REAL_PROCESSES = (2, 7, 13, 14, 15, 16, 17)

CPP_TESTS = {
    name
    for path in sorted((ROOT / "tests/cpp").glob("*_test.cpp"))
    for name in re.findall(r"^TEST(?:_F|_P)?\(\w+,\s*(F\d+_\w+)\)", path.read_text(), flags=re.MULTILINE)
}
PYTHON_TESTS = {
    name: path
    for path in sorted((ROOT / "tests/python").glob("test_*.py"))
    for name in re.findall(r"^def (test_F\d+_\w+)\(", path.read_text(), flags=re.MULTILINE)
}


def number_of(test: str) -> int:
    return int(test.removeprefix("test_").split("_")[0][1:])


def rows() -> dict[int, set[str]]:
    """Number of each fault on the page, and the tests that its row names."""
    page = (ROOT / "docs/reference/faults.md").read_text(encoding="utf-8")
    lines = re.findall(r"^\| F(\d+) \|.*\| ([^|]*) \|$", page, flags=re.MULTILINE)
    return {int(number): set(re.findall(r"`(\w+)`", tests)) for number, tests in lines}


def test_every_fault_has_a_row_and_every_row_a_fault() -> None:
    assert sorted(rows()) == list(NUMBERS)


@pytest.mark.parametrize("number", NUMBERS)
def test_every_fault_has_a_test_of_its_number_and_its_row_names_only_tests_that_exist(number: int) -> None:
    existing = {name for name in CPP_TESTS | PYTHON_TESTS.keys() if number_of(name) == number}
    assert existing
    assert rows()[number]
    assert rows()[number] <= existing


@pytest.mark.parametrize("number", REAL_PROCESSES)
def test_every_fault_of_a_process_is_tested_with_the_real_processes(number: int) -> None:
    files = {path for name, path in PYTHON_TESTS.items() if number_of(name) == number}
    assert any("two_processes" in path.read_text(encoding="utf-8") for path in files)
