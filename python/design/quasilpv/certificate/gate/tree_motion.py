"""The loop of the acceleration-level law on a robot in space that moves, within stated angles and speeds.

With the design inertia itself as shape, ``Y^-1 = M_n(q)``, the matrix ``M_n^1/2 X M_n^-1/2 = M_n^1/2 M_t^-1 M_n^1/2``
is symmetric, and ``c1 M_n < M_t < c2 M_n`` says that its spectrum lies in [1/c2, 1/c1]: it is within r of c I, with
``c, r = (1/c1 +- 1/c2) / 2``, and (disc) of `quasilpv.certificate.gate.motion` needs no proof of its own. The price is
that ``V(s, q) = s' (P x M_n(q)) s`` changes with the posture. If ``dM_n/dt < beta M_n`` for all motions within the
angles and speeds (`quasilpv.certificate.exact.rate_chain`), then ``M_n(q+) <= exp(beta T) M_n(q)`` from sample to
sample, and with (circle) on the circle of radius ``exp(-beta T / 2)`` V falls at every sample.

So it is conditional: the law ships the angles and speeds as ``motion_limits``, and the run time stops a robot that
leaves them. As in `quasilpv.certificate.gate.motion` the inertia is constant over a sample, and delays are constant.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

from flint import arb, ctx, fmpq

from quasilpv.certificate.exact.chain import ChainProof
from quasilpv.certificate.exact.matrices import matrix, rational
from quasilpv.certificate.exact.rate_chain import RateForm, prove_rate
from quasilpv.certificate.gate.loop import AccelerationLoopData
from quasilpv.certificate.gate.motion import satisfies_circle_criterion
from quasilpv.certificate.reading import Rows, Shipped, WitnessDocument
from quasilpv.certificate.robot.range import NeededRange
from quasilpv.certificate.robot.tree import TreeData, chain_of
from quasilpv.documents.mechanism import Tree
from quasilpv.errors import InputError

CONTRACTION_BITS = 40


class RateDocument(WitnessDocument):
    """The member ``motion`` of a witness: beta, its storages, the delays, and how long the design took for beta."""

    rate_per_s: float
    storages: tuple[Rows, ...]
    longest_delay_samples: float
    seconds_to_find: float | None = None


class TreeMotionWitness(WitnessDocument):
    """The part of a witness that is about motions of a robot in space."""

    motion: RateDocument | None = None


class Limits(Protocol):
    """What a law ships of the motions it was designed for."""

    @property
    def angle_rad(self) -> tuple[tuple[float, float], ...]:
        """Intervals of the joints."""

    @property
    def speed_rad_s(self) -> tuple[float, ...]:
        """Their largest speeds."""


@dataclass(frozen=True)
class TreeMotion:
    """What an artifact claims of motions, and what became of it.

    Attributes:
        limits: the condition.
        rate_per_s: beta.
        rate: the proof of beta.
        circle: whether (circle) is proved on the contracted circle.
    """

    limits: Limits
    rate_per_s: float
    rate: ChainProof
    circle: bool

    @property
    def proved(self) -> bool:
        """Whether V falls at every sample while the robot keeps to the limits."""
        return self.rate.holds and self.circle


def tree_motion(
    shipped: Shipped[Any], data: TreeData, needed: NeededRange, loop: AccelerationLoopData, limits: Limits | None
) -> TreeMotion | None:
    """What an artifact of a robot in space claims of its motions; None if nothing.

    Args:
        shipped: the artifact.
        data: its robot.
        needed: c1 and c2, proved over the domain.
        loop: its law.
        limits: those of the law.

    Raises:
        InputError: limits without a witness or the other way round, limits outside the domain, or a witness that is not
            of the documented form.
    """
    claimed, source = shipped.witness(TreeMotionWitness).motion, shipped.source
    if claimed is None or limits is None:
        if (claimed is None) != (limits is None):
            part = "law.motion_limits" if limits is None else "witness.motion"
            raise InputError(source, part, "nothing", "motion_limits in the law and motion in the witness, or neither")
        return None
    for name in ("angle_rad", "speed_rad_s"):
        if len(getattr(limits, name)) != len(data.joints):
            got, expected = f"{len(getattr(limits, name))} entries", f"{len(data.joints)}, one per joint"
            raise InputError(source, f"law.motion_limits.{name}", got, expected)
    robot = shipped.mechanism
    assert isinstance(robot, Tree)  # as `TreeData.of` found
    for k, ((low, high), box) in enumerate(zip(limits.angle_rad, shipped.artifact.domain.angle_rad, strict=True)):
        if not box[0] <= low < high <= box[1]:
            field = f"law.motion_limits.angle_rad[{k}]"
            raise InputError(source, field, [low, high], f"an interval inside the domain's {list(box)}")
    form = RateForm(
        bodies=data.design.bodies,
        rotors=data.design.rotors,
        rate=rational(claimed.rate_per_s),
        speeds=[rational(speed) for speed in limits.speed_rad_s],
    )
    storages = [matrix(storage) for storage in claimed.storages]
    try:
        proof = prove_rate(chain_of(robot, limits.angle_rad), form, storages)
    except ValueError as error:
        raise InputError(source, "witness.motion.storages", error, "one for every joint but the last") from error
    slow, fast = 1 / needed.highest, 1 / needed.lowest
    contraction = contraction_of(form.rate * rational(loop.sample_period_s))
    circle = loop.disturbance_compensation and satisfies_circle_criterion(
        loop, (fast + slow) / 2, (fast - slow) / 2, rational(claimed.longest_delay_samples), contraction
    )
    return TreeMotion(limits, claimed.rate_per_s, proof, circle)


def contraction_of(rate_samples: fmpq) -> fmpq:
    """A short rational number that is at most ``exp(-beta T / 2)``, for beta T."""
    with ctx.workprec(2 * CONTRACTION_BITS):
        scaled = (arb(-rate_samples / 2)).exp() * (1 << CONTRACTION_BITS)
        return fmpq(int(float(scaled.floor())) - 1, 1 << CONTRACTION_BITS)
