"""``design boundary``: where a condition stops being feasible along one parameter."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from quasilpv.cli.console import JsonOption, print_json
from quasilpv.cli.parameters import asks_one_question, interval
from quasilpv.defaults import RELATIVE_TOLERANCE

if TYPE_CHECKING:
    from quasilpv.studies.question import Question


@asks_one_question
def boundary_command(
    asked: Question,
    *,
    over: Annotated[str, typer.Option("--over", metavar="NAME=FROM:TO", help="The parameter and its range.")],
    tolerance: Annotated[
        float, typer.Option("--tolerance", min=1e-12, max=1.0, help="Relative width to stop at.")
    ] = RELATIVE_TOLERANCE,
    json: JsonOption = False,
) -> int:
    """Bisect for the limit of feasibility; the feasible side is proved in exact arithmetic.

    Exit code 1 if neither end of the range is feasible.

    \b
    Example:
      design boundary ex-I.1 --condition II.6 --set a=1 --over b=0:30
    """
    from quasilpv.studies import Evidence, find_boundary

    searched = interval(over, "--over")
    found = find_boundary(asked, searched, tolerance)
    if json:
        print_json(found.to_document())
    elif found.certified_up_to is None:
        print(f"not feasible at {searched.name} = {searched.start:g}, nor at {searched.end:g}")
    elif found.infeasible_from is None:
        print(f"feasible, proved, up to {searched.name} = {found.certified_up_to:.6g}; no infeasible point was found")
    else:
        sure = "proved" if found.infeasible_evidence is Evidence.PROVED else "numerically"
        print(
            f"{searched.name} = {found.value:.6g}: feasible, proved, up to {found.certified_up_to:.7g}; "
            f"infeasible, {sure}, from {found.infeasible_from:.7g} ({found.evaluations} points)"
        )
    return 1 if found.certified_up_to is None else 0
