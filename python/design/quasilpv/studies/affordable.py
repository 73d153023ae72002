"""Whether a question fits its limits, and what to ask instead where it does not."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace

from quasilpv.conditions.choices import Slack
from quasilpv.conditions.registry import condition
from quasilpv.defaults import DEFAULT_MEMORY_GIB
from quasilpv.errors import InputError
from quasilpv.lmi import budget
from quasilpv.lmi.budget import Limits, Size, TimeUpError, TooLargeError
from quasilpv.lmi.compiled import CompiledProblem
from quasilpv.lmi.layout import Layout
from quasilpv.studies.answer import Answer, Verdict
from quasilpv.studies.question import Question

WAYS_S = 6.0
"""What looking for cheaper ways may take in all: no answer comes later than that after its time limit."""

ALTERNATIVE_S = 3.0
"""What writing one of them down may take; one that takes longer is none."""

MOST_ALTERNATIVES = 3

REPRESENTATION = "--representation"

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
    """Cheaper ways to ask a question, smallest last, with their sizes; takes `WAYS_S` at most."""
    found: dict[Size, str] = {}
    allowed = SPARE * (question.limits.memory_gib or DEFAULT_MEMORY_GIB)
    with suppress(TimeUpError), budget.limited(Limits(WAYS_S)):
        for words, other in _others(question):
            budget.time_left_s()
            size = _size(other)
            if size is None or size.memory_gib > allowed:
                continue
            if size not in found or len(words) < len(found[size]):  # some conditions have no use for an option
                found[size] = words
        own = _size(question)
        found = {size: words for size, words in found.items() if own is None or size.memory_gib < own.memory_gib}
    if not found:
        return "no cheaper way of asking is known: fewer premises or a smaller system"
    shown = sorted(found, key=lambda size: size.memory_gib, reverse=True)[-MOST_ALTERNATIVES:]
    return "cheaper: " + "; ".join(f"{found[size]} ({size})" for size in shown)


def _others(question: Question) -> Iterator[tuple[str, Question]]:
    """The question in other words, those of few vertices first."""
    options, model = question.options, question.model()
    premises, own = model.polytope.premises, question.representation
    pairs = ",".join("+".join(map(str, range(k, min(k + 2, premises)))) for k in range(0, premises, 2))
    vertices = {
        "reduced": premises + 1,
        "per-premise": 2 * premises,
        f"grouped={pairs}": 2 * premises,
        "ts": 2**premises,
    }
    same = own.replace("uncertain", "per-premise")
    counts = {name: count for name, count in vertices.items() if premises and not same.startswith(name)}
    counts[own] = model.vertex_count
    for name in sorted(counts, key=lambda name: counts[name]):
        words = [] if name == own else [f"{REPRESENTATION} {name}"]
        other = replace(question, representation=name)
        if condition(question.condition).has_multipliers and not options.common:
            yield " ".join([*words, "--common"]), replace(other, options=replace(options, common=True))
        if words:
            yield words[0], other
        elif options.slack is not Slack.NONE and len(model.polytope.blocks) > 1:
            fewer = Slack.NONE if options.slack is Slack.THESIS else Slack.THESIS
            yield f"--slack {fewer.value}", replace(other, options=replace(options, slack=fewer))


def _size(question: Question) -> Size | None:
    """The size of a question; None if it does not apply or takes too long to write down."""
    try:
        with budget.limited(Limits(ALTERNATIVE_S, question.limits.memory_gib)):
            return budget.estimate(CompiledProblem.of(question.inequalities().problem).layout)
    except (InputError, TimeUpError):
        return None
