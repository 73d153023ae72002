"""The gate of `motor-pid`: every elastic arm an artifact states, every delay up to the specified one, by exclusion.

The links are put between two multiples of the rotors by the chain certificate, exactly; with them, the gears, lags and
tolerances of the artifact `quasilpv.certificate.gate.two_mass` excludes roots on the unit circle. What is proved is the
linear loop at rest in a posture, without gravity's gradient and friction, while no limit and no dead zone acts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from flint import fmpq

from quasilpv.certificate.exact.claims import Evidence
from quasilpv.certificate.exact.matrices import rational, zero
from quasilpv.certificate.exact.rationals import to_float
from quasilpv.certificate.gate.loop import Interval
from quasilpv.certificate.gate.motor_loop import MotorLoopData
from quasilpv.certificate.gate.two_mass import ElasticSet, Exclusion, TwoMassExclusion
from quasilpv.certificate.reading import Shipped
from quasilpv.certificate.robot.tree import TreeData
from quasilpv.certificate.robot.tree_range import TreePair, TreeRange, TreeWitness, tree_range
from quasilpv.documents.payloads import TreePayloads
from quasilpv.errors import InputError

WHAT = "stability by exclusion, frozen"


@dataclass(frozen=True)
class ElasticGate:
    """The verdict, and what it rests on.

    Attributes:
        loop: the law as shipped.
        specified_delay_samples: the transport delay the design has to tolerate.
        links: what became of ``m1 B < M(q) < m2 B``, B the rotors, M the links with every load.
        plants: the set that was put to the exclusion; None if no such numbers were proved.
        exclusion: what became of it; None likewise.
    """

    loop: MotorLoopData
    specified_delay_samples: fmpq
    links: TreeRange
    plants: ElasticSet | None
    exclusion: Exclusion | None

    def __repr__(self) -> str:
        """The verdict in a line."""
        return f"ElasticGate(passed={self.passed}, evidence={self.evidence}, {WHAT})"

    @property
    def passed(self) -> bool:
        """Whether all of it is proved."""
        return self.exclusion is not None and self.exclusion.proved

    @property
    def evidence(self) -> Evidence:
        """Rational arithmetic for the links, balls for the loop."""
        return Evidence.ENCLOSED

    @property
    def delay_margin_s(self) -> float | None:
        """The specified delay if it is proved, for longer ones were not tried; None if it is not."""
        return to_float(self.specified_delay_samples * self.loop.period) if self.passed else None

    def why_not_passed(self) -> str:
        """Half a line: what was found."""
        if self.exclusion is None:
            return "robust gate: the links were not put between two multiples of the rotors"
        if not self.exclusion.anchored:
            return "robust gate: the loop of one arm of the set is not stable"
        at = self.exclusion.given_up_rad_s
        return f"robust gate: a root on the unit circle was not excluded, at {at:.4g} rad/s"

    def to_document(self) -> dict[str, Any]:
        """JSON-able: what ``design robust --json`` prints. null stands for no value."""
        links, found = self.links.needed, self.exclusion
        return {
            "passed": self.passed,
            "proved": self.passed,
            "evidence": self.evidence.value,
            "what": WHAT,
            "links_over_rotors": None if links is None else list(links.to_floats()),
            "sampled_range": list(self.links.sampled),
            "delay_margin_s": self.delay_margin_s,
            "given_up_rad_s": None if found is None else found.given_up_rad_s,
            "stable_member": None if found is None else found.anchored,
            "cells": None if found is None else found.cells,
        }


def elastic_gate(shipped: Shipped[Any], loop: MotorLoopData, delay_samples: fmpq) -> ElasticGate:
    """Put an artifact to the gate.

    Args:
        shipped: the artifact.
        loop: its law.
        delay_samples: the transport delay it has to tolerate, in samples.

    Raises:
        InputError: the artifact states no gears, or its law has other rotors than its robot.
    """
    payloads, source = shipped.payloads, shipped.source
    if not isinstance(payloads, TreePayloads) or payloads.gears is None:
        raise InputError(source, "payloads.gears", "none", "the gears of the joints, for a law of elastic joints")
    data = TreeData.of(shipped)
    rotors = tuple(rational(rotor) for rotor in loop.rotors)
    if rotors != data.nominal.rotors:
        got, expected = list(loop.rotors), "the rotors of the robot, which tolerances are stated of"
        raise InputError(source, "law.rotor_inertia_kg_m2", got, expected)
    try:
        links = tree_range(TreePair(links_over_rotors(data)), shipped.witness(TreeWitness).chain)
    except ValueError as error:
        raise InputError(source, "witness.chain", error, "a storage for every joint but the last") from error
    if links.needed is None or links.needed.lowest <= 0:
        return ElasticGate(loop, delay_samples, links, None, None)
    low, high = (rational(end) / loop.period for end in payloads.drive_lag_s)
    bounds = (links.needed.lowest, links.needed.highest)
    plants = elastic_set(loop, bounds, payloads, delay_samples, (low, high))
    return ElasticGate(loop, delay_samples, links, plants, TwoMassExclusion(loop, plants).decide())


def links_over_rotors(data: TreeData) -> TreeData:
    """The links without rotors as the robot, and the rotors alone as its design inertia."""
    none = tuple(fmpq(0) for _ in data.joints)
    empty = tuple(zero(6, 6) for _ in data.joints)
    return replace(
        data,
        nominal=replace(data.nominal, rotors=none),
        design=replace(data.design, bodies=empty, rotors=data.nominal.rotors),
    )


def elastic_set(
    loop: MotorLoopData,
    links: Interval,
    payloads: TreePayloads,
    delay_samples: fmpq,
    lag_samples: Interval,
) -> ElasticSet:
    """All arms with these gears as one set.

    Args:
        loop: the law, whose rotors are the nominal ones.
        links: m1 and m2.
        payloads: with gears.
        delay_samples: longest delay.
        lag_samples: shortest and longest lag of the drives.
    """
    T, gears = loop.period, payloads.gears or ()
    pairs = list(zip(loop.rotors, gears, strict=True))
    softest = max(rational(B) / rational(gear.stiffness_nm_rad[0]) for B, gear in pairs)
    stiffest = min(rational(B) / rational(gear.stiffness_nm_rad[1]) for B, gear in pairs)
    return ElasticSet(
        links=links,
        windings=(stiffest / T**2, softest / T**2),
        dampings=(
            min(rational(gear.damping_s[0]) for gear in gears) / T,
            max(rational(gear.damping_s[1]) for gear in gears) / T,
        ),
        rotor_tolerance=max(rational(share) for share in payloads.rotor_tolerance),
        delay=(fmpq(0), delay_samples),
        lag=lag_samples,
    )
