"""``design region``: a map of feasibility over two parameters."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from quasilpv.cli.console import JsonOption, print_json, print_note, progress
from quasilpv.cli.options import FormatOption, formats_of
from quasilpv.cli.parameters import asks_one_question, axis
from quasilpv.errors import InputError
from quasilpv.files import claim_folder, write_readable_json

if TYPE_CHECKING:
    from quasilpv.studies.question import Question
    from quasilpv.studies.region import Areas, Axis, Region

MOST_PROCESSES = 1024


@asks_one_question
def region_command(
    asked: Question,
    *,
    x: Annotated[str, typer.Option("--x", metavar="NAME=FROM:TO:POINTS", help="Horizontal axis.")],
    y: Annotated[str, typer.Option("--y", metavar="NAME=FROM:TO:POINTS", help="Vertical axis.")],
    grid: Annotated[
        bool | None,
        typer.Option(
            "--grid/--adaptive",
            help="Points only: every one, or a coarse grid refined along the boundary.  [default: areas, if possible]",
        ),
    ] = None,
    processes: Annotated[int | None, typer.Option("--processes", "-j", help="[default: one per core]")] = None,
    dask: Annotated[str | None, typer.Option("--dask", metavar="ADDRESS", help="Scheduler of a Dask cluster.")] = None,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="Where results are kept.")] = Path(
        "out/region"
    ),
    figure_formats: FormatOption = None,
    json: JsonOption = False,
) -> None:
    """Map where a condition is feasible; whatever is called feasible is proved in exact arithmetic.

    Where the data are affine in both parameters whole areas are proved, and points are solved along their edge only;
    elsewhere, or with --grid or --adaptive, points alone are. Writes the map (JSON) and a figure. An interrupted map
    goes on where it stopped when the command is given again.

    \b
    Example:
      design region ex-I.1 --condition II.6 --x a=-8:8:17 --y b=-20:20:41
    """
    from quasilpv.studies.checkpoint import Checkpoint
    from quasilpv.studies.engines import in_processes, on_cluster
    from quasilpv.studies.region import Map, counts

    formats = formats_of(figure_formats)
    across, up = axis(x, "--x"), axis(y, "--y")
    if processes is not None and not 1 <= processes <= MOST_PROCESSES:
        raise InputError("command line", "--processes", processes, f"1 to {MOST_PROCESSES}")
    solver = on_cluster(dask) if dask else in_processes(processes or os.cpu_count() or 1)
    claim_folder(out)
    memory = Checkpoint(out, asked, (across.name, up.name))
    if memory.size:
        print_note(f"{memory.size} answers known from {memory.path}")
    with progress(1) as steps:
        steps.begin("points")
        evaluation = Map(asked, across, up, solver=solver, memory=memory, progress=steps.parts)
        kind = _AREAS if grid is None and evaluation.proves_areas else _GRID if grid else _ADAPTIVE
        region = {_AREAS: evaluation.areas, _GRID: evaluation.full, _ADAPTIVE: evaluation.adaptive}[kind]()
    written = _write(region, memory.map_stem(across, up, kind), formats)
    if json:
        print_json(region.to_document())
        return
    print(_area_sentence(region.areas) if region.areas else _points_only(across, up, possible=evaluation.proves_areas))
    found = ", ".join(f"{number} {verdict.value}" for verdict, number in counts(region).items() if number)
    mean = 1e3 * region.seconds / region.evaluations
    print(f"{len(region.points)} grid points: {found}; {region.evaluations} solved, {mean:.1f} ms each")
    print_note(f"wrote {', '.join(map(str, written))}")


_AREAS, _GRID, _ADAPTIVE = "areas", "grid", "adaptive"


def _area_sentence(areas: Areas) -> str:
    return (
        f"feasible, proved, on {areas.proved_share:.1%} of the area, by {len(areas.proved)} solutions; undecided along "
        f"its edge: {areas.undecided_share:.1%}; nothing feasible found at the points tried in the rest (no proof)"
    )


def _points_only(x: Axis, y: Axis, *, possible: bool) -> str:
    if possible:
        return "points only: nothing is proved between them (without --grid and --adaptive whole areas are)"
    return (
        f"points only: the data are not shown to be affine in {x.name} and {y.name}, nothing is proved between points"
    )


def _write(region: Region, stem: Path, formats: Sequence[str]) -> list[Path]:
    """The map and its figure."""
    from quasilpv.figures.region import region_figure
    from quasilpv.figures.style import save

    document = stem.with_name(f"{stem.name}.json")
    write_readable_json(document, region.to_document())
    return [document, *save(region_figure([region]), stem, formats)]
