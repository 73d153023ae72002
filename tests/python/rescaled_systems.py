"""The same system in other units, and the same question about it. Factors are no powers of two: nothing is exact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import sympy as sp

from quasilpv.arrays import FloatArray
from quasilpv.conditions.condition import Options
from quasilpv.systems.descriptor.premise import AffineMatrix
from quasilpv.systems.descriptor.system import DescriptorSystem


def rescaled(system: DescriptorSystem, options: Options, seed: int) -> tuple[DescriptorSystem, Options]:
    """States, inputs and equations in units up to 10^5 smaller or larger, time up to 10^6."""
    rng = np.random.default_rng(seed)
    state, rows = (10.0 ** rng.uniform(-5.0, 5.0, system.order) for _ in range(2))
    inputs, time = 10.0 ** rng.uniform(-5.0, 5.0, len(system.inputs)), 10.0 ** rng.uniform(-6.0, 6.0)

    def changed(matrix: AffineMatrix, left: FloatArray | float, right: FloatArray) -> AffineMatrix:
        return AffineMatrix(left * matrix.constant * right, left * matrix.coefficients * right)

    factors = dict(zip(system.state, state.tolist(), strict=True))
    old = {symbol: sp.Float(factor) * symbol for symbol, factor in factors.items()}
    made = replace(
        system,
        E=changed(system.E, rows[:, None] / time, state),
        A=changed(system.A, rows[:, None], state),
        B=changed(system.B, rows[:, None], inputs),
        C=changed(system.C, 1.0, state),
        premises=tuple(replace(p, expression=p.expression.xreplace(old)) for p in system.premises),
        domain={
            symbol: (low / factors.get(symbol, 1.0), high / factors.get(symbol, 1.0))
            for symbol, (low, high) in system.domain.items()
        },
    )
    window = None if options.window_s is None else options.window_s / time
    return made, replace(
        options,
        decay_rate=options.decay_rate * time,
        window_s=window,
        sample_period_s=options.sample_period_s / time,
    )
