"""Questions as a program asks them: about a system it has made, a function of parameters, or a name of the catalogue.

What is here keeps its names and its meaning: `quasilpv.solve`, `quasilpv.boundary` and `quasilpv.region` are these.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypedDict, Unpack

from quasilpv.arguments import checked
from quasilpv.conditions.choices import Form, Slack
from quasilpv.conditions.condition import Options
from quasilpv.defaults import RELATIVE_TOLERANCE
from quasilpv.errors import InputError
from quasilpv.lmi.budget import DEFAULT, Limits
from quasilpv.studies.answer import Answer
from quasilpv.studies.answering import answered
from quasilpv.studies.boundary import Boundary, Interval, find_boundary
from quasilpv.studies.checkpoint import Forgetful
from quasilpv.studies.engines import in_processes
from quasilpv.studies.question import Question
from quasilpv.studies.region import Axis, Map, Region
from quasilpv.systems.own_kind import SystemLike, own_kind


class QuestionOptions(TypedDict, total=False):
    """What every question takes by name; see `quasilpv.conditions.condition.Options` and `Question`."""

    representation: str
    parameters: Mapping[str, float]
    slack: Slack | str
    decay_rate: float
    form: Form | str
    window_s: float | None
    common: bool
    sample_period_s: float
    time_limit_s: float | None
    memory_limit_gib: float | None


@checked
def solve(system: SystemLike, condition: str, **options: Unpack[QuestionOptions]) -> Answer:
    """Whether a condition holds for a system, with how sure, why, and the law of the solution.

    >>> import quasilpv as ql
    >>> ql.solve("ex-I.1", "II.6", parameters={"b": 2.5}).headline
    'feasible, proved'

    Args:
        system: a `DescriptorSystem`, a function of parameters with defaults that makes one, or a name: one of the
            catalogue, ``FILE.py:NAME``, an entry point.
        condition: its id, e.g. ``"II.5"``.
        **options: ``representation`` (the published one by default), ``parameters`` of the system by name,
            ``decay_rate`` (1/s), ``slack``, ``form``, ``window_s``, ``common``, ``sample_period_s``;
            ``time_limit_s`` and ``memory_limit_gib`` of every answer, None for no limit (100 s and 4 GiB by default).

    Raises:
        InputError: something does not exist or does not fit; one line says what, what it got and what it expected.
    """
    return answered(question(system, condition, **options))


@checked
def boundary(
    system: SystemLike,
    condition: str,
    over: tuple[str, float, float],
    *,
    tolerance: float = RELATIVE_TOLERANCE,
    **options: Unpack[QuestionOptions],
) -> Boundary:
    """Where a condition stops being feasible along one parameter, by bisection.

    >>> import quasilpv as ql
    >>> edge = ql.boundary("ex-I.1", "II.6", ("b", 0.0, 30.0), parameters={"a": 1.0})
    >>> f"{edge.value:.3f}"
    '2.700'

    Args:
        system, condition, options: as for `solve`.
        over: name of the parameter and the two ends of its range, e.g. ``("b", 0.0, 30.0)``.
        tolerance: width of the final interval, relative to where it is.

    Raises:
        InputError: as for `solve`, or the range is none.
    """
    return find_boundary(question(system, condition, **options), Interval(*over), tolerance)


@checked
def region(
    system: SystemLike,
    condition: str,
    x: tuple[str, float, float, int],
    y: tuple[str, float, float, int],
    *,
    grid: bool = False,
    processes: int = 1,
    **options: Unpack[QuestionOptions],
) -> Region:
    """A map of where a condition is feasible over two parameters.

    >>> import quasilpv as ql
    >>> found = ql.region("ex-I.1", "II.6", ("a", -8.0, 8.0, 5), ("b", -20.0, 20.0, 5))
    >>> f"{found.areas.proved_share:.0%} proved"
    '75% proved'

    Of areas, each proved by one solution, where the data are affine in both; of points elsewhere, and then nothing is
    known between them (`Region.areas` is None).

    Args:
        system, condition, options: as for `solve`.
        x, y: name of a parameter, first and last value, number of values, e.g. ``("a", -8.0, 8.0, 17)``.
        grid: every point of the grid and no areas, instead of what is needed to tell where the condition holds.
        processes: how many solve at once; systems of the running program travel to them by value.

    Raises:
        InputError: as for `solve`, an axis is none, or there is less than one process.
    """
    if processes < 1:
        raise InputError("region", "processes", processes, "at least 1")
    asked = question(system, condition, **options)
    survey = Map(
        asked,
        Axis(*x),
        Axis(*y),
        solver=in_processes(processes),
        memory=Forgetful(),
        progress=lambda done, total: None,
    )
    if grid:
        return survey.full()
    return survey.areas() if survey.proves_areas else survey.adaptive()


def question(system: SystemLike, condition: str, **options: Unpack[QuestionOptions]) -> Question:
    """The question that `solve` answers. Arguments and errors as there."""
    own = ("representation", "parameters", "time_limit_s", "memory_limit_gib")
    chosen: dict[str, Any] = {name: value for name, value in options.items() if name not in own}
    for name, kind in (("slack", Slack), ("form", Form)):
        if name in chosen:
            chosen[name] = _member(kind, name, chosen[name])
    unknown = set(chosen) - set(Options.__dataclass_fields__)
    if unknown:
        known = ", ".join([*own, *Options.__dataclass_fields__])
        raise InputError("question", "option", ", ".join(sorted(unknown)), f"one of {known}")
    return Question(
        system if isinstance(system, str) else own_kind(system),
        condition,
        options.get("representation", ""),
        tuple(options.get("parameters", {}).items()),
        Options(**chosen),
        Limits(options.get("time_limit_s", DEFAULT.time_s), options.get("memory_limit_gib", DEFAULT.memory_gib)),
    )


def _member(kind: type[Slack] | type[Form], name: str, value: str) -> Slack | Form:
    try:
        return kind(value)
    except ValueError:
        raise InputError("question", name, value, f"one of {', '.join(kind)}") from None
