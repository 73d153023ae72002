"""``design complexity``: how large conditions are."""

from __future__ import annotations

from typing import Annotated

import typer

from quasilpv.cli.console import JsonOption, print_json, print_table
from quasilpv.cli.parameters import CommonOption, RepresentationOption, SetOption, SlackOption, SystemArgument, question
from quasilpv.conditions.choices import Slack

COLUMNS = ("vertices", "unknowns", "slack_unknowns", "inequalities", "rows", "entries")


def complexity_command(
    system: SystemArgument,
    *,
    conditions: Annotated[
        list[str], typer.Option("--condition", "-c", help="A condition of design list; may be repeated.")
    ],
    representation: RepresentationOption = "",
    slack: SlackOption = Slack.THESIS,
    parameters: SetOption = None,
    common: CommonOption = False,
    json: JsonOption = False,
) -> None:
    """Count unknowns, inequalities and rows of conditions as published, from the problems as built.

    Rows are the orders of the inequalities, summed; entries their squares, summed, which some tables of the literature
    call the number of inequalities.

    \b
    Example:
      design complexity ex-I.1 --condition II.5 --condition II.6
    """
    from quasilpv.conditions.condition import Options
    from quasilpv.studies import count
    from quasilpv.systems.catalogue import system_kind

    asked = [
        question(system, name, representation, parameters, Options(slack=slack, common=common)) for name in conditions
    ]
    found = [(one.condition, one.representation, count(one).to_document()) for one in asked]
    if json:
        print_json([{"condition": name, "representation": shape, **sizes} for name, shape, sizes in found])
        return
    rows = [(name, shape, *(str(sizes[column]) for column in COLUMNS)) for name, shape, sizes in found]
    headings = ("condition", "representation", *(column.replace("_", "\n") for column in COLUMNS))
    print_table(system_kind(system).stem, headings, rows, left_columns=2)
