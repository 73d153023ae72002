"""Whether a question fits its limits, and what to ask instead where it does not."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from quasilpv.conditions.choices import Slack
from quasilpv.defaults import DEFAULT_MEMORY_GIB
from quasilpv.errors import InputError
from quasilpv.lmi import budget
from quasilpv.lmi.budget import Limits, Size, TimeUpError, TooLargeError
from quasilpv.lmi.compiled import CompiledProblem, Layout
from quasilpv.studies.answer import Answer, Verdict

if TYPE_CHECKING:
    from quasilpv.studies.question import Question

ALTERNATIVE_S = 6.0
"""What writing an alternative down may take; one that takes longer is none."""

ALTERNATIVES_S = 10.0
"""What writing down all of them may take, those that take too long included: whoever asks has waited already."""

MOST_ALTERNATIVES = 3

SPARE = 0.5
"""An alternative is named if it needs this share of the memory limit at most."""


def within_limits(question: Question, answer: Callable[[], Answer], *, alternatives: bool = False) -> Answer:
    """An answer within the limits of its question.

    Args:
        question: what is asked.
        answer: finds it.
        alternatives: say what to ask instead when the time is up, which takes some seconds more.

    Returns:
        The answer, or *unknown* if the time limit was reached.

    Raises:
        TooLargeError: the problem is larger than its memory limit; names its size and cheaper ways with theirs.
    """
    start = time.perf_counter()
    try:
        with budget.limited(question.limits):
            return answer()
    except TimeUpError as error:
        reason = f"{error}; {ways(question)}" if alternatives else str(error)
        return Answer(Verdict.UNKNOWN, None, reason, None, 0, 0, time.perf_counter() - start)
    except TooLargeError as error:
        allowed = question.limits.memory_gib
        limit = "" if allowed is None else f"at most {allowed:g} GiB (--memory-limit); "
        source, field = f"condition {question.condition}", f"size in representation {question.representation}"
        raise TooLargeError(source, field, error.got, limit + ways(question)) from None


def require_affordable(question: Question, layout: Layout) -> None:
    """Refuse a problem that a solver would need more memory for than it may have.

    Args:
        question: what is asked.
        layout: of the compiled problem.

    Raises:
        TooLargeError: it is one.
    """
    allowed = question.limits.memory_gib
    if allowed is None or budget.at_most_gib(layout) <= allowed:
        return
    size = budget.estimate(layout)
    if size.memory_gib > allowed:
        raise TooLargeError("problem", "size", size, f"at most {allowed:g} GiB")


def ways(question: Question) -> str:
    """Cheaper ways to ask a question, smallest first, with their sizes."""
    found: list[tuple[Size, str]] = []
    with budget.limited(Limits(ALTERNATIVES_S)):
        for words, other in _others(question):
            size = _size(other)
            allowed = question.limits.memory_gib or DEFAULT_MEMORY_GIB
            if size is not None and size.memory_gib <= SPARE * allowed:
                found.append((size, words))
    if not found:
        return "no cheaper way of asking was found: fewer premises or a smaller system"
    found.sort(key=lambda pair: pair[0].memory_gib, reverse=True)
    shown = found[-MOST_ALTERNATIVES:]
    return "cheaper: " + "; ".join(f"{words} ({size})" for size, words in shown)


def _others(question: Question) -> Iterator[tuple[str, Question]]:
    """The question in other words."""
    options, premises = question.options, question.model().polytope.premises
    if not options.common:
        yield "--common", replace(question, options=replace(options, common=True))
    if options.slack is not Slack.NONE:
        fewer = Slack.NONE if options.slack is Slack.THESIS else Slack.THESIS
        yield f"--slack {fewer.value}", replace(question, options=replace(options, slack=fewer))
    pairs = ",".join("+".join(map(str, range(k, min(k + 2, premises)))) for k in range(0, premises, 2))
    for other in ("reduced", "per-premise", "ts", f"grouped={pairs}"):
        if premises and not question.representation.startswith(other):
            yield f"--representation {other}", replace(question, representation=other)
            if not options.common:
                common = replace(options, common=True)
                yield f"--representation {other} --common", replace(question, representation=other, options=common)


def _size(question: Question) -> Size | None:
    """The size of a question; None if it does not apply or takes too long to write down."""
    try:
        with budget.limited(Limits(ALTERNATIVE_S, question.limits.memory_gib)):
            return budget.estimate(CompiledProblem.of(question.inequalities().problem).layout)
    except (InputError, TimeUpError):
        return None
