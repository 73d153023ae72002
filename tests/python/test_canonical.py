"""Canonical JSON and CBOR against the vectors of their standards and an encoder written from RFC 8949."""

import hashlib
import json
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from quasilpv.documents.canonical import (
    MAX_DEPTH,
    canonical_cbor,
    canonical_json,
    normalise,
    parse_document,
    parse_strict_json,
    sha256_hex,
    with_hash,
)
from quasilpv.errors import InputError

KEYS = st.text(st.characters(max_codepoint=127), max_size=30)
SCALARS = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(2**53) + 1, 2**53 - 1),
    st.floats(allow_nan=False, allow_infinity=False),
    st.floats(allow_nan=False, allow_infinity=False, width=16),
    st.floats(allow_nan=False, allow_infinity=False, width=32),
    st.text(st.characters(codec="utf-8"), max_size=30),
)
TREES = st.recursive(SCALARS, lambda inner: st.lists(inner) | st.dictionaries(KEYS, inner), max_leaves=20)
DOCUMENTS = st.dictionaries(KEYS.filter(lambda key: key != "hash"), TREES, max_size=8)


def cbor_head(major: int, argument: int) -> bytes:
    if argument < 24:
        return bytes([major << 5 | argument])
    for extra, (code, limit) in enumerate(zip("BHIQ", (2**8, 2**16, 2**32, 2**64), strict=True)):
        if argument < limit:
            return bytes([major << 5 | 24 + extra]) + struct.pack(f">{code}", argument)
    raise AssertionError(argument)


def cbor_float(value: float) -> bytes:
    for first, code in ((0xF9, "e"), (0xFA, "f"), (0xFB, "d")):
        try:
            data = struct.pack(f">{code}", value)
        except OverflowError:
            continue
        if struct.unpack(f">{code}", data)[0] == value:
            return bytes([first]) + data
    raise AssertionError(value)


def cbor_by_the_book(value: object) -> bytes:
    """RFC 8949 section 4.2.1, without a line of the library under test."""
    if value is None or isinstance(value, bool):
        return {False: b"\xf4", True: b"\xf5", None: b"\xf6"}[value]
    if isinstance(value, int | float):
        if float(value).is_integer() and abs(value) < 2**53:
            return cbor_head(0, int(value)) if value >= 0 else cbor_head(1, -1 - int(value))
        return cbor_float(value)
    if isinstance(value, str):
        return cbor_head(3, len(value.encode())) + value.encode()
    if isinstance(value, list):
        return cbor_head(4, len(value)) + b"".join(map(cbor_by_the_book, value))
    assert isinstance(value, dict)
    members = sorted((cbor_by_the_book(key), cbor_by_the_book(member)) for key, member in value.items())
    return cbor_head(5, len(members)) + b"".join(key + member for key, member in members)


@pytest.mark.parametrize(
    ("bits", "text"),
    [
        ("0000000000000000", "0"),
        ("8000000000000000", "0"),
        ("0000000000000001", "5e-324"),
        ("8000000000000001", "-5e-324"),
        ("7fefffffffffffff", "1.7976931348623157e+308"),
        ("ffefffffffffffff", "-1.7976931348623157e+308"),
        ("4340000000000000", "9007199254740992"),
        ("c340000000000000", "-9007199254740992"),
        ("4430000000000000", "295147905179352830000"),
        ("44b52d02c7e14af5", "9.999999999999997e+22"),
        ("44b52d02c7e14af6", "1e+23"),
        ("44b52d02c7e14af7", "1.0000000000000001e+23"),
        ("444b1ae4d6e2ef4e", "999999999999999700000"),
        ("444b1ae4d6e2ef4f", "999999999999999900000"),
        ("444b1ae4d6e2ef50", "1e+21"),
        ("3eb0c6f7a0b5ed8c", "9.999999999999997e-7"),
        ("3eb0c6f7a0b5ed8d", "0.000001"),
        ("41b3de4355555553", "333333333.3333332"),
        ("41b3de4355555554", "333333333.33333325"),
        ("41b3de4355555555", "333333333.3333333"),
        ("41b3de4355555556", "333333333.3333334"),
        ("41b3de4355555557", "333333333.33333343"),
        ("becbf647612f3696", "-0.0000033333333333333333"),
        ("43143ff3c1cb0959", "1424953923781206.2"),
    ],
)
def test_when_a_number_is_written_expect_the_text_of_rfc_8785_appendix_b(bits: str, text: str) -> None:
    assert canonical_json(struct.unpack(">d", bytes.fromhex(bits))[0]) == text.encode()


def test_when_the_example_of_rfc_8785_is_written_expect_its_canonical_form() -> None:
    example = rb"""{
        "numbers": [333333333.33333329, 1E30, 4.50, 2e-3, 0.000000000000000000000000001],
        "string": "\u20ac$\u000F\u000aA'\u0042\u0022\u005c\\\"\/",
        "literals": [null, true, false]
    }"""
    expected = (
        '{"literals":[null,true,false],"numbers":[333333333.3333333,1e+30,4.5,0.002,1e-27],'
        '"string":"€$\\u000f\\nA\'B\\"\\\\\\\\\\"/"}'
    )
    assert canonical_json(parse_strict_json(example, "example")) == expected.encode()


