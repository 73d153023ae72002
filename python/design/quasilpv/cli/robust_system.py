"""``design robust`` for general systems: a grid check, and how far intervals of parameters can grow, proved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from quasilpv.cli.console import print_json, print_note, print_table, progress
from quasilpv.files import claim_folder

if TYPE_CHECKING:
    from quasilpv.documents.system_artifact import SystemArtifactDocument
    from quasilpv.experiments.system_grid import SystemGrid

FIGURE = "grid-check"


def check_system(
    artifact: SystemArtifactDocument,
    source: str,
    delay_s: float,
    out: Path | None,
    formats: Sequence[str],
    *,
    json: bool,
) -> int:
    """Run the check and print it; exit code 1 if it is not passed.

    Raises:
        InputError: the delay is out of range, or the folder cannot be written.
        PlantError: the equations could not be integrated.
    """
    from quasilpv.experiments.system_grid import grid_check
    from quasilpv.system_release.parameter_margin import margin_document, parameter_margins

    if out is not None:
        claim_folder(out)
    has_margins = bool(artifact.parameters) and artifact.observer is None
    with progress(2 if has_margins else 1) as steps:
        steps.begin(f"points of the region of {artifact.name}")
        found = grid_check(artifact, delay_s, source=source, progress=steps.parts)
        steps.end()
        margins = []
        if has_margins:
            steps.begin("intervals of its parameters")
            margins = [margin_document(artifact, each) for each in parameter_margins(artifact, steps.parts)]
            steps.end()
    if json:
        print_json({**found.to_document(), "parameter_margins": margins})
    else:
        if margins:
            columns = ("parameter", "claim", "proved in", "refuted in", "")
            title = f"{source}: how far intervals of parameters can grow, before sampling"
            print_table(title, columns, _margin_rows(margins), left_columns=5)
        elif artifact.parameters:
            print_note("how far intervals of parameters can grow is not said: the error of an observer grows with them")
        print_table(source, ("", ""), rows_of(found), left_columns=2)
        verdict = "V falls from every point" if found.passed else "NOT passed: V does not fall from every point"
        estimated = "" if artifact.observer is None else ", and of estimates without error"
        print(f"{verdict}; sampled, not a proof{estimated}")
    if out is not None:
        from quasilpv.figures.style import save
        from quasilpv.figures.systems import grid_figure

        for path in save(grid_figure(found), out / FIGURE, formats):
            print_note(f"wrote {path}")
    return 0 if found.passed else 1


def _margin_rows(margins: Sequence[Mapping[str, Any]]) -> list[tuple[str, ...]]:
    """One per parameter and claim; between both intervals it is unknown."""
    rows: list[tuple[str, ...]] = []
    for margin in margins:
        together = "" if len(margin["parameters"]) == 1 else ", all together"
        for name in margin["parameters"]:
            proved, refuted = (
                "none found"
                if margin[word] is None
                else f"{margin[word][name][0]:.6g} to {margin[word][name][1]:.6g}, {margin[f'{word}_factor']:.4g} times"
                for word in ("proved", "refuted")
            )
            rows.append((f"{name}{together}", margin["claim"], proved, refuted, margin["reason"]))
    return rows


def rows_of(found: SystemGrid) -> list[tuple[str, str]]:
    """What a person wants to know."""
    answer = found.to_document()
    what = "over a sample" if found.delay_s == 0.0 else f"per sample, mean of {answer['samples']}"
    growth = "a state leaves its domain" if answer["worst_growth"] is None else f"{answer['worst_growth']:.9g}"
    rows = [
        ("points", f"{answer['points']}, worst ones climbed from"),
        ("delay", f"{found.delay_s:g} s"),
        (f"worst V+/V {what}", growth),
        ("  at", ", ".join(f"{name} {value:.4g}" for name, value in answer["worst_state"].items())),
    ]
    if answer["worst_parameters"]:
        rows.append(("  with", ", ".join(f"{name} {value:.4g}" for name, value in answer["worst_parameters"].items())))
    return [
        *rows,
        ("largest input", f"{100.0 * answer['largest_input_share']:.4g} % of its limit"),
        ("evidence", "sampled"),
    ]
