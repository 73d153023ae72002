"""A system as a JSON document: its equations as text, read by a parser of our own. No code of it is executed.

    {"schema": "quasilpv.system", "schema_version": 1, "name": "oscillator", "state": ["x", "v"], "inputs": ["u"],
     "parameters": {"r": 0.5},
     "equations": ["x' = v", "v' = -(1 + p/2)*x - v/5 + u"],
     "domain": {"p": ["-r", "r"]}, "unknown": ["p"]}

Numbers are the decimals they are written as; bounds and equilibrium are numbers or formulas of the parameters.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Literal

import sympy as sp
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from quasilpv.documents.strict_model import got_and_expected
from quasilpv.errors import InputError
from quasilpv.systems.descriptor.formula import parse_expression
from quasilpv.systems.descriptor.names import symbol
from quasilpv.systems.descriptor.open_parameters import OpenParameters
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.descriptor.vocabulary import exact
from quasilpv.systems.system_kind import Parameter, SystemKind

MAX_BYTES = 1_000_000
_CACHED_SYSTEMS = 16

Text = Annotated[str, Field(min_length=1)]
Value = float | Text


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class ParameterEntry(_Part):
    """A parameter of a document: default, what it is, its unit."""

    default: float
    summary: str = ""
    unit: str = "1"


class EquilibriumEntry(_Part):
    """Values of states and inputs by name; 0 for those left out."""

    state: dict[Text, Value] = {}
    inputs: dict[Text, Value] = {}


class SystemDocument(_Part):
    """The members of a document; they are the arguments of `DescriptorSystem.from_equations`.

    Attributes:
        schema_, schema_version: ``"quasilpv.system"``, under the name ``schema``, and 1.
        name, summary: what it is called, one line about it.
        parameters: by name, a default or an entry with summary and unit: names that may occur in every formula.
        state, inputs: names.
        equations: as many as states.
        outputs: formulas of the state; the whole state if left out.
        domain: by name, lower and upper bound.
        unknown: parameters the controller does not know.
        equilibrium: the origin if left out.
        units: by name, of states, inputs and what the domain names.
    """

    schema_: Literal["quasilpv.system"] = Field(alias="schema")
    schema_version: Literal[1]
    name: Text
    summary: str = ""
    parameters: dict[Text, float | ParameterEntry] = {}
    state: list[Text] = Field(min_length=1)
    inputs: list[Text] = []
    equations: list[Text]
    outputs: list[Text] | None = None
    domain: dict[Text, Annotated[list[Value], Field(min_length=2, max_length=2)]] = {}
    unknown: list[Text] = []
    equilibrium: EquilibriumEntry | None = None
    units: dict[Text, Text] = {}


def document_kind(reference: str) -> SystemKind:
    """The family of systems that a JSON document describes.

    Args:
        reference: path of a file, ``FILE.json``.

    Returns:
        A kind whose id is the absolute path.

    Raises:
        InputError: no such file, no JSON, a member that is missing, unknown or of the wrong kind, or a formula that is
            none; the member is named.
    """
    path = Path(reference).expanduser().resolve()
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(str(path), "file", error.strerror or error, "a JSON document of equations") from None
    return _document_kind(path, content)


@lru_cache(maxsize=8)
def _document_kind(path: Path, content: bytes) -> SystemKind:
    document = _read(path, content)
    entries = {
        name: entry if isinstance(entry, ParameterEntry) else ParameterEntry(default=entry)
        for name, entry in document.parameters.items()
    }
    for name in entries:
        if name in (*document.state, *document.inputs, *document.domain, *document.unknown):
            expected = "a name that is no state, no input and has no interval"
            raise InputError(str(path), f"parameters.{name}", name, expected)

    @lru_cache(maxsize=_CACHED_SYSTEMS)
    def build(**values: float) -> DescriptorSystem:
        return _system(document, str(path), {name: _decimal(value) for name, value in values.items()})

    def left_open(record: OpenParameters, fixed: Mapping[str, float]) -> DescriptorSystem:
        return _system(document, str(path), {n: _decimal(v) for n, v in fixed.items()} | dict(record.symbols))

    return SystemKind(
        id=str(path),
        summary=document.summary or f"{document.name}, {len(document.state)} states",
        reference=str(path),
        parameters={name: Parameter(entry.default, entry.summary, entry.unit) for name, entry in entries.items()},
        build=build,
        stem=path.stem,
        fingerprint=sha256(content).hexdigest(),
        left_open=left_open,
    )


def _read(path: Path, content: bytes) -> SystemDocument:
    """The document, its members checked."""
    if len(content) > MAX_BYTES:
        raise InputError(str(path), "file", f"{len(content)} bytes", f"at most {MAX_BYTES}")
    try:
        tree = json.loads(content, object_pairs_hook=_without_repetition)
        return SystemDocument.model_validate(tree)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        field = ".".join(str(part) for part in first["loc"] if part not in {"float", "constrained-str"}) or "document"
        got = "nothing" if first["type"] == "missing" else json.dumps(first["input"])[:60]
        _, expected = got_and_expected(first["type"], first["msg"], first["input"], first.get("ctx", {}))
        raise InputError(str(path), field, got, expected) from None
    except (ValueError, RecursionError) as error:  # no JSON, no UTF-8, or too deep
        raise InputError(str(path), "document", error, "a JSON document") from None


def _without_repetition(pairs: Sequence[tuple[str, object]]) -> dict[str, object]:
    names = [name for name, _ in pairs]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"the member {name} twice")
    return dict(pairs)


def _decimal(value: float) -> sp.Rational:
    """The decimal a double is written as: 0.1 is 1/10."""
    return sp.Rational(repr(float(value)))


def _system(document: SystemDocument, source: str, values: Mapping[str, sp.Expr]) -> DescriptorSystem:
    """The system at values of its parameters, which stand in its formulas as the numbers they are."""

    def number(field: str, value: Value) -> sp.Expr:
        if not isinstance(value, str):
            return _decimal(value)
        names = {name: symbol(name) for name in values}
        formula = exact(parse_expression(f"{source}: {field}", value, names))
        result = formula.subs({names[n]: v for n, v in values.items()})
        if result.has(sp.zoo, sp.nan):
            raise InputError(source, field, result, "a value: the parameters make it undefined")
        return result

    around = document.equilibrium or EquilibriumEntry()
    values_of = [
        {name: number(f"equilibrium, {name}", value) for name, value in part.items()}
        for part in (around.state, around.inputs)
    ]
    return DescriptorSystem.from_equations(
        document.equations,
        name=document.name,
        state=document.state,
        inputs=document.inputs,
        outputs=document.outputs,
        domain={
            name: tuple(number(f"domain of {name}", bound) for bound in bounds)
            for name, bounds in document.domain.items()
        },
        unknown=document.unknown,
        equilibrium=(values_of[0], values_of[1]),
        constants=values,
        units=document.units,
    )
