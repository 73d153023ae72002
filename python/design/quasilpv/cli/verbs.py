"""The verbs of the command, each imported only when it is called.

Most verbs need libraries that take a second to load: symbolic algebra, solvers, plotting. The table below is all that
help and error messages need of the verbs, and the signature of a verb's function is all that its own help needs.
Therefore a module of a verb imports at its top only what states options; what the verb works with is imported in the
bodies of its functions, and what only annotations name, under ``TYPE_CHECKING``. The same holds for what verbs share at
their tops (`options`, `parameters`, `console`, `logs`, `usage`). Numbers that help pages state are in
`quasilpv.defaults`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from textwrap import TextWrapper
from typing import Any

import typer
from typer.core import CompletionItem, TyperCommand, TyperGroup  # type: ignore[attr-defined]

from quasilpv.cli.environment import away_from_here
from quasilpv.cli.usage import require_bounded, require_values
from quasilpv.errors import InputError, one_of


class VerbCommand(TyperCommand):
    """A verb, whose values are all there and all of a size that can be computed with, and whose help breaks no name."""

    def get_help(self, ctx: Any) -> str:
        """Its help page, with lines that end between words: a name with hyphens stays one that can be copied."""
        at_hyphens = TextWrapper.wordsep_re
        TextWrapper.wordsep_re = TextWrapper.wordsep_simple_re
        try:
            page: str = super().get_help(ctx)
        finally:
            TextWrapper.wordsep_re = at_hyphens
        return page

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the command line. InputError: a value is empty, not finite, or beyond all bounds."""
        require_values(args)
        rest: list[str] = super().parse_args(ctx, args)
        for parameter in self.params:
            require_bounded(parameter, ctx.params.get(parameter.name))
        return rest


@dataclass(frozen=True)
class Verb:
    """A verb of the command.

    Attributes:
        module: of `quasilpv.cli`; it holds one function, ``<module>_command``.
        summary: what the list of verbs says of it; its own help is the function's docstring.
    """

    module: str
    summary: str

    def load(self, name: str) -> TyperCommand:
        """Import the verb and build its command."""
        with away_from_here():
            module = import_module(f"quasilpv.cli.{self.module}")
        function = getattr(module, f"{self.module}_command")
        alone = typer.Typer(add_completion=False, rich_markup_mode=None)
        alone.command(name, cls=VerbCommand)(function)
        command = typer.main.get_command(alone)
        assert isinstance(command, TyperCommand)
        return command


VERBS: Mapping[str, Verb] = {
    "demo": Verb("demo", "The main job: design, track, table and figures."),
    "new": Verb("new", "A commented file to start a system or a robot of your own from."),
    "robot": Verb("robot", "A robot of your own, from its URDF or MJCF."),
    "list": Verb("listing", "What there is: robots, scenarios, systems, conditions."),
    "synth": Verb("synth", "Design a controller, of a robot or a system; write its artifact."),
    "inspect": Verb("inspect", "What is in an artifact."),
    "verify": Verb("verify", "Every inequality again, and what its verdict rests on."),
    "robust": Verb("robust", "The robust gate: every posture, payload, small delay."),
    "export": Verb("export", "Gains of an artifact for other tools: .mat, .npz, .json."),
    "export-sdp": Verb("export_sdp", "The semidefinite program behind a law, as a file."),
    "track": Verb("track", "Scenarios in closed loop: table and figures."),
    "animate": Verb("animate", "Robots in motion, with and without compensation."),
    "simulate": Verb("simulate", "A system of your own in closed loop with its equations."),
    "hil": Verb("hil", "Controller and plant as two processes over LCM."),
    "log": Verb("log", "What a run's log holds; figures, replay, MCAP."),
    "view": Verb("view", "A run in 3-D and in plots, on a local web page."),
    "solve": Verb("solve", "Whether a condition holds for a system."),
    "boundary": Verb("boundary", "Where a condition stops being feasible."),
    "region": Verb("region", "A map of feasibility over two parameters."),
    "complexity": Verb("complexity", "How large conditions are."),
    "reproduce": Verb("reproduce", "Figures and tables of the source, with verdicts."),
}


class _Commands(Mapping[str, TyperCommand]):
    """`VERBS` as the commands of a group: the names are known, the commands made on demand."""

    def __getitem__(self, name: str) -> TyperCommand:
        return VERBS[name].load(name)

    def __iter__(self) -> Iterator[str]:
        return iter(VERBS)

    def __len__(self) -> int:
        return len(VERBS)


class VerbGroup(TyperGroup):
    """A group whose commands are `VERBS`."""

    def __init__(self, **attributes: Any) -> None:
        """Take what typer gives a group, except commands."""
        super().__init__(**{**attributes, "commands": _Commands()})

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The verb that is asked for.

        Raises:
            InputError: there is none of this name.
        """
        if args[0] not in VERBS and not args[0].startswith("-"):
            raise InputError("command line", "verb", args[0], one_of(VERBS, args[0], "design --help"))
        return super().resolve_command(ctx, args)

    def shell_complete(self, ctx: Any, incomplete: str) -> list[CompletionItem]:
        """The verbs and options that begin so, without importing the verbs."""
        verbs = [CompletionItem(name, help=verb.summary) for name, verb in VERBS.items() if name.startswith(incomplete)]
        return [*verbs, *super(TyperGroup, self).shell_complete(ctx, incomplete)]

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """List the verbs without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, verb.summary) for name, verb in VERBS.items()])
