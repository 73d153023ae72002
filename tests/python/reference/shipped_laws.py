"""Artifact members of points of the conditions, as the documented format has them, for tests of the exact checker."""

from __future__ import annotations

from typing import Any

import numpy as np

from quasilpv.conditions.tracking.iv11_reduced import FeedbackPoint, ObserverPoint
from quasilpv.conditions.tracking.sampled_chains import ChainGains
from quasilpv.polytopes import BlockPolytope

PERIOD_S = 1e-3
FEEDBACK_BANDWIDTH = 100.0
OBSERVER_BANDWIDTH = 1500.0

# Design inertia of a two-joint arm over its one premise in [-0.2, 0.9], kg m^2.
POLYTOPE = BlockPolytope.takagi_sugeno([-0.2], [0.9])
INERTIA = POLYTOPE.vertices([[20.0, 6.0], [6.0, 6.0]], [[[8.0, 4.0], [4.0, 0.0]]])
INERTIA_UNIT = 16.0
DISK, DECAY, NOISE = 2.0, 1.0 / 16.0, 0.1
RATES = {"feedback": 150.0, "observer": 1500.0}


def chain_document(feedback: ChainGains, observer: ChainGains) -> dict[str, Any]:
    """The members of a `dob-acceleration` artifact the checker reads."""
    kp, kd, ki = feedback.gains.tolist()
    return {
        "sample_period_s": PERIOD_S,
        "law": {
            "kind": "dob-acceleration",
            "feedback": {"kp": kp, "kd": kd, "ki": ki},
            "observer": observer.gains.tolist(),
            "filter_time_constant_s": 1e-3,
            "disturbance_compensation": True,
            "inertia": POLYTOPE.to_document(INERTIA),
        },
        "witness": {
            "feedback": {"bandwidth_rad_s": FEEDBACK_BANDWIDTH, "P": feedback.lyapunov.tolist(), **_disk(feedback)},
            "observer": {"bandwidth_rad_s": OBSERVER_BANDWIDTH, "Q": observer.lyapunov.tolist(), **_disk(observer)},
        },
    }


def torque_document(feedback: FeedbackPoint, observer: ObserverPoint) -> dict[str, Any]:
    """The members of a `dob-torque` artifact the checker reads, for points in the conditions' own units.

    They are brought to SI as a design brings them: this is part of what is checked.
    """
    feedback = feedback.scaled(RATES["feedback"], INERTIA_UNIT)
    observer = observer.scaled(RATES["observer"], INERTIA_UNIT)
    return {
        "law": {
            "kind": "dob-torque",
            "feedback": POLYTOPE.to_document(feedback.gains),
            "observer": POLYTOPE.to_document(observer.gains),
            "filter_time_constant_s": 1e-3,
            "inertia": POLYTOPE.to_document(INERTIA),
        },
        "witness": {
            "feedback": {
                "decay_per_s": feedback.decay,
                "disk_rad_s": feedback.disk,
                "gamma": feedback.gamma,
                "P": feedback.P.tolist(),
            },
            "observer": {
                "decay_per_s": observer.decay,
                "disk_rad_s": observer.disk,
                "noise": observer.noise,
                "gamma": observer.gamma,
                "Q": observer.Q.tolist(),
                "multipliers": {
                    name.replace(" ", "_"): np.asarray(values[0]).tolist()
                    for name, values in observer.multipliers.items()
                },
            },
        },
    }


def _disk(chain: ChainGains) -> dict[str, float]:
    return {"disk_centre": chain.disk[0], "disk_radius": chain.disk[1], "objective": chain.objective}
