"""Options that mean the same in several verbs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias, cast

import typer

from quasilpv.defaults import DEFAULT_FORMATS, ENCODER_BITS
from quasilpv.errors import InputError, one_of
from quasilpv.progress import Progress
from quasilpv.synthesis import CONTROLLERS, ControllerKind, DesignRequest, Specification, specification_for

if TYPE_CHECKING:
    from quasilpv.artifact import Artifact
    from quasilpv.experiments.result import Variant
    from quasilpv.experiments.setup import PlantKind
    from quasilpv.scenarios import Sensors, TrackingExperiment
    from quasilpv.systems.robots.registry import AnyRobot

SHORT_NAMES = {"acceleration": "dob-acceleration", "moving": "dob-moving", "torque": "dob-torque"}


PLANTS = ("nominal", "perturbed", "mujoco")


def _default_rates() -> str:
    """``1000; 4000 for ...``: the rates of `CONTROLLERS`, the most common first."""
    usual = ControllerKind.rate_hz
    others: dict[float, list[str]] = {}
    for name, kind in CONTROLLERS.items():
        if kind.rate_hz != usual:
            others.setdefault(kind.rate_hz, []).append(name)
    return "; ".join([f"{usual:g}", *(f"{rate:g} for {', '.join(names)}" for rate, names in others.items())])


RateOption: TypeAlias = Annotated[
    float | None,
    typer.Option(
        "--rate-hz",
        help=f"Sample rate; the controller is designed for it.  [default: {_default_rates()}]",
    ),
]
EncoderOption: TypeAlias = Annotated[
    int | None,
    typer.Option("--encoder-bits", help=f"Encoder resolution, 0 for exact angles.  [default: {ENCODER_BITS}]"),
]
SpareOption: TypeAlias = Annotated[
    float | None,
    typer.Option(
        "--margin-spare",
        help="Factor by which the inertia margin exceeds the needed range on both sides."
        f"  [default: {Specification.margin_spare}]",
    ),
]
ActivityOption: TypeAlias = Annotated[
    float | None,
    typer.Option(
        "--torque-activity",
        help="Bound on the rms torque increment per sample caused by encoder quantisation, as a fraction of the torque"
        f" limits.  [default: {Specification.torque_activity}]",
    ),
]
PlantOption: TypeAlias = Annotated[
    str, typer.Option("--plant", help="nominal, perturbed: the full payload, or mujoco: the latter, moved by MuJoCo.")
]
LogOption: TypeAlias = Annotated[bool, typer.Option("--log/--no-log", help="Write the log of every run.")]
FormatOption: TypeAlias = Annotated[
    list[str] | None,
    typer.Option("--figure-format", metavar="FORMAT", help="png, svg or pdf; may be repeated.  [default: png]"),
]
ArtifactOption: TypeAlias = Annotated[
    Path | None, typer.Option("--artifact", metavar="FILE", help="Use this controller instead of designing one.")
]


def plant_kind(text: str, experiments: Sequence[TrackingExperiment]) -> PlantKind:
    """``nominal``, ``perturbed`` or ``mujoco``.

    Raises:
        InputError: none of them; MuJoCo is not installed, or an experiment is that of a robot in a plane.
    """
    if text not in PLANTS:
        raise InputError("command line", "--plant", text, one_of(PLANTS, text))
    if text == "mujoco":
        from quasilpv.experiments.mujoco_plant import require_mujoco

        require_mujoco("--plant mujoco")
        for experiment in experiments:
            if not experiment.robot.in_space:
                expected = f"nominal or perturbed: {experiment.robot.id} moves in a plane"
                raise InputError("command line", "--plant", text, expected)
    return cast("PlantKind", text)


def formats_of(names: Sequence[str] | None) -> tuple[str, ...]:
    """The formats figures are drawn in.

    Raises:
        InputError: one is none of `quasilpv.figures.style.FORMATS`.
    """
    from quasilpv.figures.style import require_formats

    return require_formats(names or DEFAULT_FORMATS)


def sensors_of(encoder_bits: int) -> Sensors:
    """Sensors with encoders of this resolution and the registry's speed noise.

    Raises:
        InputError: not 0 to 32 bits.
    """
    from quasilpv.scenarios import Sensors

    if not 0 <= encoder_bits <= 32:
        raise InputError("command line", "--encoder-bits", encoder_bits, "0 (exact angles) to 32")
    return Sensors(encoder_bits=encoder_bits)


def require_controller(controller: str) -> str:
    """The id of a controller, given by its id or its short name.

    Raises:
        InputError: unknown.
    """
    full = SHORT_NAMES.get(controller, controller)
    if full not in CONTROLLERS:
        raise InputError("command line", "controller", controller, one_of([*CONTROLLERS, *SHORT_NAMES], controller))
    return full


def robot_named(text: str) -> AnyRobot:
    """The robot that a person names: an id of the registry, or a ``robot.toml``.

    Raises:
        InputError: there is none of this name, or the file is none.
    """
    if text.endswith(".toml"):
        from quasilpv.descriptions.plausibility import require_bodies
        from quasilpv.descriptions.robot_file import read_robot_file

        read = read_robot_file(Path(text)).robot()
        require_bodies(read.tree, text)
        return read
    from quasilpv.systems.robots.registry import any_robot

    return any_robot(text)


def requested(
    robot: AnyRobot,
    controller: str,
    rate_hz: float | None,
    encoder_bits: int | None,
    *,
    margin_spare: float | None = None,
    torque_activity: float | None = None,
) -> DesignRequest:
    """The design that options ask for, with the specification of `specification_for`.

    Raises:
        InputError: a number out of range.
    """
    wanted = specification_for(
        robot,
        controller,
        rate_hz=rate_hz,
        encoder_bits=encoder_bits,
        margin_spare=margin_spare,
        torque_activity=torque_activity,
    )
    return DesignRequest(robot, controller, wanted)


def designed(robot: AnyRobot, variant: Variant, rate_hz: float | None, progress: Progress) -> Artifact:
    """The controller of a variant, designed for its encoders; from the cache if it was designed before."""
    from quasilpv.experiments.designs import kept_design

    asked = requested(robot, variant.controller, rate_hz, variant.encoder_bits)
    return kept_design(replace(asked, compensated=variant.compensated), progress=progress)
