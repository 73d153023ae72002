"""``design log``: what is in the log of a run, its figures, its replay, and its conversion."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from quasilpv.cli.console import JsonOption, print_json, print_note, print_table
from quasilpv.cli.logs import LogArtifactOption, open_log
from quasilpv.cli.options import FormatOption, formats_of
from quasilpv.errors import ClaimError, InputError
from quasilpv.files import claim_file, claim_folder

if TYPE_CHECKING:
    from quasilpv.telemetry import RunLog
    from quasilpv.telemetry.log import Messages


class Action(StrEnum):
    """What to do with a log."""

    INFO = "info"
    PLOT = "plot"
    REPLAY = "replay"
    TO_MCAP = "to-mcap"


def log_command(
    action: Annotated[Action, typer.Argument(metavar="ACTION", help="info, plot, replay or to-mcap.")],
    log: Annotated[str, typer.Argument(metavar="LOG", help="A log, or LAST: that of the last run.")],
    *,
    artifact: LogArtifactOption = None,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", metavar="PATH", help="plot: folder; to-mcap: file.  [default: beside the log]"),
    ] = None,
    figure_formats: FormatOption = None,
    json: JsonOption = False,
) -> None:
    """Look into the log that every run of design track, hil and simulate -o writes.

    \b
    info     channels, counts, rates, what is missing, the artifact's hash
    plot     the figures of the run, as design track or simulate draws them
    replay   the controller again, in lock-step, on the logged measurements; exit
             code 1 unless it commands the logged torques or inputs, bit for bit
    to-mcap  a file that Foxglove and PlotJuggler open

    \b
    Examples:
      design log info LAST
      design log to-mcap LAST -o run.mcap
    """
    if out is not None and action not in (Action.PLOT, Action.TO_MCAP):
        raise InputError("command line", "-o", out, f"nothing beside {action.value}, which writes no file")
    if figure_formats and action is not Action.PLOT:
        raise InputError("command line", "--figure-format", ", ".join(figure_formats), "nothing but beside plot")
    formats = formats_of(figure_formats)
    opened = open_log(log, artifact)
    if action is Action.PLOT:
        _plot(opened, out, formats, json)
    else:
        _ACTIONS[action](opened, out, json)


def _info(log: RunLog, _: Path | None, json: bool) -> None:
    about, channels = _about(log), _channels(log)
    if json:
        print_json({**about, "channels": channels, "events": _events(log), "foreign": dict(log.foreign)})
        return
    print_table(log.source, ("", ""), [(name, _text(value)) for name, value in about.items() if value is not None], 2)
    columns = ("channel", "messages", "rate\nHz", "samples", "missing", "repeated", "refused")
    rows = [(name, *(_cell(entry[key.split("\n")[0]]) for key in columns[1:])) for name, entry in channels.items()]
    print_table("channels", columns, rows)
    print_table("events", ("sample", "event"), [(str(event["seq"]), event["event"]) for event in _events(log)])


def _text(value: Any) -> str:
    return ", ".join(f"{name} ({what})" for name, what in value.items()) if isinstance(value, dict) else str(value)


def _about(log: RunLog) -> dict[str, Any]:
    import numpy as np

    from quasilpv.telemetry.codes import AT_LIMIT, INPUT_AT_LIMIT
    from quasilpv.telemetry.log import ARTIFACT, HEADER

    telemetry, about = log["telemetry"], {"log": log.source, "duration_s": round(log.duration_s, 6)}
    if HEADER in log.documents and log.is_of_system:
        about |= {"mode": log.header.mode, "scenario": log.system_scenario.name, "controller": log.header.controller}
        about |= {"signals": _signals(log)}
    elif HEADER in log.documents:
        scenario = log.scenario
        about |= {"mode": log.header.mode, "scenario": scenario.name, "plant": scenario.plant.label}
        about |= {"controller": log.header.controller, "trajectory_hash": log.trajectory.hash}
    if ARTIFACT in log.documents:
        about |= {"artifact": log.any_artifact.name, "artifact_hash": log.any_artifact.hash}
    sessions = {session for messages in log.channels.values() for session in messages.records["session"].tolist()}
    about["sessions"] = sorted(sessions)
    about["incomplete_bytes"] = log.incomplete_bytes
    about["telemetry_drops"] = int(telemetry.records["drops"].max(initial=0))
    if telemetry.samples.size:
        limit = INPUT_AT_LIMIT if log.is_of_system else AT_LIMIT
        about["share_at_limit"] = float(np.mean((telemetry.samples["flags"] & limit) != 0))
        largest = "level" if log.is_of_system else "premise_excess"
        about[f"largest_{largest}"] = float(np.max(telemetry.samples[largest]))
    return about


def _channels(log: RunLog) -> dict[str, dict[str, Any]]:
    return {
        name: {
            "messages": int(messages.records.size),
            "rate": messages.rate_hz,
            **_samples(name, messages, log.last_seq),
            "refused": sum(messages.refused.values()),
            "refused_by_reason": dict(messages.refused),
        }
        for name, messages in log.channels.items()
    }


def _events(log: RunLog) -> list[dict[str, Any]]:
    """Who said what at which sample, in the order of the log."""
    from quasilpv.telemetry.codes import event_in_words
    from quasilpv.telemetry.log import ARTIFACT

    known = log.is_of_system and ARTIFACT in log.documents
    states = [signal.name for signal in log.system_artifact.states] if known else []
    return [{"seq": int(record["seq"]), "event": event_in_words(record, states)} for record in log["event"].records]


def _signals(log: RunLog) -> dict[str, str]:
    """The roles and the units of the signals, by name."""
    roles = {signal.name: (signal.role, signal.unit) for signal in log.system_artifact.signals}
    return {name: role if unit in ("", "1") else f"{role}, {unit}" for name, (role, unit) in roles.items()}


def _samples(name: str, messages: Messages, last_seq: int) -> dict[str, int | None]:
    """How the messages cover the samples; nothing of events, and of a truth that is not known."""
    if name == "QLPV_EVENT" or (name.endswith("_TRUTH") and not messages.records.size):
        return {"samples": None, "missing": None, "repeated": None}
    return {"samples": int(messages.samples.size), "missing": messages.missing(last_seq), "repeated": messages.repeated}


def _cell(value: float | None) -> str:
    return "-" if value is None else f"{value:g}"


def _plot(log: RunLog, out: Path | None, formats: Sequence[str], json: bool) -> None:
    folder = out or Path(log.source).parent
    claim_folder(folder)
    files = _draw(log, folder, formats)
    if json:
        print_json({"figures": [str(path) for path in files]})
    else:
        print_note(f"wrote {', '.join(path.name for path in files)} in {files[0].parent}")


def _draw(log: RunLog, folder: Path, formats: Sequence[str]) -> Sequence[Path]:
    if log.is_of_system:
        from quasilpv.experiments.system_logged import logged_system_run
        from quasilpv.figures.systems import draw_system_run

        return draw_system_run(logged_system_run(log), folder, formats)
    from quasilpv.experiments.logged import logged_result
    from quasilpv.figures.gallery import write_gallery

    return write_gallery(logged_result(log), folder, formats)


def _replay(log: RunLog, _: Path | None, json: bool) -> None:
    from quasilpv.telemetry.replay import replay

    shown = replay(log)
    if json:
        print_json({"log": log.source, "artifact_hash": log.any_artifact.hash, **asdict(shown)})
    what = "inputs" if log.is_of_system else "torques"
    if shown.first_difference is not None:
        raise ClaimError(f"{log.source}: {shown.first_difference}; expected identical {what}")
    if not json:
        until = "" if shown.fault_seq is None else f", up to the fault at sample {shown.fault_seq}"
        print(f"{shown.samples} samples replayed, {shown.compared} commands compared: identical, bit for bit{until}")


def _to_mcap(log: RunLog, out: Path | None, json: bool) -> None:
    from quasilpv.telemetry.mcap_export import write_mcap

    path = out or Path(log.source).with_suffix(".mcap")
    claim_file(path)
    count = write_mcap(log, path)
    if json:
        print_json({"mcap": str(path), "messages": count})
    else:
        print_note(f"wrote {path}: {count} messages")


_ACTIONS: Mapping[Action, Callable[[RunLog, Path | None, bool], None]] = {
    Action.INFO: _info,
    Action.REPLAY: _replay,
    Action.TO_MCAP: _to_mcap,
}
