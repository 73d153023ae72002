"""An induction motor in coordinates that turn with the flux of its rotor: speed and flux by two voltages.

    w' = mu psi iq - T/J                    speed of the rotor, rad/s
    psi' = -a psi + a M id                  its flux, Wb
    id' = -g id + a b psi + p w iq + a M iq^2/psi + ud/s
    iq' = -g iq - p b w psi - p w id - a M iq id/psi + uq/s

id, iq: currents of the stator along the flux and across, A; ud, uq: voltages, V, around 60 rad/s, 1.3 Wb and a load of
20 N m. A motor of 15 kW: Rs = 0.18, Rr = 0.15 ohm, M = 0.068, Ls = Lr = 0.0699 H, J = 0.0586 kg m^2, p = 1;
a = Rr/Lr, s = Ls - M^2/Lr, b = M/(s Lr), mu = p M/(J Lr), g = (M/Lr)^2 Rr/s + Rs/s.
Source: Marino, Peresada and Valigi 1993, Adaptive input-output linearizing control of induction motors.

    design synth examples/systems/induction_motor.py:motor --decay 32 --input-limit ud=60 --input-limit uq=60 -o out/im
    design simulate out/im/artifact.json --start w=63 --start psi=1.25
"""

import sympy as sp

import quasilpv as ql

STATOR, ROTOR, MUTUAL, SELF, INERTIA = map(sp.Rational, ("0.18", "0.15", "0.068", "0.0699", "0.0586"))
SPEED, FLUX, LOAD = map(sp.Rational, ("60", "1.3", "20"))


def motor(speed: float = 20.0, flux: float = 0.3, current_a: float = 30.0) -> ql.DescriptorSystem:
    """Within `speed` rad/s, `flux` Wb and `current_a` of the operating point."""
    a, leakage = ROTOR / SELF, SELF - MUTUAL**2 / SELF
    b, mu = MUTUAL / (leakage * SELF), MUTUAL / (INERTIA * SELF)
    g = (MUTUAL / SELF) ** 2 * ROTOR / leakage + STATOR / leakage
    d, q = FLUX / MUTUAL, LOAD / (INERTIA * mu * FLUX)
    ud = leakage * (g * d - a * b * FLUX - SPEED * q - a * MUTUAL * q**2 / FLUX)
    uq = leakage * (g * q + b * SPEED * FLUX + SPEED * d + a * MUTUAL * q * d / FLUX)
    return ql.DescriptorSystem.from_equations(
        [
            f"w' = ({mu})*psi*iq - ({LOAD / INERTIA})",
            f"psi' = ({a * MUTUAL})*id - ({a})*psi",
            f"id' = -({g})*id + ({a * b})*psi + w*iq + ({a * MUTUAL})*iq^2/psi + ({1 / leakage})*ud",
            f"iq' = -({g})*iq - ({b})*w*psi - w*id - ({a * MUTUAL})*iq*id/psi + ({1 / leakage})*uq",
        ],
        name="induction-motor",
        state="w psi id iq",
        inputs="ud uq",
        domain={
            "w": (SPEED - speed, SPEED + speed),
            "psi": (FLUX - flux, FLUX + flux),
            "id": (d - current_a, d + current_a),
            "iq": (q - current_a, q + current_a),
        },
        equilibrium=((SPEED, FLUX, d, q), (ud, uq)),
    )
