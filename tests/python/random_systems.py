"""Small random descriptor systems, some stabilisable and some not."""

from __future__ import annotations

import numpy as np
import sympy as sp

from quasilpv.systems.descriptor.premise import AffineMatrix, Premise, PremiseKind
from quasilpv.systems.descriptor.system import DescriptorSystem


def random_system(
    seed: int,
    *,
    order: int = 2,
    differential: int = 2,
    inputs: int = 1,
    premises: int = 2,
    spread: float = 0.3,
    instability: float = 0.5,
    constant_input: bool = True,
    unknown: int = 0,
) -> DescriptorSystem:
    """A system whose matrices are random, with E = diag(E_1, 0), and whose premises are symbols in [-1, 2].

    Args:
        seed: of the generator.
        order, differential, inputs, premises: n, q, m, r.
        spread: size of the coefficients of the premises.
        instability: added to the diagonal of A_11.
        constant_input: whether B does not depend on the premises.
        unknown: how many of the last premises the controller does not know.
    """
    rng = np.random.default_rng(seed)
    n, q, r = order, differential, premises
    mask = np.zeros((n, n))
    mask[:q, :q] = 1.0
    E = AffineMatrix(mask * np.eye(n), spread * 0.3 * rng.standard_normal((r, n, n)) * mask)
    drift = rng.standard_normal((n, n)) + np.diag([instability - 1.0] * q + [2.0] * (n - q))
    A = AffineMatrix(drift, spread * rng.standard_normal((r, n, n)))
    moving = 0.0 if constant_input else 1.0
    B = AffineMatrix(rng.standard_normal((n, inputs)), moving * spread * rng.standard_normal((r, n, inputs)))
    if unknown:
        E.coefficients.setflags(write=True)
        E.coefficients[r - unknown :] = 0.0
    symbols = sp.symbols(f"z1:{r + 1}", real=True)
    kinds = [PremiseKind.MEASURED] * (r - unknown) + [PremiseKind.UNKNOWN] * unknown
    return DescriptorSystem(
        name=f"random {seed}",
        state=sp.symbols(f"x1:{n + 1}", real=True),
        inputs=tuple(f"u{k}" for k in range(inputs)),
        premises=tuple(Premise(str(z), z, (-1.0, 2.0), kind) for z, kind in zip(symbols, kinds, strict=True)),
        E=E,
        A=A,
        B=B,
        C=AffineMatrix(np.eye(n), np.zeros((r, n, n))),
        domain={z: (-1.0, 2.0) for z in symbols},
    )
