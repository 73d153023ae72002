"""A law is written once per language: both sides know the same members, of the same types, and the same programs."""

import re
from pathlib import Path
from typing import Any, Literal, get_args, get_type_hints

import pytest

from quasilpv import _runtime
from quasilpv.certificate import LAWS
from quasilpv.certificate.gate.motor_loop import CorrectionSource
from quasilpv.documents.design_inertia import DesignInertia
from quasilpv.documents.strict_model import NonNegative, Number, Positive, StrictModel
from quasilpv.documents.tables import Intervals, Matrix, NonNegativeVector, PolytopeTable, PositiveVector, Vector

ROOT = Path(__file__).parents[2]
REGISTRY = Path("cpp/controller/src/laws/registry.cpp")

NAMES_OF_TYPES: list[tuple[Any, str]] = [
    (Number, "number"),
    (Positive, "positive"),
    (NonNegative, "non-negative"),
    (bool, "boolean"),
    (CorrectionSource, "correction-source"),
    (Literal["link"], "angle-side"),
    (int, "integer"),
    (tuple[Number, Number, Number, Number], "numbers"),
    (Vector, "joint-values"),
    (Intervals, "intervals"),
    (PositiveVector, "positive-joint-values"),
    (NonNegativeVector, "non-negative-joint-values"),
    (Matrix, "matrix"),
    (tuple[Matrix, ...], "matrices"),
    (PolytopeTable, "polytope"),
    (tuple[Number, Number, Number], "numbers"),
    (DesignInertia, "design-inertia"),
]
"""What the run-time side calls a type of this side."""

Members = dict[str, tuple[str, bool, "Members"]]


def members_of(model: type[StrictModel]) -> Members:
    """Member -> (type, optional, members of it), in the words of the run-time side, ``kind`` left out."""
    hints = get_type_hints(model, include_extras=True)
    return {
        name: (*described(hints[name], model.__name__, name), not field.is_required(), nested(hints[name]))
        for name, field in model.model_fields.items()
        if name != "kind"
    }


def without_none(hint: Any) -> Any:
    alternatives = [argument for argument in get_args(hint) if argument is not type(None)]
    return alternatives[0] if type(None) in get_args(hint) and len(alternatives) == 1 else hint


def described(hint: Any, model: str, name: str) -> tuple[str]:
    plain = without_none(hint)
    named = [word for known, word in NAMES_OF_TYPES if known == plain]
    if not named and isinstance(plain, type) and issubclass(plain, StrictModel):
        named = ["object"]
    assert named, f"{model}.{name}: {hint} has no name on the run-time side"
    return (named[0],)


def nested(hint: Any) -> Members:
    plain = without_none(hint)
    is_object = isinstance(plain, type) and issubclass(plain, StrictModel) and plain is not PolytopeTable
    return members_of(plain) if is_object else {}


MODELS = {kind: law.document for kind, law in LAWS.items()}
RUNTIME = _runtime.law_schemas()


def test_both_sides_know_the_same_kinds_of_laws() -> None:
    assert set(RUNTIME) == set(MODELS)
    assert len(RUNTIME) > 5


@pytest.mark.parametrize("kind", MODELS)
def test_both_sides_know_the_same_members_of_a_law_and_their_types(kind: str) -> None:
    assert RUNTIME[kind][0] == members_of(MODELS[kind])


@pytest.mark.parametrize("kind", MODELS)
def test_both_sides_know_the_same_programs_of_a_law(kind: str) -> None:
    assert set(RUNTIME[kind][1]) == set(MODELS[kind].PROGRAMS)


@pytest.mark.parametrize("kind", RUNTIME)
def test_a_kind_of_law_is_named_in_one_file_of_the_runtime_side(kind: str) -> None:
    sources = [path for folder in ("cpp", "python/bindings") for path in (ROOT / folder).rglob("*.[ch]pp")]
    word = re.compile(rf"(?<![\w-]){re.escape(kind)}(?![\w.-])")
    named = {path.relative_to(ROOT) for path in sources if word.search(path.read_text(encoding="utf-8"))}
    assert len(sources) > 100
    assert [path.parent.as_posix() for path in named - {REGISTRY}] == ["cpp/controller/src/laws"]


def test_when_a_side_lacks_a_member_or_has_another_type_expect_it_seen() -> None:
    class Reference(StrictModel):
        kind: str
        gain: Number
        window: int

    assert members_of(Reference) == {"gain": ("number", False, {}), "window": ("integer", False, {})}

    class Shorter(StrictModel):
        kind: str
        gain: Positive

    assert members_of(Shorter) == {"gain": ("positive", False, {})}
