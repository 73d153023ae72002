"""Options that state a question: parameters, ranges and axes as a person types them."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import wraps
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias, TypeVar

import typer

from quasilpv.cli.usage import NUMBER_EXPECTED, number
from quasilpv.conditions.choices import Form, Slack
from quasilpv.defaults import DEFAULT_MEMORY_GIB, DEFAULT_TIME_S, REPRESENTATIONS, SAMPLE_PERIOD_S
from quasilpv.errors import InputError

if TYPE_CHECKING:
    from quasilpv.conditions.condition import Options
    from quasilpv.studies.boundary import Interval
    from quasilpv.studies.question import Question
    from quasilpv.studies.region import Axis

Result = TypeVar("Result")

MOST_POINTS = 10_000
"""Of an axis of a map."""

SystemArgument: TypeAlias = Annotated[
    str,
    typer.Argument(
        metavar="SYSTEM",
        help="A system of design list, FILE.json, a document of equations, or FILE.py:NAME, a system or a function of"
        " parameters with defaults in a file of your own. FILE.py:NAME executes the code in FILE.py; no other form"
        " executes code of a file.",
    ),
]
ConditionOption: TypeAlias = Annotated[str, typer.Option("--condition", "-c", help="A condition of design list.")]
RepresentationOption: TypeAlias = Annotated[
    str,
    typer.Option(
        "--representation",
        help=f"{' | '.join(REPRESENTATIONS)}; with the suffix @0 centred at 0 as in the thesis."
        "  [default: the one the condition was published with]",
    ),
]
SlackOption: TypeAlias = Annotated[
    Slack, typer.Option("--slack", help="Slack matrices of sums over vertices: none, as in the thesis, or all.")
]
SetOption: TypeAlias = Annotated[
    list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="A parameter of the system; may be repeated.")
]
DecayOption: TypeAlias = Annotated[float, typer.Option("--decay", help="Decay rate of the closed loop, 1/s.")]
FormOption: TypeAlias = Annotated[
    Form, typer.Option("--form", help="As published, or reduced: equivalent and smaller where a proof allows it.")
]
CommonOption: TypeAlias = Annotated[
    bool, typer.Option("--common", help="Multipliers without index: fewer unknowns, more conservative.")
]
WindowOption: TypeAlias = Annotated[
    float | None,
    typer.Option("--window-s", help="Window tau of laws with memory (II.7, II.8), s.  [default: the limit tau -> 0]"),
]
SampleOption: TypeAlias = Annotated[
    float, typer.Option("--sample-period-s", help="Sample period of conditions on a sampled model, s.")
]

TimeLimitOption: TypeAlias = Annotated[
    float,
    typer.Option("--time-limit", help="Seconds for an answer, or for a point of a map; then it is unknown."),
]
MemoryLimitOption: TypeAlias = Annotated[
    float, typer.Option("--memory-limit", help="GiB for the solver; a larger problem is refused, with cheaper ways.")
]


def question(
    system: str,
    condition: str,
    representation: str,
    settings: Sequence[str] | None,
    options: Options,
) -> Question:
    """The question these options state.

    Raises:
        InputError: unknown system, condition, representation or parameter, or not a number.
    """
    from quasilpv.studies.question import Question

    values = tuple(_named_number(text) for text in settings or ())
    return Question(system, condition, representation, values, options)


def _stated(
    system: SystemArgument,
    *,
    condition: ConditionOption,
    representation: RepresentationOption = "",
    slack: SlackOption = Slack.THESIS,
    parameters: SetOption = None,
    decay: DecayOption = 0.0,
    form: FormOption = Form.REDUCED,
    common: CommonOption = False,
    window_s: WindowOption = None,
    sample_period_s: SampleOption = SAMPLE_PERIOD_S,
    time_limit: TimeLimitOption = DEFAULT_TIME_S,
    memory_limit: MemoryLimitOption = DEFAULT_MEMORY_GIB,
) -> Question:
    """The question of one condition; its parameters are the options of every verb that asks one."""
    from quasilpv.conditions.condition import Options
    from quasilpv.lmi.budget import Limits

    options = Options(slack, decay, form, window_s=window_s, common=common, sample_period_s=sample_period_s)
    asked = question(system, condition, representation, parameters, options)
    return replace(asked, limits=Limits(time_limit, memory_limit))


def asks_one_question(verb: Callable[..., Result]) -> Callable[..., Result]:
    """Make a verb of a function of a question: the options that state the question come before its own.

    Args:
        verb: function whose first parameter is a `Question`; the others are options as typer reads them.

    Returns:
        The function of all options, required ones first, that states the question and calls ``verb``.
    """
    shared, own = _options_of(_stated), _options_of(verb)

    @wraps(verb)
    def command(**given: Any) -> Result:
        stated = {name: given.pop(name) for name in shared}
        return verb(_stated(**stated), **given)

    options = sorted([*shared.values(), *own.values()], key=lambda option: option.default is not option.empty)
    command.__signature__ = inspect.Signature(options)  # type: ignore[attr-defined]
    command.__annotations__ = {option.name: option.annotation for option in options}
    return command


def _options_of(function: Callable[..., object]) -> dict[str, inspect.Parameter]:
    """The options of a function, with what typer reads in their annotations; a question is none.

    Its type is not looked up: the help of a verb needs no library behind it.
    """
    written = inspect.signature(function).parameters
    stated = {name: option for name, option in written.items() if option.annotation != "Question"}
    # Trusted: these are annotations as they stand in this package's own verbs; nothing a user typed gets here.
    types = {name: eval(option.annotation, function.__globals__) for name, option in stated.items()}
    return {name: option.replace(annotation=types[name]) for name, option in stated.items()}


def interval(text: str, option: str) -> Interval:
    """``b=0:30`` as a range of a parameter.

    Raises:
        InputError: another form.
    """
    from quasilpv.studies.boundary import Interval

    name, numbers = _named_range(text, option, 2)
    return Interval(name, numbers[0], numbers[1])


def axis(text: str, option: str) -> Axis:
    """``a=-8:8:17`` as equally spaced values of a parameter.

    Raises:
        InputError: another form, or a number of points that is not whole.
    """
    from quasilpv.studies.region import Axis

    name, numbers = _named_range(text, option, 3)
    if not (numbers[2].is_integer() and numbers[2] <= MOST_POINTS):
        raise InputError("command line", option, text, f"a whole number of points, at most {MOST_POINTS}")
    return Axis(name, numbers[0], numbers[1], int(numbers[2]))


def _named_number(text: str) -> tuple[str, float]:
    name, separator, number = text.partition("=")
    if not separator or not name:
        raise InputError("command line", "--set", text, "NAME=VALUE")
    return name, _number(number, "--set", text)


def _named_range(text: str, option: str, count: int) -> tuple[str, list[float]]:
    name, separator, numbers = text.partition("=")
    parts = numbers.split(":")
    if not separator or not name or len(parts) != count:
        expected = "NAME=FROM:TO" if count == 2 else "NAME=FROM:TO:POINTS"
        raise InputError("command line", option, text, expected)
    return name, [_number(part, option, text) for part in parts]


def _number(part: str, option: str, text: str) -> float:
    value = number(part)
    if value is None:
        raise InputError("command line", option, text, f"{NUMBER_EXPECTED} instead of {part or 'nothing'}")
    return value
