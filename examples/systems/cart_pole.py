"""A cart that balances a pole, from its equations of motion.

    (M + m) a + m l cos(th) aw = u + m l sin(th) w^2 - b v        the cart, with viscous friction
    l cos(th) m a + m l^2 aw = m g l sin(th)                      the pole, a point mass on a rod

p, v: place and speed of the cart, m and m/s; th, w: angle from upright and its rate, rad and rad/s; u: force, N.
The inertia matrix depends on the angle, so E(z) does. Source: Khalil, Nonlinear Systems, 3rd edition, exercise 1.15,
without the moment of inertia of the rod.

    design synth examples/systems/cart_pole.py:cart_pole --decay 1 --input-limit u=60 -o out/cart_pole
    design simulate out/cart_pole/artifact.json --start th=0.2

and with place and angle measured, both speeds estimated:

    design synth examples/systems/cart_pole.py:cart_pole --decay 1 --input-limit u=60 --measured p,th -o out/observed
"""

import quasilpv as ql


def cart_pole(angle_rad: float = 0.8, rate_rad_s: float = 4.0) -> ql.DescriptorSystem:
    """The pole within `angle_rad` of upright, turning at most at `rate_rad_s`."""
    return ql.DescriptorSystem.from_equations(
        [
            "p' = v",
            "th' = w",
            "(1 + 0.1)*v' + 0.1*0.5*cos(th)*w' = u + 0.1*0.5*sin(th)*w^2 - 0.1*v",
            "cos(th)*v' + 0.5*w' = 9.81*sin(th)",
        ],
        name="cart-pole",
        state="p th v w",
        inputs="u",
        domain={
            "p": (-5, 5),
            "v": (-10, 10),
            "th": (-angle_rad, angle_rad),
            "w": (-rate_rad_s, rate_rad_s),
        },
    )
