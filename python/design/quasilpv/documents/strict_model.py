"""The pydantic base of every file format: strict, frozen, and with errors of one line."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from quasilpv.documents.canonical import canonical_json, member_path
from quasilpv.errors import InputError

LARGEST_NUMBER = 1e100
"""No number that is read at run time is larger, and no positive one smaller than its reciprocal."""

Number = Annotated[float, Field(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]
Positive = Annotated[float, Field(ge=1.0 / LARGEST_NUMBER, le=LARGEST_NUMBER)]
NonNegative = Annotated[float, Field(ge=0, le=LARGEST_NUMBER)]


class StrictModel(BaseModel):
    """A frozen model without conversions: unknown members, ``true`` for a number and 3.7 for an integer are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class FieldError(ValueError):
    """A cross-field check failed; ``validate`` turns it into an ``InputError``.

    Args:
        field: path relative to the model that raises, e.g. ``vertices[3]``.
        got: what was found.
        expected: what is accepted, in words.
    """

    def __init__(self, field: str, got: object, expected: str) -> None:
        """Keep the parts; the message is theirs."""
        self.field = field
        self.got = got
        self.expected = expected
        super().__init__(f"{field}: got {got}, expected {expected}")


Model = TypeVar("Model", bound=StrictModel)


def validate(model: type[Model], document: object, source: str, tags: Iterable[str] = ()) -> Model:
    """Return ``document`` as an instance of ``model``.

    Args:
        model: the format.
        document: a tree in the data model of ``canonical.normalise``.
        source: name of the document in errors.
        tags: names of the cases of discriminated unions; pydantic puts them into paths although they are no members.

    Raises:
        InputError: the first thing wrong with the document, with its field path.
    """
    try:
        return model.model_validate_json(canonical_json(document, source))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        cause = first.get("ctx", {}).get("error")
        path = _field_path(first["loc"], frozenset(tags))
        if isinstance(cause, FieldError):
            raise InputError(source, member_path(path, cause.field), cause.got, cause.expected) from error
        got, expected = got_and_expected(first["type"], first["msg"], first["input"], first.get("ctx", {}))
        raise InputError(source, path or "document", got, expected) from error


def _field_path(location: tuple[int | str, ...], tags: frozenset[str]) -> str:
    path = ""
    for part in location:
        if isinstance(part, int):
            path += f"[{part}]"
        elif part not in tags:
            path += f".{part}" if path else part
    return path


def got_and_expected(kind: str, message: str, value: Any, context: dict[str, Any]) -> tuple[str, str]:
    """What pydantic found and expected, in our words, from an entry of `ValidationError.errors`."""
    got = _shorten(value)
    plain = got, message.removeprefix("Input should be ").removeprefix("Value should be ")
    in_our_words = {
        "missing": ("nothing", "this member"),
        "extra_forbidden": (got, "no member of this name"),
        "literal_error": (got, str(context.get("expected"))),
        "union_tag_invalid": (repr(context.get("tag")), f"one of {context.get('expected_tags')}"),
        "union_tag_not_found": ("nothing", f"a member {context.get('discriminator')}"),
        "too_long": (f"{context.get('actual_length')} entries", f"at most {context.get('max_length')}"),
        "too_short": (f"{context.get('actual_length')} entries", f"at least {context.get('min_length')}"),
        "string_pattern_mismatch": (got, f"text matching {context.get('pattern')}"),
    }
    return in_our_words.get(kind, plain)


def _shorten(value: object, limit: int = 60) -> str:
    text = repr(value)
    return text if len(text) <= limit else f"{text[: limit - 3]}..."