@pytest.mark.parametrize(
    ("value", "encoding"),
    [
        (0, "00"),
        (23, "17"),
        (24, "1818"),
        (100, "1864"),
        (1000, "1903e8"),
        (1000000, "1a000f4240"),
        (1000000000000, "1b000000e8d4a51000"),
        (-1, "20"),
        (-1000, "3903e7"),
        (1.5, "f93e00"),
        (5.960464477539063e-8, "f90001"),
        (0.00006103515625, "f90400"),
        (1.1, "fb3ff199999999999a"),
        (-4.1, "fbc010666666666666"),
        (3.4028234663852886e38, "fa7f7fffff"),
        (1.0e300, "fb7e37e43c8800759c"),
        ("IETF", "6449455446"),
        ("\u00fc", "62c3bc"),
        ([1, [2, 3], [4, 5]], "8301820203820405"),
        ({"a": 1, "b": [2, 3]}, "a26161016162820203"),
        (False, "f4"),
        (True, "f5"),
        (None, "f6"),
    ],
)
def test_when_a_value_is_written_expect_the_encoding_of_rfc_8949_appendix_a(value: object, encoding: str) -> None:
    assert canonical_cbor(value).hex() == encoding


def test_when_integral_numbers_are_doubles_expect_cbor_integers_up_to_2_53_and_floats_beyond() -> None:
    assert canonical_cbor(1.0) == b"\x01"
    assert canonical_cbor(float(2**53 - 1)) == bytes.fromhex("1b001fffffffffffff")
    assert canonical_cbor(2**53) == canonical_cbor(float(2**53)) == bytes.fromhex("fa5a000000")
    assert canonical_cbor(-(2**60)) == bytes.fromhex("fadd800000")


def test_when_keys_differ_in_length_expect_the_bytewise_order_of_their_encodings() -> None:
    keys = ["z", "aa", "b" * 23, "a" * 24, ""]
    encoding = canonical_cbor({key: 0 for key in keys})
    positions = [encoding.index(cbor_head(3, len(key)) + key.encode() + b"\x00") for key in ["", "z", "aa"]]
    assert positions == sorted(positions)
    assert encoding.index(b"b" * 23) < encoding.index(b"a" * 24)


@given(DOCUMENTS)
def test_when_any_document_is_written_as_cbor_expect_the_bytes_of_an_independent_encoder(document: dict) -> None:
    assert canonical_cbor(document) == cbor_by_the_book(normalise(document, "document"))


def canonical_types(value: object) -> object:
    """The tree with every scalar replaced by its type: 1 == 1.0 hides a difference that strict schemas see."""
    if isinstance(value, dict):
        return {key: canonical_types(member) for key, member in value.items()}
    return [canonical_types(item) for item in value] if isinstance(value, list) else type(value)


@given(DOCUMENTS)
def test_when_both_twins_are_parsed_expect_equal_documents_of_equal_types(document: dict) -> None:
    hashed = with_hash(document)
    from_json = parse_document(canonical_json(hashed), "json")
    from_cbor = parse_document(canonical_cbor(hashed), "cbor")
    assert from_json == from_cbor == hashed
    assert canonical_types(from_json) == canonical_types(from_cbor)


@given(DOCUMENTS)
def test_when_a_document_is_hashed_expect_sha256_of_its_canonical_json_without_the_hash(document: dict) -> None:
    assert with_hash(document)["hash"] == hashlib.sha256(canonical_json(document)).hexdigest()


@given(st.binary(max_size=80), st.sampled_from([b"", b"{", b"\xa1", b"\xbf"]))
def test_when_bytes_are_arbitrary_expect_input_error_and_nothing_else(data: bytes, first: bytes) -> None:
    with pytest.raises(InputError):
        parse_document(first + data, "file")


