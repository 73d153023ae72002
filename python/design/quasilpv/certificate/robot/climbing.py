"""The largest value of a function over a box of postures: random postures, then random steps up from the best of them.

A sample, whatever it finds: it says how much a proof could still gain.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from quasilpv.arrays import FloatArray

SAMPLES = 1500
CLIMBERS = 16
CLIMB_STEPS = 70
FIRST_STEP_RAD = 0.5
SHRINK = 0.93
SEED = 20220315


def climbed(
    value: Callable[[FloatArray], FloatArray], lower: FloatArray, upper: FloatArray
) -> tuple[FloatArray, float]:
    """The best posture, (n,), and its value.

    Args:
        value: of postures (N, n), (N,).
        lower, upper: corners of the box, (n,).
    """
    rng = np.random.default_rng(SEED)
    q = rng.uniform(lower, upper, (SAMPLES, len(lower)))
    reached = value(q)
    best = np.argsort(-reached)[:CLIMBERS]
    q, reached, step = q[best], reached[best], FIRST_STEP_RAD
    for _ in range(CLIMB_STEPS):
        tried = np.clip(q + step * rng.normal(size=q.shape), lower, upper)
        now = value(tried)
        better = now > reached
        q[better], reached[better] = tried[better], now[better]
        step *= SHRINK
    at = int(np.argmax(reached))
    return q[at], float(reached[at])
