"""``design export-sdp``: the semidefinite program behind a law, for anybody's solver."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from quasilpv.cli.console import JsonOption, print_json, print_note
from quasilpv.files import claim_file, write_atomically


def export_sdp_command(
    artifact: Annotated[Path, typer.Argument(metavar="ARTIFACT", help="File, JSON or CBOR twin.")],
    *,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="FILE", help="SDPA sparse format, usually .dat-s.")],
    json: JsonOption = False,
) -> None:
    """Write the inequalities and the objective behind a law's gains in the SDPA sparse format.

    Feedback and observer problem side by side, at the bandwidths that were chosen, in their own units. The head of the
    file says which block is which inequality and which unknowns are which matrix.

    \b
    Example:
      design export-sdp out/arm3/artifact.json -o out/arm3/problem.dat-s
    """
    from quasilpv.artifact import read_artifact
    from quasilpv.lmi import SdpaProgram
    from quasilpv.synthesis.shipped_problem import shipped_problem

    shipped = read_artifact(artifact)
    claim_file(out)
    problem = shipped_problem(shipped.content(), str(artifact))
    program = SdpaProgram.of(problem, (f"{shipped.name}, artifact {shipped.hash}",))
    write_atomically({out: program.to_text().encode()})
    if json:
        sizes = {"unknowns": len(program.objective), "blocks": list(program.blocks), "entries": len(program.entries)}
        print_json({"file": str(out), **sizes})
        return
    print_note(f"wrote {out}: {len(program.objective)} unknowns, {len(program.blocks)} blocks")
