"""``design export``: gains and model of an artifact for other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from quasilpv.cli.console import print_note


def export_command(
    artifact: Annotated[Path, typer.Argument(metavar="ARTIFACT", help="File, JSON or CBOR twin.")],
    out: Annotated[Path, typer.Argument(metavar="FILE", help="Ends in .mat (MATLAB), .npz (numpy) or .json.")],
) -> None:
    """Write the vertices of the gains, the box of the premises and, of a system, its model, as plain arrays.

    The law is u = K(z) x, added, not subtracted. Numbers are those of the artifact, unchanged.

    \b
    Example:
      design export out/bus/artifact.json bus.mat
    """
    from quasilpv.artifact import read_artifact
    from quasilpv.artifact.system_store import read_system_artifact
    from quasilpv.exchange import export

    system = read_system_artifact(artifact)
    print_note(f"wrote {export(read_artifact(artifact) if system is None else system, out)}")
