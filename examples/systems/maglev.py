"""Magnetic levitation: a steel ball below an electromagnet that is driven by a current.

    m v' = m g - c i^2 / x^2,    x' = v,    L i' = u - R i

x: distance from the magnet, m; v: its speed; i: current, A; u: voltage, V. m = 0.05 kg, c = 1.2e-4 N m^2/A^2,
L = 0.05 H, R = 5 ohm; around x = 15 mm, where i = 0.959 A. Source: Khalil, Nonlinear Systems, exercise 1.18.

    design synth examples/systems/maglev.py:maglev --input-limit u=10 -o out/maglev
    design simulate out/maglev/artifact.json --start x=0.0155
"""

import sympy as sp

import quasilpv as ql

CURRENT = sp.Rational(15, 1000) * sp.sqrt(sp.Rational(5, 100) * sp.Rational(981, 100) / sp.Rational(12, 100_000))
"""At which the ball floats at 15 mm, exactly."""


def maglev(travel_m: float = 0.004, current_a: float = 0.5) -> ql.DescriptorSystem:
    """Within `travel_m` of 15 mm and `current_a` of the current there."""
    return ql.DescriptorSystem.from_equations(
        ["x' = v", "0.05*x^2*v' = 0.05*9.81*x^2 - 1.2e-4*i^2", "0.05*i' = u - 5*i"],
        name="maglev",
        state="x v i",
        inputs="u",
        domain={
            "x": (0.015 - travel_m, 0.015 + travel_m),
            "v": (-0.4, 0.4),
            "i": (float(CURRENT) - current_a, float(CURRENT) + current_a),
        },
        equilibrium=((0.015, 0, CURRENT), (5 * CURRENT,)),
    )
