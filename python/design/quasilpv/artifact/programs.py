"""Programs: vector-valued postfix code that the run-time side evaluates without knowing the robot.

A program is a list of instructions from the closed list ``OPERATIONS`` (``docs/reference/formats.md``), evaluated in
the order of the list on a stack of at most ``MAX_STACK`` values; what remains on the stack are its outputs, in order.
``compile_program`` makes one from sympy expressions, ``evaluate`` is the numpy reference of the C++ evaluation.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import numpy.typing as npt
import sympy
from pydantic import Field, model_validator
from sympy.core.sorting import default_sort_key

from quasilpv.artifact.strict_model import FieldError, StrictModel
from quasilpv.errors import InputError

MAX_STACK = 64
MAX_LENGTH = 4096
MAX_POWER = 16
MAX_JOINTS = 7

Instruction = tuple[str] | tuple[str, int] | tuple[str, float]
Array = npt.NDArray[np.float64]


def sinc(x: Any) -> Any:
    """Return ``sin(x)/x``, 1 at 0 (not the normalised ``numpy.sinc``); elementwise, any shape."""
    safe = np.where(x == 0.0, 1.0, x)
    return np.where(x == 0.0, 1.0, np.sin(safe) / safe)


def integer_power(base: Any, exponent: int) -> Any:
    """Return ``base**exponent`` for an exponent >= 1, multiplied out from the left as the run-time side does."""
    power = base
    for _ in range(exponent - 1):
        power = power * base
    return power


@dataclass(frozen=True)
class Operation:
    """One entry of the closed list: how many values it pops, which argument it carries, what it computes.

    ``function`` takes the popped values, deepest first (and the exponent, for ``pow_int``); operands have none.
    """

    pops: int
    argument: str | None = None
    function: Callable[..., Any] | None = None


INPUTS = ("angle", "speed", "reference_speed")

OPERATIONS: Mapping[str, Operation] = {
    "const": Operation(0, "number"),
    **{name: Operation(0, "joint") for name in INPUTS},
    "neg": Operation(1, None, np.negative),
    "sin": Operation(1, None, np.sin),
    "cos": Operation(1, None, np.cos),
    "asin": Operation(1, None, np.arcsin),
    "acos": Operation(1, None, np.arccos),
    "exp": Operation(1, None, np.exp),
    "sqrt": Operation(1, None, np.sqrt),
    "sinc": Operation(1, None, sinc),
    "pow_int": Operation(1, "power", integer_power),
    "add": Operation(2, None, np.add),
    "sub": Operation(2, None, np.subtract),
    "mul": Operation(2, None, np.multiply),
    "div": Operation(2, None, np.divide),
    "atan2": Operation(2, None, np.arctan2),
}


_ARGUMENTS: Mapping[str, tuple[tuple[type, ...], float, float, str]] = {
    "number": ((int, float), -sys.float_info.max, sys.float_info.max, "one finite number as argument"),
    "joint": ((int,), 0, MAX_JOINTS - 1, f"one joint index from 0 to {MAX_JOINTS - 1} as argument"),
    "power": ((int,), 1, MAX_POWER, f"one integer exponent from 1 to {MAX_POWER} as argument"),
}


class Program(StrictModel):
    """A postfix program with ``outputs`` values; construction checks every instruction and the stack discipline."""

    outputs: int = Field(ge=0, le=MAX_STACK)
    code: tuple[tuple[Any, ...], ...] = Field(max_length=MAX_LENGTH)

    @model_validator(mode="after")
    def _check_code(self) -> Self:
        depth = 0
        for i, instruction in enumerate(self.code):
            operation = _check_instruction(instruction, f"code[{i}]")
            if depth < operation.pops:
                got = f"{instruction[0]} on a stack of {depth}"
                raise FieldError(f"code[{i}]", got, f"{operation.pops} values on the stack")
            depth += 1 - operation.pops
            if depth > MAX_STACK:
                raise FieldError(f"code[{i}]", f"stack depth {depth}", f"at most {MAX_STACK}")
        if depth != self.outputs:
            raise FieldError("outputs", self.outputs, f"{depth}, the values left on the stack")
        return self

    def inputs(self) -> dict[str, int]:
        """Return, for each of ``INPUTS`` the program reads, the highest joint index it uses."""
        highest: dict[str, int] = {}
        for instruction in self.code:
            name = instruction[0]
            if name in INPUTS:
                highest[name] = max(highest.get(name, 0), instruction[1])
        return highest


def _check_instruction(instruction: tuple[Any, ...], field: str) -> Operation:
    operation = OPERATIONS.get(instruction[0]) if instruction and isinstance(instruction[0], str) else None
    if operation is None:
        raise FieldError(field, list(instruction), f"an operation of the list {', '.join(OPERATIONS)}")
    arguments = instruction[1:]
    if operation.argument is None:
        valid, expected = not arguments, "no argument"
    else:
        types, lower, upper, expected = _ARGUMENTS[operation.argument]
        # The exact type: in Python a boolean is an int.
        valid = len(arguments) == 1 and type(arguments[0]) in types and lower <= arguments[0] <= upper
    if not valid:
        raise FieldError(field, list(instruction), expected)
    return operation


def evaluate(
    program: Program,
    angle: npt.ArrayLike,
    speed: npt.ArrayLike | None = None,
    reference_speed: npt.ArrayLike | None = None,
) -> Array:
    """Evaluate a program, instruction by instruction, with nothing reassociated.

    Args:
        program: what to evaluate.
        angle: joint angles, (n,) or (n, samples), rad.
        speed: joint speeds, same shape, rad/s; needed only if the program reads them.
        reference_speed: reference joint speeds, same shape, rad/s; likewise.

    Returns:
        (outputs,) or (outputs, samples). Outside the domain of an operation values are NaN or infinite, as in IEEE 754.

    Raises:
        InputError: an input that the program reads is missing or has too few joints.
    """
    values = {"angle": angle, "speed": speed, "reference_speed": reference_speed}
    arrays: dict[str, Array] = {}
    for variable, highest in program.inputs().items():
        if values[variable] is None:
            raise InputError("program", variable, "nothing", f"at least {highest + 1} joints, which the code reads")
        array = np.asarray(values[variable], dtype=np.float64)
        if array.ndim == 0 or len(array) <= highest:
            raise InputError("program", variable, f"shape {array.shape}", f"at least {highest + 1} joints")
        arrays[variable] = array
    samples = np.asarray(angle, dtype=np.float64).shape[1:]
    stack: list[Any] = []
    with np.errstate(all="ignore"):
        for instruction in program.code:
            name, argument = instruction[0], instruction[1:]
            if name == "const":
                stack.append(np.float64(argument[0]))
            elif name in INPUTS:
                stack.append(arrays[name][argument[0]])
            else:
                operation = OPERATIONS[name]
                assert operation.function is not None
                operands = stack[-operation.pops :]
                del stack[-operation.pops :]
                stack.append(operation.function(*operands, *argument))
    outputs = np.empty((program.outputs, *samples))
    for i, value in enumerate(stack):
        outputs[i] = value
    return outputs


def compile_program(expressions: Sequence[sympy.Expr], inputs: Mapping[sympy.Symbol, tuple[str, int]]) -> Program:
    """Compile sympy expressions to one program with ``len(expressions)`` outputs.

    Sums and products are evaluated from left to right in sympy's canonical sort order, so that equal expressions give
    equal code on every machine. ``sympy.sinc`` is sin(x)/x, as in the programs; tan and atan are written with the
    operations there are.

    Args:
        expressions: real expressions in the keys of ``inputs``.
        inputs: where each symbol is read from, e.g. ``{theta_1: ("angle", 0)}``.

    Raises:
        InputError: an unknown symbol, a function outside the closed list, a number that is not a finite real, or code
            that is too long or needs too deep a stack.
    """
    code: list[Instruction] = []
    for i, expression in enumerate(expressions):
        _Compiler(inputs, f"output {i}", code).emit(sympy.sympify(expression))
    if len(code) > MAX_LENGTH:
        raise InputError("program", "code", f"{len(code)} instructions", f"at most {MAX_LENGTH}")
    try:
        return Program(outputs=len(expressions), code=tuple(code))
    except ValueError as error:
        raise InputError("program", "code", error, f"a stack of at most {MAX_STACK} values") from error


class _Compiler:
    """Emits the postfix code of one expression tree."""

    _FUNCTIONS: Mapping[Any, str] = {
        sympy.sin: "sin",
        sympy.cos: "cos",
        sympy.asin: "asin",
        sympy.acos: "acos",
        sympy.exp: "exp",
        sympy.sinc: "sinc",
        sympy.atan2: "atan2",
    }

    def __init__(self, inputs: Mapping[sympy.Symbol, tuple[str, int]], field: str, code: list[Instruction]) -> None:
        self._inputs = inputs
        self._field = field
        self._code = code

    def emit(self, node: sympy.Expr) -> None:
        if node in self._inputs:
            self._code.append(self._inputs[node])
        elif node.is_number:
            self._code.append(("const", self._number(node)))
        elif node.is_Add:
            self._emit_sum(node)
        elif node.is_Mul:
            self._emit_product(node)
        elif node.is_Pow:
            self._emit_power(node.base, node.exp)
        elif node.func in self._FUNCTIONS:
            for argument in node.args:
                self.emit(argument)
            self._code.append((self._FUNCTIONS[node.func],))
        elif node.func is sympy.tan:
            self.emit(sympy.sin(node.args[0]))
            self.emit(sympy.cos(node.args[0]))
            self._code.append(("div",))
        elif node.func is sympy.atan:
            self.emit(node.args[0])
            self._code.extend([("const", 1.0), ("atan2",)])
        else:
            known = map(str, self._inputs) if node.is_Symbol else OPERATIONS
            raise InputError("program", self._field, node, f"one of {', '.join(known)}")

    def _number(self, node: sympy.Expr) -> float:
        if node.is_real is False or not np.isfinite(value := float(node)):
            raise InputError("program", self._field, node, "a finite real number")
        return value

    def _emit_sum(self, node: sympy.Expr) -> None:
        first, *rest = sorted(node.args, key=lambda term: (term.could_extract_minus_sign(), default_sort_key(term)))
        self.emit(first)
        for term in rest:
            negative = term.could_extract_minus_sign()
            self.emit(-term if negative else term)
            self._code.append(("sub",) if negative else ("add",))

    def _emit_product(self, node: sympy.Expr) -> None:
        if node.could_extract_minus_sign():
            self.emit(-node)
            self._code.append(("neg",))
            return
        numerator: list[sympy.Expr] = []
        denominator: list[sympy.Expr] = []
        for factor in sorted(node.args, key=default_sort_key):
            inverted = factor.is_Pow and factor.exp.could_extract_minus_sign()
            (denominator if inverted else numerator).append(1 / factor if inverted else factor)
        self._emit_factors(numerator or [sympy.Integer(1)])
        if denominator:
            self._emit_factors(denominator)
            self._code.append(("div",))

    def _emit_factors(self, factors: Sequence[sympy.Expr]) -> None:
        self.emit(factors[0])
        for factor in factors[1:]:
            self.emit(factor)
            self._code.append(("mul",))

    def _emit_power(self, base: sympy.Expr, exponent: sympy.Expr) -> None:
        if exponent.could_extract_minus_sign():
            self._code.append(("const", 1.0))
            self.emit(base**-exponent)
            self._code.append(("div",))
        elif exponent == sympy.Rational(1, 2):
            self.emit(base)
            self._code.append(("sqrt",))
        elif exponent.is_Integer and int(exponent) <= MAX_POWER:
            self.emit(base)
            self._code.append(("pow_int", int(exponent)))
        else:
            expected = f"an integer power of at most {MAX_POWER} in absolute value, or a square root"
            raise InputError("program", self._field, base**exponent, expected)
