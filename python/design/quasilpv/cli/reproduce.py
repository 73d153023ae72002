"""``design reproduce``: the source's figures and tables, with a verdict each."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from quasilpv.cli.console import JsonOption, print_json, print_note, print_table, progress
from quasilpv.cli.options import FormatOption, formats_of
from quasilpv.errors import InputError
from quasilpv.files import claim_folder

REASON_WIDTH = 100


def reproduce_command(
    ids: Annotated[list[str] | None, typer.Argument(metavar="ID...", help="Items of design list --items.")] = None,
    *,
    everything: Annotated[bool, typer.Option("--all", help="Every item.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="Coarser grids; the same rules.")] = False,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="Where results and figures are kept.")] = Path(
        "out/reproduction"
    ),
    figure_formats: FormatOption = None,
    json: JsonOption = False,
) -> None:
    """Regenerate figures and tables of the source: figure, numbers, and a verdict computed from them.

    Rules, fixed beforehand: numbers within a factor 1.25, counts exactly, regions with a Jaccard index of at least 0.9,
    inclusions point by point. An item computed before is taken from the folder.

    \b
    Examples:
      design reproduce fig-II.7 table-II.4
      design reproduce --all --quick
    """
    from quasilpv.reproduction import ITEMS, Effort, item, reproduce

    if everything == bool(ids):
        got = "both items and --all" if ids else "nothing"
        raise InputError("command line", "reproduce", got, "--all, or items of design list --items")
    formats = formats_of(figure_formats)
    wanted = list(ITEMS.values()) if everything else [item(name) for name in dict.fromkeys(ids or ())]
    claim_folder(out)
    with progress(len(wanted)) as steps:
        effort = Effort.QUICK if quick else Effort.FULL
        rows = reproduce(wanted, effort, out, formats=formats, begin=steps.begin, end=steps.end)
    if json:
        print_json(rows)
        return
    table = [(row["id"], row["verdict"], _shortened(row["reason"]), f"{row['seconds']:.1f}") for row in rows]
    print_table("reproduction", ("item", "verdict", "reason", "s"), table, left_columns=3)
    print_note(f"wrote {out / 'results.json'} and the figures beside it")


def _shortened(reason: str) -> str:
    return reason if len(reason) <= REASON_WIDTH else reason[: REASON_WIDTH - 1] + "…"
