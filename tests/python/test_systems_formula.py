"""Formulas as text: what they say, exactly, and that nothing else is ever read or run."""

import ast
from fractions import Fraction
from pathlib import Path

import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

import quasilpv
from quasilpv.errors import InputError
from quasilpv.systems.descriptor.formula import MAX_DEPTH, MAX_LENGTH, parse_equation, parse_expression

x, v, u = sp.symbols("x v u", real=True)
NAMES = {"x": x, "v": v, "u": u, "x'": sp.Symbol("x'", real=True)}


def parsed(text: str) -> sp.Expr:
    return parse_expression("toy: equation 1", text, NAMES)


@st.composite
def formulas(draw: st.DrawFn, depth: int = 3) -> tuple[str, float]:
    """A text, and what it is at x = 0.3, v = -0.7, u = 2, computed beside it."""
    kind = draw(st.integers(0, 6 if depth else 1))
    if kind == 0:
        number = draw(st.integers(1, 999)) / 100
        return f"{number}", number
    if kind == 1:
        return draw(st.sampled_from([("x", 0.3), ("v", -0.7), ("u", 2.0)]))
    first, a = draw(formulas(depth - 1))
    if kind == 2:
        return f"-({first})", -a
    if kind == 3:
        return f"({first})**2", a**2
    if kind == 4:
        return f"abs({first})", abs(a)
    second, b = draw(formulas(depth - 1))
    return (f"({first}) + {second}", a + b) if kind == 5 else (f"({first})*({second})", a * b)


@given(formulas())
@settings(max_examples=60, deadline=None)
def test_a_formula_has_the_value_it_says(case: tuple[str, float]) -> None:
    text, value = case
    found = float(parsed(text).subs({x: sp.Rational(3, 10), v: -sp.Rational(7, 10), u: 2}))
    assert found == pytest.approx(value, rel=1e-9, abs=1e-9)


@given(st.decimals(min_value=-(10**9), max_value=10**9, allow_nan=False, places=9))
@settings(max_examples=40, deadline=None)
def test_a_number_is_the_rational_that_is_written(number) -> None:  # type: ignore[no-untyped-def]
    value = parsed(f"{number:f}")
    assert Fraction(int(value.p), int(value.q)) == Fraction(number)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0.1", sp.Rational(1, 10)),
        ("1.5e-3*x", sp.Rational(3, 2000) * x),
        ("-x**2", -(x**2)),  # the power first
        ("2**-1", sp.Rational(1, 2)),
        ("2**3**2", sp.Integer(512)),  # from the right
        ("x^2", x**2),
        ("x - v - u", x - v - u),
        ("x / v * u", x / v * u),
        ("sin(x + 1/2)", sp.sin(x + sp.Rational(1, 2))),
        ("sat(x)", sp.Min(1, sp.Max(-1, x))),
        ("dead_zone(x, 1/2)", x - sp.Min(sp.Rational(1, 2), sp.Max(-sp.Rational(1, 2), x))),
        ("max(x, v, 0)", sp.Max(0, v, x)),
        ("piecewise(x < -1, -1, x <= 1, x, 1)", sp.Piecewise((-1, x < -1), (x, x <= 1), (1, True))),
        ("sqrt(2)*pi", sp.sqrt(2) * sp.pi),
        (" x\t+\n v ", x + v),
        ("rate(x)", NAMES["x'"]),
        ("x'", NAMES["x'"]),
    ],
)
def test_formulas_are_read_as_they_are_meant(text: str, expected: sp.Expr) -> None:
    assert parsed(text) == expected


