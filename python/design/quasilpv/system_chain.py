"""The chain for general systems as a program walks it: equations, controller, verdict, a run, files for others.

>>> import quasilpv as ql
>>> pendulum = ql.DescriptorSystem.from_equations(
...     ["x' = v", "v' = 9.81*sin(x) + u"],
...     state="x v", inputs="u", domain={"x": (-1, 1), "v": (-3, 3)}, name="pendulum",
... )
>>> controller = ql.stabilise(pendulum, decay_rate=1.0, input_limits={"u": 30.0})
>>> controller.verify().verified
True
>>> run = controller.simulate(start={"x": 0.3})
>>> run.stayed
True
>>> figure = run.plot("region")
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypedDict, Unpack

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quasilpv.arguments import checked
from quasilpv.artifact.system_store import read_system_artifact, system_summary, write_system_artifact
from quasilpv.certificate import Verification
from quasilpv.certificate.systems import verify_system
from quasilpv.documents.system_artifact import SystemArtifactDocument
from quasilpv.errors import InputError, one_of
from quasilpv.experiments.system_run import SystemExperiment, SystemRun, simulate
from quasilpv.figures.style import style
from quasilpv.figures.systems import draw_region, region_figure, signals_figure
from quasilpv.scenarios import NOISE_SEED
from quasilpv.shown import html_table
from quasilpv.synthesis.regional.request import Objective, RegionalRequest
from quasilpv.system_release import release_system
from quasilpv.systems.own_kind import SystemLike, own_kind

FIGURES = {"signals": signals_figure, "region": region_figure}


class StabiliseOptions(TypedDict, total=False):
    """What `stabilise` takes by name; see `quasilpv.synthesis.regional.request.RegionalRequest`."""

    objective: Objective
    decay_rate: float
    input_limits: Mapping[str, float]
    rate_hz: float
    speed: float
    share: float
    disturbance: Mapping[str, float]
    performance: Mapping[str, float]
    premise_fault_s: float | None
    measured: Sequence[str]
    start_estimate: Mapping[str, float]
    parameters: Mapping[str, float]
    allow_unproved_rate: bool


@dataclass(frozen=True, eq=False, repr=False)
class SystemSimulation:
    """A run of a controller against the equations of its system.

    Attributes:
        run: every sample, and what happened.
    """

    run: SystemRun

    @property
    def stayed(self) -> bool:
        """Whether V never exceeded its start, and no state left its domain."""
        return self.run.stayed

    def plot(self, name: str = "signals", *, ax: Axes | None = None) -> Figure:
        """A figure: ``signals`` with their limits, or ``region`` with the run in it.

        Args:
            name: of the figure.
            ax: draw into this plot, the reader's own: of the region in the plane of the first two states.

        Raises:
            InputError: there is none of this name, or it does not fit into one plot.
        """
        if name not in FIGURES:
            raise InputError("plot", "name", name, one_of(FIGURES, name))
        if ax is None:
            return FIGURES[name](self.run)
        if name != "region":
            raise InputError("plot", "ax", f"one plot for {name}", "region")
        with style():
            draw_region(ax, self.run)
        return ax.figure.figure

    def __repr__(self) -> str:
        """In a few lines."""
        found = self.run.to_document()
        state = ", ".join(f"{name} {value:.4g}" for name, value in found["final_state"].items())
        return (
            f"SystemSimulation({found['artifact']}, {found['samples']} samples)\n"
            f"  V {found['level_at_start']:.4g} at the start, {found['final_level']:.4g} at the end\n"
            f"  final state {state}; flags {', '.join(found['flags']) or 'none'}"
        )


@dataclass(frozen=True, eq=False, repr=False)
class SystemController:
    """A feedback with the region in which it is proved.

    Attributes:
        artifact: all of it, as it is shipped.
    """

    artifact: SystemArtifactDocument

    def verify(self) -> Verification:
        """Every claim again, from the artifact alone."""
        return verify_system(self.artifact, self.artifact.name)

    @checked
    def simulate(
        self,
        start: Mapping[str, float] | None = None,
        parameters: Mapping[str, float] | None = None,
        duration_s: float | None = None,
        *,
        delay_s: float = 0.0,
        rk4_steps: int = 0,
        noise: Mapping[str, float] | None = None,
        quantisation: Mapping[str, float] | None = None,
        seed: int = NOISE_SEED,
    ) -> SystemSimulation:
        """Run it in C++ against the nonlinear equations.

        Args:
            start: states by name, with their trim; others start at it.
            parameters: true values by name; others are in the middle of their intervals.
            duration_s: six times 1 / decay rate by default.
            delay_s: until an input acts, at most one sample.
            rk4_steps: of the Runge-Kutta method per sample; 0 for IDA.
            noise: standard deviations of white noise on what is measured of states, by name.
            quantisation: steps to which what is measured of states is rounded, by name.
            seed: of the noise; equal seeds give equal runs.

        Raises:
            InputError: a name is unknown or a number out of range.
            PlantError: the equations could not be integrated.
        """
        experiment = SystemExperiment(
            start or {},
            parameters or {},
            duration_s,
            delay_s,
            rk4_steps,
            noise=noise or {},
            quantisation=quantisation or {},
            seed=seed,
        )
        return SystemSimulation(simulate(self.artifact, experiment, self.artifact.name))

    def write(self, folder: Path | str) -> Path:
        """Write both twins of the artifact into a folder; the path of the JSON one. Errors: InputError."""
        return write_system_artifact(folder, self.artifact)[0]

    def summary(self) -> dict[str, Any]:
        """What ``design inspect`` prints."""
        return system_summary(self.artifact)

    def __repr__(self) -> str:
        """In a few lines."""
        found = self.summary()
        reach = ", ".join(f"|{name}| < {value:.4g}" for name, value in found["region_reach"].items())
        sampling = "not proved" if isinstance(found["sampling"], str) else "proved"
        return (
            f"SystemController({found['name']}, {found['law']})\n"
            f"  region: {reach}\n"
            f"  decay rate {found['decay_rate_per_s']:.4g} 1/s,"
            f" sampling period {found['sample_period_s']:.4g} s {sampling}"
        )

    def _repr_html_(self) -> str:
        """A table, for notebooks."""
        found = self.summary()
        names = {
            "law": "law",
            "region_reach": "region",
            "decay_rate_per_s": "decay rate, 1/s",
            "sample_period_s": "sampling period, s",
            "inputs": "inputs",
        }
        return html_table(found["name"], {name: _shown(found[key]) for key, name in names.items()})


@checked
def stabilise(system: SystemLike, **options: Unpack[StabiliseOptions]) -> SystemController:
    """A feedback for a general system, with the region inside its domain that no solution leaves.

    >>> import quasilpv as ql
    >>> pendulum = ql.DescriptorSystem.from_equations(
    ...     ["x' = v", "v' = 9.81*sin(x) + u"], state="x v", inputs="u", domain={"x": (-1, 1), "v": (-3, 3)}
    ... )
    >>> found = ql.stabilise(pendulum, decay_rate=1.0, input_limits={"u": 30.0})
    >>> found.verify().verified
    True

    Args:
        system: a `DescriptorSystem`, a function of parameters that makes one, or a reference as on the command line.
        **options: ``objective`` (``largest-region``, ``fastest``, ``least-gain``, ``least-l2-gain``),
            ``decay_rate`` (1/s), ``input_limits`` by name, ``rate_hz``, ``speed`` (1/s), ``share``, ``disturbance`` and
            ``performance`` by name; ``premise_fault_s``; ``measured``, the names of the states that the law reads, and
            ``start_estimate`` by name of others; ``parameters`` of the function; ``allow_unproved_rate``.

    Raises:
        InputError: something does not exist or does not fit.
        InfeasibleError: no feedback was found.
        ClaimError: the sampling rate is not proved.
    """
    own = {name: value for name, value in options.items() if name not in ("parameters", "allow_unproved_rate")}
    unknown = set(options) - set(StabiliseOptions.__annotations__)
    if unknown:
        raise InputError(
            "stabilise", "option", ", ".join(sorted(unknown)), one_of(StabiliseOptions.__annotations__, "")
        )
    made = own_kind(system).system(**options.get("parameters", {}))
    request = RegionalRequest(made, **own)  # type: ignore[arg-type]
    return SystemController(release_system(request, allow_unproved_rate=options.get("allow_unproved_rate", False)))


@checked
def controller(path: Path | str) -> SystemController:
    """A controller from the file of its artifact, either twin.

    >>> import quasilpv as ql
    >>> pendulum = ql.DescriptorSystem.from_equations(
    ...     ["x' = v", "v' = 9.81*sin(x) + u"], state="x v", inputs="u", domain={"x": (-1, 1), "v": (-3, 3)}
    ... )
    >>> found = ql.stabilise(pendulum, decay_rate=1.0, input_limits={"u": 30.0})
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     ql.controller(found.write(folder)).verify().verified
    True

    Raises:
        InputError: it is none of a general system.
    """
    read = read_system_artifact(path)
    if read is None:
        raise InputError(str(path), "schema", "an artifact of a robot", "one of a general system")
    return SystemController(read)


def _shown(value: Any) -> str:
    if isinstance(value, Mapping):
        return "; ".join(f"{name}: {_shown(member)}" for name, member in value.items())
    return f"{value:.6g}" if isinstance(value, float) else str(value)
