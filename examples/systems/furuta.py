"""A rotary pendulum of Furuta: an arm that turns in the plane balances a pole that it carries at its end.

    (Ja + m L^2 + J sin(th)^2) wa' + m l L cos(th) w' = u - b wa + m l L sin(th) w^2 - J sin(2 th) wa w
    m l L cos(th) wa' + J w' = m g l sin(th) + J sin(th) cos(th) wa^2

al, wa: angle of the arm and its rate; th, w: angle of the pole from upright and its rate; u: torque, N m.
J = m l^2 = 0.0012, m l L = 0.00192, Ja + m L^2 = 0.0055 kg m^2, m g l = 0.0785 N m, b = 0.001 N m s.
Source: Furuta, Yamakita and Kobayashi 1992; equations as in Cazzolato and Prime 2011 for a point mass.

    design synth examples/systems/furuta.py:furuta --input-limit u=0.15 -o out/furuta
    design simulate out/furuta/artifact.json --start th=0.05
"""

import quasilpv as ql


def furuta(angle_rad: float = 0.5, arm_rate: float = 4.0, pole_rate: float = 4.0) -> ql.DescriptorSystem:
    """The pole within `angle_rad` of upright."""
    return ql.DescriptorSystem.from_equations(
        [
            "al' = wa",
            "th' = w",
            "(0.0055 + 0.0012*sin(th)^2)*wa' + 0.00192*cos(th)*w' = u - 0.001*wa + 0.00192*sin(th)*w^2"
            " - 0.0024*sin(th)*cos(th)*wa*w",
            "0.00192*cos(th)*wa' + 0.0012*w' = 0.0785*sin(th) + 0.0012*sin(th)*cos(th)*wa^2",
        ],
        name="furuta",
        state="al th wa w",
        inputs="u",
        domain={"th": (-angle_rad, angle_rad), "wa": (-arm_rate, arm_rate), "w": (-pole_rate, pole_rate)},
    )
