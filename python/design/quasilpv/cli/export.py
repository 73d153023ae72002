"""``design export``: gains and model of an artifact for other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from quasilpv.cli.console import JsonOption, print_json, print_note
from quasilpv.files import claim_file


def export_command(
    artifact: Annotated[Path, typer.Argument(metavar="ARTIFACT", help="File, JSON or CBOR twin.")],
    *,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="FILE", help="What to write.")],
    form: Annotated[
        Literal["mat", "npz", "json"] | None,
        typer.Option("--format", help="mat for MATLAB, npz for numpy, json.  [default: as FILE ends, else json]"),
    ] = None,
    json: JsonOption = False,
) -> None:
    """Write the vertices of the gains, the box of the premises and, of a system, its model, as plain arrays.

    The law is u = K(z) x, added, not subtracted. Numbers are those of the artifact, unchanged.

    \b
    Example:
      design export out/bus/artifact.json -o bus.mat
    """
    from quasilpv.artifact import read_artifact
    from quasilpv.artifact.system_store import read_system_artifact
    from quasilpv.exchange import FORMATS, export

    system = read_system_artifact(artifact)
    what = read_artifact(artifact) if system is None else system
    claim_file(out)
    own = form or (out.suffix[1:] if out.suffix[1:] in FORMATS else "json")
    export(what, out, own)
    if json:
        print_json({"file": str(out), "format": own})
    else:
        print_note(f"wrote {out}")
