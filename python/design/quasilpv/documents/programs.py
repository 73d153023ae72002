"""Programs: vector-valued postfix code that the run-time side evaluates without knowing the robot.

A program is a list of instructions from the closed list ``OPERATIONS`` (``docs/reference/formats.md``), evaluated in
the order of the list on a stack of at most ``MAX_STACK`` values; what remains on the stack are its outputs, in order.
`compile_program` makes one from expressions, ``evaluate`` is the numpy reference of the C++ evaluation.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, field_validator, model_validator

from quasilpv.arrays import FloatArray
from quasilpv.documents.canonical import MAX_SAFE_INTEGER
from quasilpv.documents.strict_model import LARGEST_NUMBER, FieldError, StrictModel
from quasilpv.errors import InputError

MAX_STACK = 64
MAX_LENGTH = 4096
MAX_POWER = 16
MAX_JOINTS = 7
MAX_SIGNALS = 128

SERIES_RADIUS = 0.1
"""Up to here the derivative of sinc is summed from its series: the first term left out is x^9/4e6."""


def sinc(x: Any) -> Any:
    """Return ``sin(x)/x``, 1 at 0 (not the normalised ``numpy.sinc``); elementwise, any shape."""
    safe = np.where(x == 0.0, 1.0, x)
    return np.where(x == 0.0, 1.0, np.sin(safe) / safe)


def sinc_slope(x: Any) -> Any:
    """Return ``(cos(x) - sin(x)/x)/x``, the derivative of ``sinc``, 0 at 0; elementwise, any shape."""
    near, safe = np.abs(x) < SERIES_RADIUS, np.where(np.abs(x) < SERIES_RADIUS, 1.0, x)
    series = -x / 3.0 * (1.0 - x * x / 10.0 * (1.0 - x * x / 28.0 * (1.0 - x * x / 54.0)))
    return np.where(near, series, (np.cos(safe) - np.sin(safe) / safe) / safe)


def quotient(function: Callable[[Any], Any], x: Any) -> Any:
    """Return ``function(x)/x``, 1 at 0, of a function with value 0 and slope 1 there; elementwise, any shape."""
    safe = np.where(x == 0.0, 1.0, x)
    return np.where(x == 0.0, 1.0, function(safe) / safe)


def log_chord(a: Any, w: Any) -> Any:
    """Return ``(log(a + w) - log a)/w``, ``1/a`` at w = 0; elementwise, any shape."""
    safe = np.where(w == 0.0, 1.0, w)
    return np.where(w == 0.0, 1.0 / a, np.log1p(safe / a) / safe)


def abs_chord(a: Any, w: Any) -> Any:
    """Return ``(|a + w| - |a|)/w``; 0, between both slopes, where a and w are 0."""
    low, high = np.minimum(a, a + w), np.maximum(a, a + w)
    across = (np.abs(a + w) - np.abs(a)) / np.where(w == 0.0, 1.0, w)
    falls = np.where((high <= 0.0) & (low < 0.0), -1.0, across)
    return np.where((low >= 0.0) & (high > 0.0), 1.0, falls)


def atan_chord(a: Any, w: Any) -> Any:
    """Return ``(atan(a + w) - atan a)/w``, at w = 0 ``1/(1 + a^2)``: the angle between (1, a) and (1, a + w)."""
    safe = np.where(w == 0.0, 1.0, w)
    return np.where(w == 0.0, 1.0 / (1.0 + a * a), np.arctan2(safe, 1.0 + a * (a + safe)) / safe)


def asin_chord(a: Any, w: Any) -> Any:
    """Return ``(asin(a + w) - asin a)/w``, at w = 0 ``1/sqrt(1 - a^2)``: an angle by its sine and cosine.

    The sine is ``b sqrt(1 - a^2) - a sqrt(1 - b^2)``, b = a + w; of equal signs it is multiplied out, so that nothing
    cancels.
    """
    b = a + w
    of_a, of_b = np.sqrt((1.0 - a) * (1.0 + a)), np.sqrt((1.0 - b) * (1.0 + b))
    safe, mixed = np.where(w == 0.0, 1.0, w), b * of_a + a * of_b
    sine = np.where(
        np.sign(a) * np.sign(b) > 0.0, safe * ((a + b) / np.where(mixed == 0.0, 1.0, mixed)), b * of_a - a * of_b
    )
    return np.where(w == 0.0, 1.0 / of_a, np.arctan2(sine, of_a * of_b + a * b) / safe)


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


JOINT_INPUTS = ("angle", "speed", "reference_speed")
INPUTS = (*JOINT_INPUTS, "signal")
"""What programs read: values of joints, in artifacts of robots; signals by number, in artifacts of systems."""

OPERATIONS: Mapping[str, Operation] = {
    "const": Operation(0, "number"),
    **{name: Operation(0, "joint") for name in JOINT_INPUTS},
    "signal": Operation(0, "signal"),
    "neg": Operation(1, None, np.negative),
    "sin": Operation(1, None, np.sin),
    "cos": Operation(1, None, np.cos),
    "asin": Operation(1, None, np.arcsin),
    "acos": Operation(1, None, np.arccos),
    "exp": Operation(1, None, np.exp),
    "sqrt": Operation(1, None, np.sqrt),
    "log": Operation(1, None, np.log),
    "tanh": Operation(1, None, np.tanh),
    "abs": Operation(1, None, np.abs),
    "sinc": Operation(1, None, sinc),
    "sinc_slope": Operation(1, None, sinc_slope),
    "expm1_quotient": Operation(1, None, functools.partial(quotient, np.expm1)),
    "tanh_quotient": Operation(1, None, functools.partial(quotient, np.tanh)),
    "pow_int": Operation(1, "power", integer_power),
    "add": Operation(2, None, np.add),
    "sub": Operation(2, None, np.subtract),
    "mul": Operation(2, None, np.multiply),
    "div": Operation(2, None, np.divide),
    "atan2": Operation(2, None, np.arctan2),
    "min": Operation(2, None, np.minimum),
    "max": Operation(2, None, np.maximum),
    "log_chord": Operation(2, None, log_chord),
    "abs_chord": Operation(2, None, abs_chord),
    "atan_chord": Operation(2, None, atan_chord),
    "asin_chord": Operation(2, None, asin_chord),
}


_ARGUMENTS: Mapping[str, tuple[tuple[type, ...], float, float, str]] = {
    "number": ((int, float), -LARGEST_NUMBER, LARGEST_NUMBER, f"one number of at most {LARGEST_NUMBER:g} as argument"),
    "joint": ((int,), 0, MAX_JOINTS - 1, f"one joint index from 0 to {MAX_JOINTS - 1} as argument"),
    "signal": ((int,), 0, MAX_SIGNALS - 1, f"one number of a signal from 0 to {MAX_SIGNALS - 1} as argument"),
    "power": ((int,), 1, MAX_POWER, f"one integer exponent from 1 to {MAX_POWER} as argument"),
}


class Program(StrictModel):
    """A postfix program with ``outputs`` values; construction checks every instruction and the stack discipline."""

    outputs: int = Field(ge=0, le=MAX_STACK)
    code: tuple[tuple[Any, ...], ...] = Field(max_length=MAX_LENGTH)

    @field_validator("code", mode="before")
    @classmethod
    def _doubles(cls, code: Any) -> Any:
        """JSON writes 5e16 without a point, and its digits need not be those of the double: it is one all the same."""
        if isinstance(code, list | tuple):
            return tuple(cls._doubles(part) for part in code)
        return float(code) if type(code) is int and MAX_SAFE_INTEGER < abs(code) < LARGEST_NUMBER else code

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
        """Return, for each of ``INPUTS`` the program reads, the highest index it uses."""
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
) -> FloatArray:
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
    arrays: dict[str, FloatArray] = {}
    for variable, highest in program.inputs().items():
        if values[variable] is None:
            raise InputError("program", variable, "nothing", f"at least {highest + 1} joints, which the code reads")
        array = np.asarray(values[variable], dtype=np.float64)
        if array.ndim == 0 or len(array) <= highest:
            raise InputError("program", variable, f"shape {array.shape}", f"at least {highest + 1} joints")
        arrays[variable] = array
    return _evaluate(program, arrays, np.asarray(angle, dtype=np.float64).shape[1:])


def evaluate_signals(program: Program, signals: npt.ArrayLike) -> FloatArray:
    """Evaluate a program of signals.

    Args:
        program: what to evaluate.
        signals: their values, (count,) or (count, samples).

    Returns:
        As `evaluate`.

    Raises:
        InputError: the program reads something else, or more signals.
    """
    values = np.asarray(signals, dtype=np.float64)
    for variable, highest in program.inputs().items():
        if variable != "signal" or len(values) <= highest:
            raise InputError("program", variable, f"{len(values)} signals", f"at least {highest + 1}, and no joints")
    return _evaluate(program, {"signal": values}, values.shape[1:])


def _evaluate(program: Program, arrays: Mapping[str, FloatArray], samples: tuple[int, ...]) -> FloatArray:
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
