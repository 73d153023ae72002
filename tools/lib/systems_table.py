"""Print what is proved of a feedback for nonlinear systems of the literature: tools/systems-table [--system NAME]...

Each with a decay rate and a limit of its input: the largest region inside its domain, as the share of the box of its
bounded states that the region (its projection on them) fills, and the longest sampling periods that are proved, by
Euler's bound and by the sharper one. Everything is checked in exact and in ball arithmetic; seconds are those of the
processor, of the design and its release. A ball fills 79 % of its square and 31 % of its cube of dimension four.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import quasilpv as ql
from quasilpv.certificate.systems import verify_system
from quasilpv.certificate.systems.linearised import LinearisedLoop
from quasilpv.certificate.systems.sampled import SampledLoop
from quasilpv.documents.system_artifact import SystemArtifactDocument
from quasilpv.synthesis.regional.request import RegionalRequest
from quasilpv.system_release import release_system
from quasilpv.systems.catalogue import system_kind

EXAMPLES = Path(__file__).parents[2] / "examples" / "systems"

RATE_HZ = 1e5
"""At which the designs are released, proved or not: what is proved is looked for afterwards."""

CELLS = 3000
"""Of the sharper bound; more take longer than the periods gain."""

FACTORS = (16.0, 8.0, 4.0, 2.0, 1.5)
"""Of Euler's period, tried with the sharper bound."""


@dataclass(frozen=True)
class Entry:
    """A system, what is asked of it, and the share and the period by Euler's bound that a prototype of this method had.

    The prototype's parameters are not known, those here are of the sources that the systems name; its periods used
    constants that were sampled, not enclosed. `speed` bounds the closed loop, 1/s: a longer period for a little region.
    """

    system: Callable[[], ql.DescriptorSystem]
    decay_rate: float
    limits: dict[str, float]
    share: float
    period_s: float | None = None
    speed: float | None = None


def boost_with_constant_power() -> ql.DescriptorSystem:
    """The boost converter of the examples with a load that draws 28.8 W at any voltage.

    Source: Emadi, Khaligh, Rivetta and Williamson 2006, Constant power loads and negative impedance instability.
    """
    return ql.DescriptorSystem.from_equations(
        ["0.0005*i' = 12 - (1 - d)*v", "0.0005*v' = (1 - d)*i - 28.8/v"],
        name="boost-constant-power",
        state="i v",
        inputs="d",
        domain={"i": (0.4, 4.4), "v": (18, 30)},
        equilibrium=((2.4, 24), (0.5,)),
    )


def pendulum_on_cart() -> ql.DescriptorSystem:
    """The pendulum on a cart without the cart's states, within 60 degrees: m = 2 kg, M = 8 kg, l = 0.5 m.

    Source: Wang, Tanaka and Griffin 1996, An approach to fuzzy control of nonlinear systems, section V.
    """
    return ql.DescriptorSystem.from_equations(
        ["th' = w", "(2/3 - 0.1*cos(th)^2)*w' = 9.81*sin(th) - 0.1*w^2*sin(th)*cos(th) - 0.1*cos(th)*u"],
        name="pendulum-on-cart",
        state="th w",
        inputs="u",
        domain={"th": (-math.pi / 3, math.pi / 3), "w": (-4, 4)},
    )


def _example(reference: str) -> Callable[[], ql.DescriptorSystem]:
    return lambda: system_kind(str(EXAMPLES / reference)).system()


SYSTEMS = {
    "two-tanks": Entry(_example("two_tanks.py:two_tanks"), 0.05, {"u": 0.006}, 0.785),
    "boost": Entry(_example("boost.py:boost"), 50.0, {"d": 0.4}, 0.753, 8e-6, 1000.0),
    "boost-constant-power": Entry(boost_with_constant_power, 50.0, {"d": 0.4}, 0.753, 8e-6, 2500.0),
    "pendulum-on-cart": Entry(pendulum_on_cart, 1.0, {"u": 300.0}, 0.658, 12.8e-3),
    "furuta": Entry(_example("furuta.py:furuta"), 1.0, {"u": 0.15}, 0.0275, 2.1e-3, 15.0),
    "tora": Entry(_example("tora.py:tora"), 0.01, {"u": 1.0}, 0.154, 6e-3),
}


@dataclass(frozen=True)
class Row:
    """What was found."""

    artifact: SystemArtifactDocument
    seconds: float
    share: float
    largest_gain: float
    verified: bool


def measured(entry: Entry) -> Row:
    """Design and check one."""
    asked = {"decay_rate": entry.decay_rate, "input_limits": entry.limits, "speed": entry.speed}
    request = RegionalRequest(entry.system(), rate_hz=RATE_HZ, **asked)  # type: ignore[arg-type]
    start = time.process_time()
    artifact = release_system(request, allow_unproved_rate=True)
    seconds = time.process_time() - start
    vertices = [vertex for block in artifact.law.gain.blocks for vertex in block.vertices]
    largest = float(np.abs(vertices).max())
    return Row(artifact, seconds, share_of(artifact), largest, verify_system(artifact).verified)


def share_of(artifact: SystemArtifactDocument) -> float:
    """Volume of the region's projection on the bounded states over that of their box, ``|x_k| <= b_k``."""
    states = artifact.states[: artifact.model.differential]
    bounds = {k: min(-s.low, s.high) for k, s in enumerate(states) if s.low is not None and s.high is not None}
    P, n = np.array(artifact.region.lyapunov)[np.ix_(list(bounds), list(bounds))], len(bounds)
    ball = math.pi ** (n / 2) / math.gamma(n / 2 + 1)
    return float(ball * math.sqrt(np.linalg.det(P)) / math.prod(2.0 * bound for bound in bounds.values()))


def periods(artifact: SystemArtifactDocument) -> tuple[float, float]:
    """The longest periods that are proved, by Euler's bound and by the sharper one, s."""
    euler = SampledLoop(artifact).bound.longest_period_s
    sharper = LinearisedLoop(artifact, CELLS)
    for factor in FACTORS:
        if not sharper.is_hopeless(factor * euler) and sharper.cells_of_proof(factor * euler) is not None:
            return euler, factor * euler
    return euler, euler


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; exit code 1 if something is not verified."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--system", action="append", choices=list(SYSTEMS), metavar="NAME", help=", ".join(SYSTEMS))
    chosen = parser.parse_args(arguments).system or list(SYSTEMS)
    print(
        "| system | decay, 1/s | share | prototype | largest gain | seconds | speed, 1/s | Euler | sharper | verified |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    good = True
    for name in chosen:
        entry = SYSTEMS[name]
        row = measured(entry)
        good = good and row.verified
        euler, sharper = periods(row.artifact)
        print(
            f"| {name} | {entry.decay_rate:g} | {100 * row.share:.2f} % | {100 * entry.share:.2f} % |"
            f" {row.largest_gain:.3g} | {row.seconds:.1f} | {entry.speed or 'any'} | {euler:.3g} s | {sharper:.3g} s |"
            f" {'yes' if row.verified else 'no'} |",
            flush=True,
        )
    return 0 if good else 1


if __name__ == "__main__":
    raise SystemExit(main())
