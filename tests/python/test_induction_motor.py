"""The induction motor of the examples: its equations against those of its source, in coordinates that stand still."""

from __future__ import annotations

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.systems.catalogue import system_kind
from reference.released_systems import EXAMPLES

RS, RR, M, L, J, LOAD = 0.18, 0.15, 0.068, 0.0699, 0.0586, 20.0


def in_standing_coordinates(speed: float, flux: FloatArray, current: FloatArray, voltage: FloatArray) -> FloatArray:
    """Rates of speed, flux (2) and current (2): Marino, Peresada and Valigi 1993, equation (1), one pole pair."""
    s = L - M**2 / L
    turned = np.array([-flux[1], flux[0]])
    torque = M / (J * L) * (flux[0] * current[1] - flux[1] * current[0])
    flux_rate = -RR / L * flux + speed * turned + RR / L * M * current
    current_rate = (voltage - RS * current - M / L * flux_rate) / s
    return np.array([torque - LOAD / J, *flux_rate, *current_rate])


def test_the_example_is_the_motor_of_its_source_seen_along_its_flux() -> None:
    system, rng = system_kind(str(EXAMPLES / "systems/induction_motor.py:motor")).system(), np.random.default_rng(5)
    assert system.trim is not None
    trim = np.array(system.trim)
    for _ in range(20):
        x = np.array([rng.uniform(float(low), float(high)) for low, high in (system.domain[k] for k in system.state)])
        u = rng.uniform(-50.0, 50.0, 2)
        E, A, B, _C = system.evaluate(system.premise_values(x))
        found = np.linalg.solve(E, A @ x + B @ u)
        (speed, flux, d, q), voltage = x + trim[:4], u + trim[4:]
        w, flux_along, flux_across, d_rate, q_rate = in_standing_coordinates(
            speed, np.array([flux, 0.0]), np.array([d, q]), voltage
        )
        turning = flux_across / flux  # of the flux, with which the coordinates turn
        expected = np.array([w, flux_along, d_rate + turning * q, q_rate - turning * d])
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
