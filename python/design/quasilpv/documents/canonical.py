"""Canonical documents: one byte sequence per document, as JSON and as CBOR, protected by one SHA-256.

The data model is that of ``docs/reference/formats.md``: objects with ASCII keys, arrays, strings, booleans, null and
finite doubles, at most ``MAX_DEPTH`` levels deep. ``normalise`` brings a Python tree into it; after that an integral
number with ``|x| <= 2**53 - 1`` is an ``int`` and every other number a ``float``, so that both twins of a document load
to equal trees.

Standards: RFC 8785 (JSON Canonicalization Scheme), RFC 8949 section 4.2 (deterministic CBOR), FIPS 180-4 (SHA-256).
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from typing import Any, NoReturn

import cbor2
import rfc8785

from quasilpv.defaults import LARGEST_WRITTEN
from quasilpv.errors import InputError
from quasilpv.files import MAX_FILE_BYTES

MAX_DEPTH = 32
MAX_SAFE_INTEGER = 2**53 - 1

Document = dict[str, Any]


def normalise(value: object, source: str, path: str = "", depth: int = 1) -> Any:
    """Return ``value`` in the data model of canonical documents; nothing of the input is shared.

    Args:
        value: a tree of mappings, sequences, strings, booleans, ``None`` and numbers.
        source: name of the document in errors.
        path: field path of ``value``, e.g. ``law.observer[2]``.
        depth: nesting depth of ``value``; the top-level object is at depth 1.

    Raises:
        InputError: a number is not finite or not a double, a key is not ASCII text, a type has no place in the data
            model, a string is not Unicode text, or arrays and objects nest deeper than ``MAX_DEPTH``.
    """
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        _require_unicode(value, source, path)
        return value
    if isinstance(value, int | float):
        return _normalise_number(value, source, path)
    if isinstance(value, Mapping | Sequence) and not isinstance(value, bytes | bytearray):
        if depth > MAX_DEPTH:
            raise InputError(source, path or "document", f"depth {depth}", f"nesting of at most {MAX_DEPTH} levels")
        if isinstance(value, Mapping):
            return {
                _normalise_key(key, source, path): normalise(member, source, member_path(path, str(key)), depth + 1)
                for key, member in value.items()
            }
        return [normalise(item, source, f"{path}[{i}]", depth + 1) for i, item in enumerate(value)]
    raise InputError(source, path or "document", type(value).__name__, "null, boolean, number, string, array or object")


def member_path(path: str, key: str) -> str:
    """Return the field path of member ``key`` of the object at ``path``."""
    return f"{path}.{key}" if path else key


def canonical_json(document: object, source: str = "document") -> bytes:
    """Return the RFC 8785 bytes of a document.

    Raises:
        InputError: as ``normalise``.
    """
    return _encode_json(normalise(document, source))


def canonical_cbor(document: object, source: str = "document") -> bytes:
    """Return the deterministic CBOR bytes (RFC 8949 section 4.2) of a document, integral numbers as integers.

    Raises:
        InputError: as ``normalise``.
    """
    return _encode_cbor(normalise(document, source))


def sha256_hex(data: bytes) -> str:
    """Return the lower-case hexadecimal SHA-256 of ``data``."""
    return hashlib.sha256(data).hexdigest()


def document_hash(document: Mapping[str, object], source: str = "document") -> str:
    """Return the SHA-256 of the canonical JSON of the document without its member ``hash``.

    Raises:
        InputError: as ``normalise``.
    """
    return sha256_hex(canonical_json({key: value for key, value in document.items() if key != "hash"}, source))


def with_hash(document: Mapping[str, object], source: str = "document") -> Document:
    """Return the normalised document with its member ``hash`` set.

    Raises:
        InputError: as ``normalise``.
    """
    tree: Document = normalise(document, source)
    return {**tree, "hash": document_hash(tree, source)}


def parse_document(data: bytes, source: str) -> Document:
    """Parse a hashed document from the bytes of either twin, told apart by the first byte.

    Accepted only if the bytes equal their canonical re-serialisation and the hash agrees.

    Args:
        data: the whole file.
        source: name of the file in errors.

    Returns:
        The normalised document, ``hash`` included.

    Raises:
        InputError: not JSON and not CBOR, outside the data model, a duplicate key, not canonical, or a wrong hash.
    """
    if data[:1] == b"{":
        tree = parse_strict_json(data, source)
        encoded = _encode_json(tree)
    elif data[:1] and 0xA0 <= data[0] <= 0xBF:
        tree = _parse_cbor(data, source)
        encoded = _encode_cbor(tree)
    else:
        raise InputError(source, "byte 0", data[:1].hex() or "an empty file", "'{' (JSON) or a CBOR map")
    if encoded != data:
        differing = (i for i, (ours, theirs) in enumerate(zip(encoded, data, strict=False)) if ours != theirs)
        position = next(differing, min(len(encoded), len(data)))
        expected = "RFC 8785 JSON or RFC 8949 section 4.2 CBOR"
        raise InputError(source, f"byte {position}", "a non-canonical encoding", expected)
    expected_hash = document_hash(tree, source)
    if tree.get("hash") != expected_hash:
        raise InputError(source, "hash", tree.get("hash", "nothing"), f"{expected_hash} (SHA-256 of the content)")
    return tree


def parse_strict_json(data: bytes, source: str) -> Document:
    """Parse JSON written by people: free white space and number spelling, everything else strict.

    Raises:
        InputError: not UTF-8, not JSON (NaN and Infinity are not), a duplicate key, not an object at the top level, or
            outside the data model.
    """
    if len(data) > MAX_FILE_BYTES:
        raise InputError(source, "size", f"{len(data)} bytes", f"at most {MAX_FILE_BYTES} bytes")

    def refuse_constant(name: str) -> NoReturn:
        raise InputError(source, "document", name, "finite numbers only")

    def refuse_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        members = dict(pairs)
        if len(members) != len(pairs):
            keys = [key for key, _ in pairs]
            duplicate = next(key for i, key in enumerate(keys) if key in keys[:i])
            raise InputError(source, ascii(duplicate)[1:-1], "a duplicate key", "each key once")
        return members

    try:
        tree = json.loads(
            data.decode("utf-8"),
            parse_int=float,
            parse_float=float,
            parse_constant=refuse_constant,
            object_pairs_hook=refuse_duplicates,
        )
    except UnicodeDecodeError as error:
        raise InputError(source, f"byte {error.start}", f"0x{data[error.start]:02x}", "UTF-8 text") from error
    except json.JSONDecodeError as error:
        found = error.doc[error.pos : error.pos + 10] or "end of file"
        raise InputError(source, f"line {error.lineno} column {error.colno}", found, f"JSON ({error.msg})") from error
    except RecursionError as error:
        raise InputError(source, "document", "a deeper document", f"nesting of at most {MAX_DEPTH} levels") from error
    return _require_object(normalise(tree, source), source)


def require_bounded(tree: object, source: str, path: str = "") -> None:
    """Refuse numbers beyond `LARGEST_WRITTEN` anywhere in a document written by people.

    Raises:
        InputError: the field and its value.
    """
    if isinstance(tree, Mapping):
        for key, member in tree.items():
            require_bounded(member, source, member_path(path, str(key)))
    elif isinstance(tree, Sequence) and not isinstance(tree, str):
        for i, item in enumerate(tree):
            require_bounded(item, source, f"{path}[{i}]")
    elif isinstance(tree, int | float) and abs(tree) > LARGEST_WRITTEN:
        raise InputError(source, path, f"{tree:g}", f"a number of at most {LARGEST_WRITTEN:g} in magnitude")


def _parse_cbor(data: bytes, source: str) -> Document:
    if len(data) > MAX_FILE_BYTES:
        raise InputError(source, "size", f"{len(data)} bytes", f"at most {MAX_FILE_BYTES} bytes")
    try:
        tree = cbor2.loads(data, max_depth=MAX_DEPTH + 1, allow_indefinite=False, allow_duplicate_keys=False)
    except cbor2.CBORDecodeError as error:
        raise InputError(source, "document", error, "deterministic CBOR (RFC 8949 section 4.2)") from error
    return _require_object(normalise(tree, source), source)


def _encode_json(tree: object) -> bytes:
    return rfc8785.dumps(tree)  # type: ignore[arg-type]


def _encode_cbor(tree: object) -> bytes:
    return cbor2.dumps(tree, canonical=True)


def _require_object(tree: Any, source: str) -> Document:
    if not isinstance(tree, dict):
        raise InputError(source, "document", type(tree).__name__, "an object")
    return tree


def _normalise_number(value: float, source: str, path: str) -> int | float:
    expected = "a finite double"
    try:
        number = float(value)
    except OverflowError as error:
        raise InputError(source, path, "an integer beyond the range of double", expected) from error
    if not math.isfinite(number):
        raise InputError(source, path, number, expected)
    if isinstance(value, int) and number != value:
        raise InputError(source, path, value, expected)
    return int(number) if number.is_integer() and abs(number) <= MAX_SAFE_INTEGER else number


def _normalise_key(key: object, source: str, path: str) -> str:
    if not isinstance(key, str) or not key.isascii():
        raise InputError(source, path or "document", f"key {key!a}", "keys of ASCII characters")
    return key


def _require_unicode(text: str, source: str, path: str) -> None:
    try:
        text.encode("utf-8")
    except UnicodeEncodeError as error:
        raise InputError(source, path, ascii(text), "Unicode text without lone surrogates") from error
