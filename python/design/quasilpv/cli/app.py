"""The application: its verbs, and the one place where exceptions become a line on stderr and an exit code."""

from __future__ import annotations

import os
import shlex
import sys
import traceback
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module

import typer

from quasilpv import __version__
from quasilpv.cli.console import print_json
from quasilpv.cli.environment import settle
from quasilpv.cli.stack import require_stack
from quasilpv.cli.stopping import Stopped, raise_when_stopped
from quasilpv.cli.streams import ReaderLeftError, answered, guarded_streams, open_missing_streams
from quasilpv.cli.usage import usage_error
from quasilpv.cli.verbs import VerbGroup
from quasilpv.errors import (
    ClaimError,
    FaultStop,
    InfeasibleError,
    InputError,
    PlantError,
    QuasilpvError,
    TransportError,
)
from quasilpv.extras import missing_extra
from quasilpv.files import one_command

EXIT_CODES: tuple[tuple[type[QuasilpvError], int], ...] = (
    (InfeasibleError, 1),
    (ClaimError, 1),
    (InputError, 2),
    (FaultStop, 3),
    (TransportError, 5),
    (PlantError, 6),
)
EXIT_MISTAKE, EXIT_INTERRUPTED, EXIT_READER_LEFT = 70, 130, 141
OUTCOMES: dict[type[QuasilpvError], str] = {
    InfeasibleError: "infeasible",
    ClaimError: "claim fails",
    FaultStop: "fault",
}
"""Errors that are answers, and how ``--json`` calls them where a verb has not answered itself."""
TRACEBACK = "QUASILPV_TRACEBACK"
"""Variable of the environment: with it, a mistake of the program is told with its traceback."""

HELP = """Control design for nonlinear descriptor systems and robots, from the model to the tracked trajectory.

\b
Examples:
  design demo
  design list
  design synth arm3 -o out/arm3
  design inspect out/arm3/artifact.json
  design verify out/arm3/artifact.json
  design robust out/arm3/artifact.json
  design track serial-square serial-circle
  design animate serial-square fivebar-spiral
  design hil serial-square --real-time
  design log info LAST
  design view --log LAST
  design solve ex-I.1 --condition II.6 --set b=2.5
  design boundary ex-I.1 --condition II.6 --over b=0:30
  design region ex-I.1 --condition II.6 --x a=-8:8:17 --y b=-20:20:41
  design reproduce --all --quick

\b
Exit codes:
  0 done                    1 infeasible, or a claim does not hold
  2 bad input, or output    3 fault stop
    that cannot be written  5 no transport
  6 plant failure           70 a mistake of this program
  128 + n stopped by signal n: 130 Ctrl-C, 141 the reader of a pipe has left
"""

app = typer.Typer(
    name="design",
    cls=VerbGroup,
    help=HELP,
    no_args_is_help=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 120},
)


def _print_version(value: bool) -> None:
    if value:
        typer.echo(f"design {__version__}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: bool = typer.Option(False, "--version", callback=_print_version, is_eager=True, help="Print the version."),
) -> None:
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def run(arguments: Sequence[str]) -> int:
    """Run the command with the given arguments and return its exit code; errors are one line on stderr.

    Args:
        arguments: the command line without the program's name.
    """
    with one_command(shlex.join(["design", *arguments])):
        try:
            with guarded_streams():
                return _run(arguments)
        except ReaderLeftError:
            return EXIT_READER_LEFT
        except Stopped as stop:
            return _fail(f"stopped by {stop.signal.name}", 128 + stop.signal)
        except InputError as error:  # of standard output
            return _fail(str(error), 2)


def _run(arguments: Sequence[str]) -> int:
    """Run the command on guarded streams."""
    try:
        require_stack()
        code = app(args=list(arguments), prog_name="design", standalone_mode=False)
        if code == EXIT_INTERRUPTED:
            raise KeyboardInterrupt  # typer has swallowed it
        return code if isinstance(code, int) else 0
    except typer.TyperException as error:
        return _fail(str(usage_error(error)), 2)
    except QuasilpvError as error:
        code = next((code for kind, code in EXIT_CODES if isinstance(error, kind)), EXIT_MISTAKE)
        outcome = next((word for kind, word in OUTCOMES.items() if isinstance(error, kind)), None)
        if outcome is not None and "--json" in arguments and not answered():
            print_json({"outcome": outcome, "reason": str(error)})
        return _fail(str(error), code)
    except (KeyboardInterrupt, typer.Abort):
        return _fail("interrupted", EXIT_INTERRUPTED)
    except ImportError as error:
        reason = missing_extra(error) or _unloadable_runtime()
        if reason is None:
            raise
        return _fail(str(reason), 2)


def main() -> None:
    """Entry point of the command ``design``."""
    open_missing_streams()
    settle()
    raise_when_stopped()
    try:
        code = run(sys.argv[1:])
    except Exception as error:
        code = _report_mistake(error)
    sys.exit(code)


def _report_mistake(error: Exception) -> int:
    """Say what nobody has foreseen, in a line; the traceback, for a report, if it is asked for."""
    if os.environ.get(TRACEBACK):
        traceback.print_exception(error)
    place = traceback.extract_tb(error.__traceback__)[-1]
    where = f"{os.path.basename(place.filename)}:{place.lineno}"
    return _fail(
        f"{type(error).__name__} at {where}: {error} (a mistake of this program; {TRACEBACK}=1 tells more)",
        EXIT_MISTAKE,
    )


def _unloadable_runtime() -> InputError | None:
    """Why the compiled module cannot be imported, and what to do about it; None if it can."""
    name = "quasilpv._runtime"
    try:
        import_module(name)
    except ImportError as error:
        expected = "the compiled module and the libraries it links: run ./tools/demo in a clone, or install the wheel"
        return InputError("installation", name, error, expected)
    return None


def _fail(message: str, code: int) -> int:
    with suppress(OSError, ValueError):  # nobody can be told
        print("error:", " ".join(message.split()), file=sys.stderr, flush=True)
    return code