def test_when_sha256_is_computed_expect_the_vector_of_fips_180() -> None:
    assert sha256_hex(b"abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


def test_when_zero_is_negative_expect_it_written_as_zero_and_refused_in_a_file() -> None:
    assert canonical_json({"x": -0.0}) == b'{"x":0}'
    assert canonical_cbor({"x": -0.0}) == bytes.fromhex("a1617800")
    valid = canonical_json(with_hash({"x": 0}))
    with pytest.raises(InputError, match="non-canonical"):
        parse_document(valid.replace(b'"x":0', b'"x":-0'), "file")


def nested(depth: int) -> dict:
    """An object with containers down to ``depth``, the object itself being at depth 1."""
    inner: list = []
    for _ in range(depth - 2):
        inner = [inner]
    return {"x": inner}


@pytest.mark.parametrize("encode", [canonical_json, canonical_cbor])
def test_when_a_document_is_32_levels_deep_expect_it_accepted_and_33_refused(encode) -> None:
    deepest = with_hash(nested(MAX_DEPTH))
    assert parse_document(encode(deepest), "file") == deepest
    with pytest.raises(InputError, match="32 levels"):
        encode(nested(MAX_DEPTH + 1))


@pytest.mark.parametrize(
    "data",
    [
        b'{"x":' + b"[" * 33 + b"]" * 33 + b"}",
        b'{"x":' + b"[" * 100_000,
        b"\xa1\x61x" + b"\x81" * 33 + b"\x80",
        b"\xa1\x61x" + b"\x81" * 100_000,
    ],
    ids=["json", "very deep json", "cbor", "very deep cbor"],
)
def test_when_a_file_nests_too_deep_expect_input_error(data: bytes) -> None:
    with pytest.raises(InputError):
        parse_document(data, "file")


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ({"x": float("nan")}, "x: got nan, expected a finite double"),
        ({"x": [0, float("inf")]}, r"x\[1\]: got inf, expected a finite double"),
        ({"x": 2**53 + 1}, "x: got 9007199254740993, expected a finite double"),
        ({"x": 10**400}, "beyond the range of double"),
        ({"k\u00e9": 1}, "keys of ASCII characters"),
        ({1: 1}, "keys of ASCII characters"),
        ({"x": {"y": b"bytes"}}, "x.y: got bytes"),
        ({"x": "\ud800"}, "lone surrogates"),
    ],
)
def test_when_a_value_is_outside_the_data_model_expect_its_field_in_the_error(document: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        canonical_json(document, "file")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b'{"x":1,"x":1}', "x: got a duplicate key"),
        (b'{"x":NaN}', "got NaN, expected finite numbers only"),
        (b'{"x":-Infinity}', "got -Infinity"),
        (b'{"x":1e400}', "x: got inf"),
        (b'{"x":' + b"9" * 5000 + b"}", "x: got inf"),
        (b'{"x":01}', "line 1 column"),
        (b'{"x":1} {}', "line 1 column 9"),
        (b'{"x":', "end of file"),
        (b'{"x":"\xff"}', "byte 6: got 0xff, expected UTF-8 text"),
        (b"[1]", "got list, expected an object"),
        (b"", "line 1 column 1"),
        (b'\xef\xbb\xbf{"x":1}', "UTF-8 BOM"),
    ],
)
def test_when_json_of_people_is_not_strict_json_expect_the_place_in_the_error(data: bytes, message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_strict_json(data, "file")


def test_when_json_of_people_has_space_and_free_numbers_expect_it_read() -> None:
    assert parse_strict_json(b' { "x" : 1.50e0 ,\n"n": -0.0, "i": 2.0 } ', "file") == {"x": 1.5, "n": 0, "i": 2}


@pytest.mark.parametrize(
    ("body", "why"),
    [
        ("a2617801617801", "duplicate key"),
        ("bf617801ff", "indefinite length"),
        ("a161789f01ff", "indefinite length inside"),
        ("a161781801", "head longer than needed"),
        ("a16178f93c00", "1.0 as a float"),
        ("a16178fa3fc00000", "1.5 as float32"),
        ("a16178f97e00", "NaN"),
        ("a16178f7", "undefined"),
        ("a16178c11a00000000", "tag"),
        ("a1617841ff", "byte string"),
        ("a10101", "integer key"),
        ("a162616101" + "00", "trailing byte"),
        ("a2626161016162" + "02", "keys out of order"),
        ("a16178", "cut short"),
    ],
)
def test_when_cbor_is_not_deterministic_expect_input_error(body: str, why: str) -> None:
    with pytest.raises(InputError) as error:
        parse_document(bytes.fromhex(body), "file.cbor")
    assert "hash" not in error.value.field, why


def test_when_json_is_not_canonical_expect_the_first_differing_byte() -> None:
    valid = canonical_json(with_hash({"a": 1, "b": 2}))
    with pytest.raises(InputError, match="file: byte 7: got a non-canonical encoding"):
        parse_document(valid.replace(b'"a":1,', b'"a":1, '), "file")
    reordered = json.dumps(dict(reversed(json.loads(valid).items())), separators=(",", ":")).encode()
    with pytest.raises(InputError, match="non-canonical"):
        parse_document(reordered, "file")


@pytest.mark.parametrize("encode", [canonical_json, canonical_cbor])
@pytest.mark.parametrize("wrong", [None, "", "0" * 64, 7])
def test_when_the_hash_is_wrong_or_missing_expect_the_right_one_in_the_error(encode, wrong: object) -> None:
    valid = with_hash({"a": 1})
    document = {**valid, "hash": wrong} if wrong is not None else {"a": 1}
    with pytest.raises(InputError, match=valid["hash"]) as error:
        parse_document(encode(document), "file")
    assert error.value.field == "hash"
