"""A translational oscillator with a rotating actuator (TORA), the benchmark of nonlinear control.

    (1 - e^2 cos(th)^2) v' = -x + e w^2 sin(th) - e cos(th) u
    (1 - e^2 cos(th)^2) w' = e cos(th) (x - e w^2 sin(th)) + u

Normalised: x, v: the cart and its speed; th, w: the eccentric mass and its rate; u: its torque; e = 0.1 couples them.
Source: Bupp, Bernstein and Coppola 1998, A benchmark problem for nonlinear control design.

    design synth examples/systems/tora.py:tora --decay 0.01 --input-limit u=1 -o out/tora
    design simulate out/tora/artifact.json --start x=0.3
"""

import quasilpv as ql


def tora(angle_rad: float = 1.0, rate: float = 1.0) -> ql.DescriptorSystem:
    """The mass within `angle_rad` of its rest, turning at most at `rate`."""
    return ql.DescriptorSystem.from_equations(
        [
            "x' = v",
            "th' = w",
            "(1 - 0.01*cos(th)^2)*v' = -x + 0.1*w^2*sin(th) - 0.1*cos(th)*u",
            "(1 - 0.01*cos(th)^2)*w' = 0.1*cos(th)*(x - 0.1*w^2*sin(th)) + u",
        ],
        name="tora",
        state="x th v w",
        inputs="u",
        domain={"x": (-1, 1), "v": (-1, 1), "th": (-angle_rad, angle_rad), "w": (-rate, rate)},
    )
