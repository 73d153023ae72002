"""The optimisation problem behind the gains of a law, rebuilt from what its artifact says of itself.

For people who want another solver's opinion. The search around the problems (bandwidths, filter, design inertia) is
over by then: what remains are the two semidefinite programs, feedback and observer, in units in which their unknowns
are of order one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from quasilpv.certificate.laws.dob_acceleration import DobAccelerationLaw
from quasilpv.certificate.laws.dob_torque import DobTorqueLaw
from quasilpv.conditions.tracking.iv11_reduced import feedback_condition, observer_condition
from quasilpv.conditions.tracking.sampled_chains import feedback_problem, observer_problem
from quasilpv.errors import InputError
from quasilpv.lmi import Problem


def shipped_problem(document: Mapping[str, Any], source: str = "artifact") -> Problem:
    """The feedback and the observer problem of a law side by side: all inequalities, sum of the objectives.

    Args:
        document: the artifact as a JSON tree.
        source: what to call it in errors.

    Raises:
        InputError: the law kind rests on no problem, or the witness does not say which.
    """
    kind = document["law"]["kind"]
    if kind not in _HALVES:
        raise InputError(source, "law.kind", kind, f"one designed by inequalities: {', '.join(_HALVES)}")
    try:
        halves = _HALVES[kind](document)
    except (LookupError, TypeError, ValueError, ArithmeticError) as error:
        raise InputError(source, "witness", f"{type(error).__name__}: {error}", f"what {kind} needs") from error
    joint = Problem()
    objective = None
    for name, half in halves.items():
        for constraint in half.constraints:
            joint.positive(f"{name}: {constraint.name}", constraint.expression)
        if half.objective is not None:
            objective = half.objective if objective is None else objective + half.objective
    if objective is not None:
        joint.minimise(objective)
    return joint


def _sampled_chains(document: Mapping[str, Any]) -> dict[str, Problem]:
    period, witness = document["sample_period_s"], document["witness"]
    bandwidths = {name: witness[name]["bandwidth_rad_s"] for name in ("feedback", "observer")}
    return {
        "feedback": feedback_problem(bandwidths["feedback"], period, integral=_has_integral(document))[0],
        "observer": observer_problem(bandwidths["observer"], period)[0],
    }


def _has_integral(document: Mapping[str, Any]) -> bool:
    """Whether the feedback of an acceleration-level law has integral action."""
    return float(document["law"]["feedback"]["ki"]) != 0.0


def _torque_level(document: Mapping[str, Any]) -> dict[str, Problem]:
    """In the time units in which the pole disks have radius 2, and an inertia unit near the mean inertia."""
    law = document["law"]
    inertia = _vertices(law["inertia"])
    unit = 2.0 ** round(math.log2(float(np.mean(np.linalg.eigvalsh(inertia)))))
    if "premultiplication" in law:
        inertia = _vertices(law["premultiplication"]) @ inertia
    feedback, observer = document["witness"]["feedback"], document["witness"]["observer"]
    rates = {name: half["disk_rad_s"] / 2.0 for name, half in (("feedback", feedback), ("observer", observer))}
    noise = observer["noise"] * rates["observer"] ** 4 * unit
    return {
        "feedback": feedback_condition(inertia / unit, feedback["decay_per_s"] / rates["feedback"], 2.0).problem,
        "observer": observer_condition(inertia / unit, observer["decay_per_s"] / rates["observer"], 2.0, noise).problem,
    }


def _vertices(table: Mapping[str, Any]) -> npt.NDArray[np.float64]:
    return np.array([vertex for block in table["blocks"] for vertex in block["vertices"]])


_HALVES: Mapping[str, Callable[[Mapping[str, Any]], dict[str, Problem]]] = {
    DobAccelerationLaw.tag(): _sampled_chains,
    DobTorqueLaw.tag(): _torque_level,
}
