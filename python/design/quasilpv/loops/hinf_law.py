"""The law `hinf-tracking`, frozen (``docs/reference/formats.md``, law kinds)."""

from __future__ import annotations

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.loops.velocity_law import VelocityLaw


def hinf_tracking_law(
    sample_period_s: float,
    filter_time_constant_s: float,
    numerator: FloatArray,
    inertia: FloatArray,
    lyapunov: FloatArray,
) -> VelocityLaw:
    """``Gamma = K (y, w_f, int y)`` with ``K = Y diag(I, M, I)^-1 P^-1`` at B configurations, SI.

    Args:
        sample_period_s: T.
        filter_time_constant_s: of the measured speed; 0 for none.
        numerator: Y, (B, n, 3n).
        inertia: design inertia M, (B, n, n), kg m^2.
        lyapunov: P, (3n, 3n).
    """
    n = inertia.shape[-1]
    mixed = numerator.copy()
    mixed[:, :, n : 2 * n] = np.linalg.solve(inertia, numerator[:, :, n : 2 * n].swapaxes(1, 2)).swapaxes(1, 2)
    gain = np.linalg.solve(lyapunov, mixed.swapaxes(1, 2)).swapaxes(1, 2)
    proportional, derivative, integral = np.split(-gain, 3, axis=2)
    return VelocityLaw(sample_period_s, proportional, derivative, integral, inertia, filter_time_constant_s)
