"""What is counted of the cut: a law kind in one file, a document read in one place."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import quasilpv
from quasilpv.certificate import LAWS, Evidence
from quasilpv.certificate.robot.registry import EXACT, NUMERIC
from quasilpv.documents.mechanism import MECHANISM_KINDS

PACKAGE = Path(quasilpv.__file__).parent
LAW_FILES = "certificate/laws"

PRESETS = {
    "synthesis/registry.py": "the controllers by name, some of which are named as their law",
    "cli/options.py": "their short names",
    "cli/track.py": "those that are compared if nobody says otherwise",
    "figures/style.py": "their colours",
    "reproduction/tracking_hinf.py": "those of an item of the source",
    "reproduction/tracking_parallel.py": "likewise",
    "reproduction/tracking_serial.py": "likewise",
}
"""Files that name controllers: presets, not law kinds. A new law kind needs no line in any of them."""


def sources() -> Iterator[tuple[str, ast.Module]]:
    for path in sorted(PACKAGE.rglob("*.py")):
        yield path.relative_to(PACKAGE).as_posix(), ast.parse(path.read_text(encoding="utf-8"))


def texts(tree: ast.Module) -> set[str]:
    """Every string of the code; prose is left alone, as no docstring is a kind."""
    return {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)}


def test_a_law_kind_is_named_in_its_own_file_and_by_presets_only() -> None:
    named = {file: texts(tree) & set(LAWS) for file, tree in sources()}
    elsewhere = {file for file, kinds in named.items() if kinds and not file.startswith(LAW_FILES)}
    assert elsewhere == set(PRESETS)
    for kind in LAWS:
        assert len([file for file, kinds in named.items() if kind in kinds and file.startswith(LAW_FILES)]) == 1, kind


def test_every_law_says_what_it_is_in_its_document() -> None:
    for kind, law in LAWS.items():
        assert law.document.tag() == kind
        if law.checks:
            assert law.gate is not None, kind
        elif law.gate is not None:  # it claims nothing: nothing it says is proved
            assert law.gate_evidence is Evidence.SAMPLED, kind
        assert {"premises", "gravity"} <= set(law.document.PROGRAMS)


def test_every_mechanism_the_checker_knows_has_an_exact_and_a_numeric_evaluator() -> None:
    assert EXACT.keys() == NUMERIC.keys()
    assert EXACT.keys() < set(MECHANISM_KINDS)


def is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def raw_reads(tree: ast.Module) -> Iterator[int]:
    """Lines that take a member out of something by a name in quotes, ``document["law"]`` or ``document.get("law")``."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Subscript) and is_text(node.slice) and ast.unparse(node.value) != "Literal":
            yield node.lineno
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith(".get") and is_text(node.args[0]):
            yield node.lineno


def test_the_checker_reads_typed_documents_only() -> None:
    found = {file: [*raw_reads(tree)] for file, tree in sources() if file.startswith("certificate/")}
    assert {file: lines for file, lines in found.items() if lines} == {}
