"""``design solve``: one condition at one parameter point."""

from __future__ import annotations

from typing import TYPE_CHECKING

from quasilpv.cli.console import JsonOption, print_json
from quasilpv.cli.parameters import asks_one_question

if TYPE_CHECKING:
    from quasilpv.studies.question import Question


@asks_one_question
def solve_command(
    asked: Question,
    *,
    json: JsonOption = False,
) -> int:
    """Decide whether a condition holds for a system.

    Of equations that are not feasible as they are factored first, other factorings of A(x) x are tried.
    The answer is one of four: feasible, proved; infeasible, proved; infeasible, numerically; unknown. Exit code 0 if
    feasible, 1 otherwise.

    \b
    Examples:
      design solve ex-I.1 --condition II.6 --set a=1 --set b=2.5
      design solve ex-I.1 --condition II.6 --set b=3 --slack full --json
    """
    from quasilpv.studies import Verdict, answered
    from quasilpv.studies.answer import reliance_document
    from quasilpv.studies.answering import largest_or_reached_margin

    answer = answered(asked)
    margin = largest_or_reached_margin(asked, answer)
    if json:
        print_json(
            {
                "verdict": answer.verdict.value,
                "evidence": answer.evidence and answer.evidence.value,
                "reason": answer.reason,
                "relies_on": [reliance_document(one) for one in answer.relies_on],
                "refutation": answer.refutation and answer.refutation.to_document(),
                "factoring": answer.factoring,
                "certified": answer.certified,
                "margin": margin,
                "unknowns": answer.unknowns,
                "rows": answer.rows,
                "seconds": answer.seconds,
            }
        )
    else:
        print(f"{answer.headline}: {answer.reason}")
        if answer.verdict is Verdict.FEASIBLE:
            for one in answer.relies_on:
                print(f"  {one.status.value}: {one.name}; {one.detail}")
        shown = "unknown" if margin is None else f"{margin:.3g}"
        print(f"margin {shown}, {answer.unknowns} unknowns, {answer.rows} rows, {answer.seconds:.3f} s")
    return 0 if answer.verdict is Verdict.FEASIBLE else 1