def test_an_equation_is_left_minus_right() -> None:
    for text in ("x' = v - x", "x' == v - x", "x' - v + x"):
        assert sp.expand(parse_equation("toy", text, NAMES) - (NAMES["x'"] - v + x)) == 0


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('touch owned')",
        "__import__",
        "x.__class__",
        "x.diff(t)",
        "().__class__.__bases__",
        "lambda: 0",
        "[c for c in ()]",
        "{x: 1}",
        "x if v else u",
        "x; v",
        "x # comment",
        "'x'",
        '"x"',
        "f'{x}'",
        "exec(x)",
        "eval(x)",
        "open(x)",
        "Symbol(x)",
        "S",
        "oo",
        "I",
        "1j",
        "0x10",
        "1_000",
        "x := 1",
        "x @ v",
        "x % v",
        "x // v",
        "x & v",
        "~x",
        "not x",
        "x\\v",
        "x''",
        "2x",
        "sin x",
        "sin",
        "sin()",
        "sin(x, v)",
        "min(x)",
        "unknown(x)",
        "x < 1",
        "piecewise(x, 1)",
        "",
        " ",
        "(x",
        "x)",
        "x +",
        "* x",
        "x = v = u",
        "y",
        "ｘ",  # a full-width x, which Python takes for x
        "х",  # Cyrillic
        "x²",
        "x\u200b",  # zero-width
        "１",
        "−x",
        "x\u2028v",
        "x\x00",
    ],
)
def test_when_a_text_is_no_formula_expect_one_line_with_the_column(text: str) -> None:
    with pytest.raises(InputError, match=r"toy: equation 1: column \d+: got") as raised:
        parsed(text)
    assert str(raised.value).isascii()
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    "text",
    [
        "9**9**9",
        "(9**64)**64",
        "10**(10**9)",
        "x**65",
        "x**0.123456789",
        "x**(1/1000)",
        "(x + v + u + 1)**64",
        "((x + 1)**64)**64",
        "((x+v)**40/(x-v)**40)**40",
        "exp(exp(exp(100)))",
        "exp(10**9)",
        "1e999",
        "1e-999",
        "9" * 61,
        "(" * (MAX_DEPTH + 1) + "x" + ")" * (MAX_DEPTH + 1),
        "-" * (MAX_DEPTH + 1) + "x",
        "sin(" * (MAX_DEPTH + 1) + "x" + ")" * (MAX_DEPTH + 1),
        "x**" * (MAX_DEPTH + 1) + "1",
        "x + " * (MAX_LENGTH // 4) + "x",
        "1/0",
        "x/(v - v)",
        "0**-1",
        "log(0)",
        "sqrt(-1)",
        "asin(2)",
        "tan(pi/2)",
        "(-8)**(1/3)",
    ],
)
def test_when_a_formula_is_too_large_or_has_no_value_expect_refusal_at_once(text: str) -> None:
    with pytest.raises(InputError, match="toy: equation 1"):
        parsed(text)


PIECES = [*"xvu01.9e+-*/^()=<>,' \n_", "sin(", "sat(", "piecewise(", "**", "x'"]


@given(st.lists(st.sampled_from(PIECES), max_size=24).map("".join))
@settings(max_examples=150, deadline=None)
def test_any_text_gives_an_expression_of_the_names_or_a_refusal(text: str) -> None:
    try:
        expression = parse_equation("toy", text, NAMES)
    except InputError:
        return
    assert expression.free_symbols <= set(NAMES.values())
    assert not expression.has(sp.zoo, sp.nan, sp.oo)


def test_no_user_text_reaches_the_evaluators_of_sympy_or_python() -> None:
    """sympify of text is eval: the package has it strict only, which takes no text, and never eval or exec of text."""
    allowed = {("user_code.py", "exec"), ("user_code.py", "compile")}  # FILE.py:NAME, which says so
    allowed.add(("parameters.py", "eval"))  # annotations of our own options
    for path in Path(quasilpv.__file__).parent.rglob("*.py"):
        for call in (node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)):
            called = call.func
            name = called.attr if isinstance(called, ast.Attribute) else getattr(called, "id", "")
            if name == "sympify":
                assert any(keyword.arg == "strict" for keyword in call.keywords), path
            plain = isinstance(called, ast.Name) and name in {"eval", "exec", "compile"}
            evaluators = {"parse_expr", "S", "parse_latex", "parse_mathematica"}
            if plain or (isinstance(called, ast.Attribute) and name in evaluators):
                assert (path.name, name) in allowed, path
