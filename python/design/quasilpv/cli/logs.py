"""Logs as verbs take them: a file, or the word LAST."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

from quasilpv.cli.console import print_note
from quasilpv.defaults import LAST

if TYPE_CHECKING:
    from quasilpv.telemetry import RunLog

LogArtifactOption: TypeAlias = Annotated[
    Path | None,
    typer.Option("--artifact", metavar="FILE", help="The controller of the run, to be sure, or if the log holds none."),
]


def log_path(text: str) -> Path:
    """The file that the command line means.

    Raises:
        InputError: LAST, and there is no log.
    """
    from quasilpv.telemetry import latest_log

    return latest_log() if text == LAST else Path(text)


def open_log(text: str, artifact: Path | None) -> RunLog:
    """The log that the command line means, of a run of this artifact if one is given.

    Raises:
        InputError: it cannot be read, or it is of a run with another controller.
    """
    from quasilpv.artifact import read_artifact
    from quasilpv.artifact.system_store import read_system_artifact
    from quasilpv.telemetry import read_log

    log = read_log(log_path(text))
    if log.incomplete_bytes:
        print_note(
            f"warning: {log.source}: {log.incomplete_bytes} bytes of an event that was not written whole are left out; "
            f"the last whole one is of sample {log.last_seq}"
        )
    if artifact is None:
        return log
    return log.require_artifact(read_system_artifact(artifact) or read_artifact(artifact))
