"""``design list``: what there is."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from quasilpv.cli.console import JsonOption, print_json, print_table
from quasilpv.errors import InputError
from quasilpv.synthesis import CONTROLLERS


def listing_command(
    *,
    items: Annotated[
        bool, typer.Option("--items", help="Also the figures and tables of the source, for design reproduce.")
    ] = False,
    json: JsonOption = False,
) -> None:
    """List robots, scenarios, controllers, systems and conditions; with --items what design reproduce knows.

    \b
    Example:
      design list --items
    """
    from quasilpv.conditions.registry import CONDITIONS
    from quasilpv.reproduction import ITEMS
    from quasilpv.scenarios import tracking_experiments
    from quasilpv.systems.catalogue import system_names
    from quasilpv.systems.robots.registry import all_robots

    known: dict[str, list[dict[str, Any]]] = {
        "robots": [{"id": robot.id, "summary": robot.summary} for robot in all_robots()],
        "scenarios": [
            {"id": one.name, "summary": one.summary, "robot": one.robot.id} for one in tracking_experiments()
        ],
        "controllers": [{"id": name, "summary": kind.summary} for name, kind in CONTROLLERS.items()],
        "systems": [_system(name) for name in system_names()],
        "conditions": [{"id": name, "summary": entry.summary} for name, entry in CONDITIONS.items()],
        "items": [{"id": name, "summary": entry.title} for name, entry in ITEMS.items()],
    }
    if json:
        print_json(known)
        return
    hidden = known.pop("items") if not items else []
    for kind, entries in known.items():
        print_table(kind, ("", ""), [(f"  {entry['id']}", entry["summary"]) for entry in entries], left_columns=2)
    if hidden:
        print(f"{len(hidden)} figures and tables of the source: design list --items")


def _system(name: str) -> dict[str, Any]:
    """A system; of one whose package cannot be loaded, why."""
    from quasilpv.systems.catalogue import system_kind

    try:
        kind = system_kind(name)
    except InputError as error:
        return {"id": name, "summary": f"cannot be loaded: {error}", "parameters": []}
    return {"id": name, "summary": kind.summary, "parameters": list(kind.parameters)}
