"""Extended compensation (I.53) where nothing but the gains sees a part of its Lyapunov matrix."""

from __future__ import annotations

import numpy as np
import pytest

import quasilpv as ql
from quasilpv.systems.descriptor.system import DescriptorSystem


def _system(
    equations: list[str], state: str, inputs: str = "u", outputs: str = "", **domain: tuple[float, float]
) -> DescriptorSystem:
    shown = [outputs] if outputs else None
    known = {"p": (-1.0, 1.0), **domain}
    return DescriptorSystem.from_equations(
        equations, state=state, inputs=inputs, outputs=shown, domain=known, unknown="p"
    )


SYSTEMS = {
    "one state": _system(["x' = p*x + u"], "x"),
    "two inputs for one": _system(["x' = p*x + u + v"], "x", "u v"),
    "a chain": _system(["x' = y", "y' = 2*p*x + u"], "x y"),
    "a scheduled chain": _system(["x' = y", "y' = 2*p*x + sin(x)*y + u"], "x y", x=(-1, 1)),
    "unknown in E": _system(["x' = y", "(2 + p)*y' = sin(x)*y + x + u"], "x y", x=(-1, 1)),
    "unknown in B": _system(["x' = y", "y' = x + (2 + p)*u"], "x y"),
    "unknown in C": _system(["x' = y", "y' = x + u"], "x y", outputs="(2 + p)*x"),
    "algebraic": _system(["x' = y + w", "y' = p*x + u", "0 = w + x + u"], "x y w"),
    "algebraic, unknown": _system(["x' = w + u", "0 = (3 + p)*w + x"], "x w"),
}


@pytest.mark.parametrize("form", ["reduced", "published"])
@pytest.mark.parametrize("name", SYSTEMS)
def test_every_solution_has_a_law_that_stabilises_whatever_is_unknown(name: str, form: str) -> None:
    """``E x' = A x + B (K_d x_d + K' x_d' + K_a x_a)`` solved for x_d', by plain eigenvalues."""
    system, rng = SYSTEMS[name], np.random.default_rng(7)
    answer = ql.solve(system, "I.53", form=form, decay_rate=0.1)
    assert answer.headline == "feasible, proved"
    assert answer.law is not None
    q, n = system.differential, system.order
    for _ in range(40):
        z = rng.uniform(system.lower, system.upper)
        E, A, B, _ = system.evaluate(z)
        K = answer.law.gain(z)
        descriptor = np.hstack([E[:, :q] - B @ K[:, q : 2 * q], -(A[:, q:] + B @ K[:, 2 * q :])])
        rates = np.linalg.solve(descriptor, A[:, :q] + B @ K[:, :q])[:q]
        assert descriptor.shape == (n, n)
        assert np.linalg.eigvals(rates).real.max() < -0.1
