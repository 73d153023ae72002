"""``design verify``: every claim of an artifact, decided again, with what the verdict rests on."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from quasilpv.cli.console import JsonOption, print_json, print_table


def verify_command(
    artifact: Annotated[Path, typer.Argument(metavar="ARTIFACT", help="File, JSON or CBOR twin.")],
    json: JsonOption = False,
) -> int:
    """Check every inequality an artifact claims, from the artifact alone.

    Each claim says what its verdict rests on: exact (rational arithmetic), enclosed (guaranteed intervals) or sampled
    (double arithmetic at points, no proof). Exit code 1 if a claim does not hold. The checker shares no code with the
    design.

    \b
    Example:
      design verify out/arm3/artifact.json
    """
    from quasilpv.artifact import read_artifact
    from quasilpv.artifact.system_store import read_system_artifact
    from quasilpv.certificate import verify
    from quasilpv.certificate.systems import verify_system

    system = read_system_artifact(artifact)
    if system is None:
        verdict = verify(read_artifact(artifact).content(), str(artifact))
    else:
        verdict = verify_system(system, str(artifact))
    if json:
        print_json(verdict.to_document())
    else:
        rows = [
            (claim.name, "holds" if claim.holds else "FAILS", claim.evidence.value, f"{claim.margin:.2e}")
            for claim in verdict.claims
        ]
        print_table(str(artifact), ("inequality", "", "evidence", "margin"), rows, left_columns=3)
        word = "verified" if verdict.verified else "NOT verified"
        print(f"{word}: {len(verdict.claims)} inequalities, {verdict.evidence_in_words}, in {verdict.seconds:.3f} s")
    return 0 if verdict.verified else 1
