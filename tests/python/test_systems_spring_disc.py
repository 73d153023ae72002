"""The damped-spring-disc: its fourth equation is the derivative of the constraint, and the printed signs are not."""

import numpy as np
import pytest
import sympy as sp
from numpy.testing import assert_allclose

from quasilpv.systems.catalogue import system

M, C_DELTA = 0.7, 9.0
K1, K2, DAMPING, R, J = 1.0, 1.0, 2.0, 2.0, 4.0


def hidden_constraint(printed_signs: bool) -> tuple[np.ndarray, np.ndarray, float]:
    """Row 4 of A and B at x_1^2 = z_1 and delta, as printed or derived: here at z_1 = 4, delta = 3."""
    sign = -1.0 if printed_signs else 1.0
    row = np.array([-(K1 + K2 * 4.0) / M, -DAMPING / M, 0.0, R**2 / J + 1 / M + sign * 3.0])
    return row, np.array([-R / J - sign * 3.0 / R]), 3.0


def test_fourth_equation_is_the_time_derivative_of_the_rolling_constraint() -> None:
    x1, x2, x3, force, u, delta = sp.symbols("x1 x2 x3 lambda u delta")
    inertia = J * R**2 / (R**2 + delta * J)
    speed_rate = (-K1 * x1 - K2 * x1**3 - DAMPING * x2 + force) / M
    spin_rate = (-R * force + u) / inertia
    derivative = sp.expand(speed_rate - R * spin_rate)
    model = system("spring-disc", M=M, c=C_DELTA)
    rng = np.random.default_rng(0)
    for _ in range(20):
        x, torque, uncertain = rng.uniform(-5, 5, 4), rng.uniform(-9, 9), rng.uniform(0, C_DELTA)
        E, A, B, _ = model.evaluate([x[0] ** 2, uncertain])
        value = derivative.subs(dict(zip((x1, x2, x3, force, u, delta), (*x, torque, uncertain), strict=True)))
        assert_allclose(A[3] @ x + B[3, 0] * torque, float(value), rtol=1e-12)
        assert_allclose(A[1] @ x, float(speed_rate.subs(dict(zip((x1, x2, force), x[[0, 1, 3]], strict=True)))))
        assert_allclose(A[0] @ x, x[1])
        assert_allclose(A[2] @ x, x[1] - R * x[2])
        assert_allclose(E, np.diag([1.0, 1.0, 0.0, 0.0]))


@pytest.mark.parametrize("printed_signs", [True, False])
def test_only_the_derived_signs_leave_the_motion_of_the_disc(printed_signs: bool) -> None:
    """Elimination of lambda must give (M + J_delta/r^2) x_1'' = -(k_1 + k_2 x_1^2) x_1 - b x_1' + u/r."""
    row, gain, delta = hidden_constraint(printed_signs)
    x1, x2, u = 2.0, -0.4, 1.7
    force = -(row[:2] @ [x1, x2] + gain[0] * u) / row[3]
    acceleration = (-(K1 + K2 * x1**2) * x1 - DAMPING * x2 + force) / M
    inertia = J * R**2 / (R**2 + delta * J)
    rolling = (-(K1 + K2 * x1**2) * x1 - DAMPING * x2 + u / R) / (M + inertia / R**2)
    if printed_signs:
        assert abs(acceleration - rolling) > 1.0
    else:
        model = system("spring-disc", M=M, c=C_DELTA)
        _, A, B, _ = model.evaluate([4.0, delta])
        assert_allclose(A[3], row)
        assert_allclose(B[3], gain)
        assert_allclose(acceleration, rolling, rtol=1e-12)


def test_printed_signs_make_the_contact_force_infinite_inside_the_uncertainty() -> None:
    """The pivot of lambda is 1/M + r^2/J + delta; printed as -delta it vanishes at a delta the disc can have."""
    model = system("spring-disc", M=15.0, c=60.0)
    pivots = [model.evaluate([z1, delta]).A[3, 3] for z1 in (0.0, 25.0) for delta in (0.0, 60.0)]
    assert min(pivots) == pytest.approx(1 / 15.0 + R**2 / J)
    assert 0.0 < R**2 / J + 1 / 15.0 < 60.0
