"""The robust gate of the acceleration-level law: a theorem about every posture, payload and small delay, or a refusal.

In the coordinates that diagonalise ``M_t^-1 M_n`` (similar to a symmetric positive definite matrix, so its eigenvalues
mu are real and positive) the frozen sampled loop of n joints is n copies of one scalar loop. It is stable in every
posture of the operating domain, with every payload, every constant transport delay up to the specified one and every
lag of the drives in the interval of the artifact, if the *needed range* of ``M_t / M_n = 1 / mu`` lies in the *inertia
margin* of the scalar loop at all these delays and lags. All of it is proved in exact or ball arithmetic
(``docs/concepts/robust-gate.md`` says what is not).
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from flint import fmpq, fmpq_poly

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.claims import Evidence
from quasilpv.certificate.exact.matrices import rational
from quasilpv.certificate.exact.rationals import float_at_most, to_float
from quasilpv.certificate.gate.delay import DelayMargin, delay_margin
from quasilpv.certificate.gate.elastic_grid import ElasticGridGate
from quasilpv.certificate.gate.loop import (
    NO_LAG,
    AccelerationLoopData,
    CharacteristicPolynomial,
    Controller,
    Interval,
    LaggingPolynomial,
)
from quasilpv.certificate.gate.lyapunov import Bound, is_function_proved
from quasilpv.certificate.gate.margin import ZERO, InertiaMargin, inertia_margin
from quasilpv.certificate.gate.motion import MotionDocument, is_proved_in_motion
from quasilpv.certificate.gate.tree_motion import Limits, TreeMotion, tree_motion
from quasilpv.certificate.reading import Shipped, WitnessDocument
from quasilpv.certificate.robot.data import inertia_data
from quasilpv.certificate.robot.planar_chain import PlanarWitness, planar_range
from quasilpv.certificate.robot.range import InertiaPair, NeededRange, Place, needed_range
from quasilpv.certificate.robot.registry import is_in_space
from quasilpv.certificate.robot.tree import TreeData
from quasilpv.certificate.robot.tree_range import TreePair, TreeWitness, tree_range
from quasilpv.errors import InputError

ON_CONDITION = "the torque in every joint follows its command through the lag, whatever the link does"

GROWTH_RATIOS = 61
CURVE_POINTS = 41


@dataclass(frozen=True)
class WorstCase:
    """Numerical, not proved: the largest growth rate over the needed range, and a place where such a ratio occurs."""

    growth_rate_per_s: float
    delay_s: float
    place: Place
    lag_s: float = 0.0


@dataclass(frozen=True)
class RobustGate:
    """The verdict, and what it rests on.

    Attributes:
        loop: the law as shipped.
        specified_delay_samples: the transport delay the design has to tolerate.
        margin: inertia margin at that delay and the longest lag; None if the loop is not stable at ``M_t = M_n``.
        needed: which ratios occur; None if no bounds could be proved.
        delays: up to which delay the needed range is inside; None without a needed range.
        worst: numerical worst case over the needed range; None without one.
        motion: whether one Lyapunov function is proved common to all motions (`gate_motion`), and the one that is
            shipped is one (`gate_lyapunov`); None if the artifact does not claim it.
        sampled_range: smallest and largest ratio that were found: what no proof can beat. Nothing rests on it.
        seconds_to_find: how long the design took for the storages of the needed range; None if it has none.
        seconds_to_check: how long the proof of the needed range took.
        lag: shortest and longest time constant of the drives, common to all joints, in samples.
        condition: within which angles and speeds `motion` holds; None if it holds for all motions, or is not claimed.
        torque_controlled: the drives are stated to control the torque in their joints: all of it is about arms whose
            drives do, see `ON_CONDITION`.
        elastic: numerical: what became of a grid of elastic arms with such drives, whose gears give and whose lag is
            inside the torque loops; None without gears. An unstable loop there refutes what is proved on condition.
    """

    loop: AccelerationLoopData
    specified_delay_samples: fmpq
    margin: InertiaMargin | None
    needed: NeededRange | None
    delays: DelayMargin | None
    worst: WorstCase | None
    motion: bool | None = None
    sampled_range: tuple[float, float] | None = None
    seconds_to_find: float | None = None
    seconds_to_check: float | None = None
    lag: Interval = NO_LAG
    condition: TreeMotion | None = None
    torque_controlled: bool = False
    elastic: ElasticGridGate | None = None

    def __repr__(self) -> str:
        """The verdict in a line."""
        return f"RobustGate(passed={self.passed}, evidence={self.evidence}, delay_margin_s={self.delay_margin_s})"

    @property
    def passed(self) -> bool:
        """Whether the needed range is proved inside the margin for every lag and every delay up to the specified one.

        If the artifact claims more, one Lyapunov function for all motions, that must be proved as well.
        """
        if self.motion is False or (self.elastic is not None and not self.elastic.passed):
            return False
        if self.margin is None or self.needed is None or self.delays is None or self.delays.proved is None:
            return False
        inside = self.margin.contains(self.needed.lowest, self.needed.highest)
        return inside and self.delays.proved >= self.specified_delay_samples

    @property
    def delay_margin_s(self) -> float | None:
        """The largest proved delay; None if the needed range is not inside the margin even without delay."""
        if self.delays is None or self.delays.proved is None:
            return None
        return float_at_most(self.delays.proved * self.sample_period)

    @property
    def sample_period(self) -> fmpq:
        """T, exactly."""
        return fmpq(*self.loop.sample_period_s.as_integer_ratio())

    @property
    def lag_s(self) -> tuple[float, float]:
        """Shortest and longest time constant of the drives."""
        low, high = (to_float(end * self.sample_period) for end in self.lag)
        return low, high

    @property
    def evidence(self) -> Evidence:
        """Exact arithmetic on enclosures of cosines over the whole operating domain."""
        return Evidence.ENCLOSED

    def why_not_passed(self) -> str:
        """Half a line: what was wanted and what was found."""
        if self.motion is False:
            return "robust gate: one Lyapunov function for all motions is claimed, but not proved"
        if self.elastic is not None and not self.elastic.passed:
            return f"{self.elastic.why_not_passed()}, of elastic arms with such drives"
        if self.needed and self.margin:
            (a, b), (low, high) = self.needed.to_floats(), self.margin.to_floats()
            inside = f"inside the inertia margin [{low:.4g}, {'infinity' if high is None else f'{high:.4g}'}]"
            return f"robust gate: needed range [{a:.4g}, {b:.4g}] not proved {inside}"
        rate = "" if self.worst is None else f", worst growth rate {self.worst.growth_rate_per_s:.3g} 1/s"
        return f"robust gate: not passed{rate}"

    def to_document(self) -> dict[str, Any]:
        """JSON-able: what ``design robust --json`` prints, bounds rounded to the safe side.

        null stands for no bound (upper end of the margin) or no value. This gate passes only what it proves; `proved`
        tells it from a gate that samples.
        """
        worst = self.worst
        where = (
            None if worst is None else {**_place_document(worst.place), "delay_s": worst.delay_s, "lag_s": worst.lag_s}
        )
        return {
            "passed": self.passed,
            "proved": self.passed,
            "evidence": self.evidence.value,
            "inertia_margin": None if self.margin is None else list(self.margin.to_floats()),
            "delay_margin_s": self.delay_margin_s,
            "lag_s": list(self.lag_s),
            "proved_in_motion": self.motion,
            **self._condition_document(),
            **({"on_condition": ON_CONDITION} if self.torque_controlled else {}),
            **({} if self.elastic is None else {"elastic_grid": self.elastic.to_document()}),
            "needed_range": None if self.needed is None else list(self.needed.to_floats()),
            "sampled_range": None if self.sampled_range is None else list(self.sampled_range),
            "worst_growth_rate_per_s": None if worst is None else worst.growth_rate_per_s,
            "where": where,
        }

    def _condition_document(self) -> dict[str, Any]:
        found = self.condition
        return {
            "motion_box_rad": None if found is None else [list(interval) for interval in found.limits.angle_rad],
            "motion_speed_limit_rad_s": None if found is None else list(found.limits.speed_rad_s),
            "beta_per_s": None if found is None else found.rate_per_s,
        }

    def timed_document(self) -> dict[str, Any]:
        """The same with how long it took, which no artifact holds."""
        return {
            **self.to_document(),
            "seconds_to_find": self.seconds_to_find,
            "seconds_to_check": self.seconds_to_check,
        }


class MotionWitness(WitnessDocument):
    """The part of a witness that the gate reads."""

    motion: MotionDocument | None = None


def robust_gate(
    shipped: Shipped[Any],
    loop: AccelerationLoopData,
    delay_samples: fmpq,
    bound: Bound | None = None,
    limits: Limits | None = None,
) -> RobustGate:
    """Put an artifact to the gate.

    Args:
        shipped: the artifact.
        loop: its law.
        delay_samples: the transport delay it has to tolerate, in samples.
        bound: the bound of a Lyapunov function, if the law ships one.
        limits: of the motions it was designed for, if it ships some.

    Raises:
        InputError: a robot the gate does not know, or data that contradict each other.
    """
    lag = _lag(shipped, loop)
    margin = inertia_margin(loop, delay_samples, lag[1])
    if is_in_space(shipped.mechanism, shipped.source):
        return _tree_gate(shipped, RobustGate(loop, delay_samples, margin, None, None, None, lag=lag), limits)
    if limits is not None:
        expected = "no member of this name: for a planar robot the proof holds for all motions"
        raise InputError(shipped.source, "law.motion_limits", "limits", expected)
    began = time.perf_counter()
    inertia = InertiaPair(inertia_data(shipped))
    needed = _planar_range(shipped, inertia)
    seconds = time.perf_counter() - began
    if needed is None:
        return RobustGate(loop, delay_samples, margin, None, None, None, seconds_to_check=seconds, lag=lag)
    delays = delay_margin(loop, needed.lowest, needed.highest, lag)
    worst = worst_case(loop, inertia, needed, (fmpq(0), delay_samples), lag)
    motion = _proved_in_motion(shipped, loop, inertia, bound)
    if motion and lag[1] > 0:
        motion = False  # the circle criterion knows no lag
    sampled = needed.where_lowest.inertia_ratio, needed.where_highest.inertia_ratio
    return RobustGate(
        loop,
        delay_samples,
        margin,
        needed,
        delays,
        worst,
        motion,
        sampled_range=sampled,
        seconds_to_check=seconds,
        lag=lag,
    )


def _planar_range(shipped: Shipped[Any], inertia: InertiaPair) -> NeededRange | None:
    """By the chain of the witness, if it has one; else by branch and bound over postures."""
    witness = shipped.witness(PlanarWitness).chain if shipped.artifact.witness is not None else None
    if witness is None:
        return needed_range(inertia)
    try:
        return planar_range(inertia, witness)
    except ValueError as error:
        raise InputError(shipped.source, "witness.chain", error, "a storage for every joint but the last") from error


def _lag(shipped: Shipped[Any], loop: AccelerationLoopData) -> Interval:
    """Shortest and longest lag of the drives, in samples."""
    period = rational(loop.sample_period_s)
    low, high = (rational(end) / period for end in shipped.payloads.drive_lag_s)
    return low, high


def _tree_gate(shipped: Shipped[Any], opened: RobustGate, limits: Limits | None) -> RobustGate:
    """The gate of a robot in space, whose needed range is proved with the storages of its witness.

    Args:
        shipped: the artifact.
        opened: the gate with margin and lag.
        limits: of the motions the law was designed for.
    """
    witness = shipped.witness(TreeWitness).chain
    pair = TreePair(TreeData.of(shipped))
    try:
        found = tree_range(pair, witness)
    except ValueError as error:
        raise InputError(shipped.source, "witness.chain", error, "a storage for every joint but the last") from error
    gate = replace(
        opened,
        sampled_range=found.sampled,
        seconds_to_find=witness.seconds_to_find,
        seconds_to_check=found.seconds_to_check,
        torque_controlled=getattr(shipped.payloads, "torque_gain", None) is not None,
    )
    if found.needed is None:
        return gate
    delays = delay_margin(gate.loop, found.needed.lowest, found.needed.highest, gate.lag)
    worst = worst_case(gate.loop, pair, found.needed, (fmpq(0), gate.specified_delay_samples), gate.lag)
    condition = tree_motion(shipped, pair.data, found.needed, gate.loop, limits)
    motion = None if condition is None else condition.proved and gate.lag[1] == 0
    return replace(gate, needed=found.needed, delays=delays, worst=worst, motion=motion, condition=condition)


def _proved_in_motion(
    shipped: Shipped[Any], loop: AccelerationLoopData, inertia: InertiaPair, bound: Bound | None
) -> bool | None:
    """Whether all that an artifact claims of motions is proved; None if it claims nothing."""
    claimed, source = shipped.witness(MotionWitness).motion, shipped.source
    if claimed is None:
        return None if bound is None else False
    return is_proved_in_motion(claimed, loop, inertia, source) and is_function_proved(
        claimed, bound, loop, inertia.data.joints, source
    )


@dataclass(frozen=True, eq=False)
class MarginCurve:
    """The proved inertia margin at a series of delays.

    Attributes:
        delay_s: (N,).
        lowest: (N,) lower limits of ``M_t / M_n``, NaN where the loop is not stable at ``M_t = M_n``.
        highest: (N,) upper limits, infinite where there is none, NaN as above.
    """

    delay_s: FloatArray
    lowest: FloatArray
    highest: FloatArray


def margin_curve(
    loop: AccelerationLoopData, longest_samples: fmpq, points: int = CURVE_POINTS, lag_samples: fmpq = ZERO
) -> MarginCurve:
    """The inertia margin at equally spaced delays from 0 to the longest.

    Args:
        loop: the law as shipped.
        longest_samples: > 0, in samples.
        points: how many, at least 2.
        lag_samples: time constant of the drives.
    """
    delays = [longest_samples * k / (points - 1) for k in range(points)]
    limits = np.full((points, 2), np.nan)
    for row, delay in enumerate(delays):
        margin = inertia_margin(loop, delay, lag_samples)
        if margin is not None:
            low, high = margin.to_floats()
            limits[row] = low, np.inf if high is None else high
    delay_s = np.array([to_float(delay) for delay in delays]) * loop.sample_period_s
    return MarginCurve(delay_s, limits[:, 0], limits[:, 1])


class Places(Protocol):
    """Where inertia ratios occur."""

    def nearest_place(self, ratio: float) -> Place:
        """A place one of whose ratios is near a given one."""


def worst_case(
    loop: AccelerationLoopData, inertia: Places, needed: NeededRange, delays: Sequence[fmpq], lags: Sequence[fmpq]
) -> WorstCase:
    """Largest ``log(spectral radius) / T`` over a grid of the needed range, delays and lags, in double arithmetic.

    Args:
        loop: the law as shipped.
        inertia: where ratios occur.
        needed: the range.
        delays: transport delays in samples.
        lags: of the drives, in samples.
    """
    ratios = np.geomspace(*needed.to_floats(), GROWTH_RATIOS)
    rates = {(delay, lag): growth_rates(loop, delay, ratios, lag) for delay in delays for lag in dict.fromkeys(lags)}
    delay, lag = max(rates, key=lambda key: float(rates[key].max()))
    row = int(rates[delay, lag].argmax())
    place = min(
        (needed.where_lowest, needed.where_highest, inertia.nearest_place(float(ratios[row]))),
        key=lambda candidate: abs(candidate.inertia_ratio - ratios[row]),
    )
    period = loop.sample_period_s
    return WorstCase(float(rates[delay, lag][row]), to_float(delay) * period, place, to_float(lag) * period)


def growth_rates(
    loop: AccelerationLoopData, delay_samples: fmpq, ratios: FloatArray, lag_samples: fmpq = ZERO
) -> FloatArray:
    """``log(largest root) / T`` at each ratio ``M_t / M_n``, 1/s, numerical.

    The slow roots are clustered near z = 1: computed as roots in ``zeta = z - 1``, around 0, they keep their digits.
    """
    controller = Controller.of(loop, loop.filter_poles()[0])
    if lag_samples > 0:
        lagging = LaggingPolynomial.of(controller, delay_samples, lag_samples)
        F, G = (np.array([float(x.mid()) for x in part.coeffs()[::-1]]) for part in (lagging.F, lagging.G))
    else:
        polynomial, shift = CharacteristicPolynomial.of(controller, delay_samples), fmpq_poly([1, 1])
        F, G = (np.array([to_float(x) for x in part(shift).coeffs()[::-1]]) for part in (polynomial.F, polynomial.G))
    G = np.concatenate([np.zeros(F.size - G.size), G])
    radius = [np.abs(1.0 + np.roots(F + G / ratio)).max() for ratio in ratios]
    return np.asarray(np.log(radius) / loop.sample_period_s)


def _place_document(place: Place) -> dict[str, Any]:
    return {
        "angle_rad": list(place.angle_rad),
        "payload_fraction": place.payload_fraction,
        "inertia_ratio": place.inertia_ratio,
    }
