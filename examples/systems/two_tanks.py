"""Two tanks in series, level of the second one held by the inflow of the first.

    S h1' = u - c sqrt(h1),    S h2' = c sqrt(h1) - c sqrt(h2)

h1, h2: levels, m; u: inflow, m^3/s; around the levels at which an inflow of 0.01 m^3/s stands still. Torricelli's law.

    design synth examples/systems/two_tanks.py:two_tanks --decay 0.05 --input-limit u=0.006 -o out/two_tanks
    design simulate out/two_tanks/artifact.json --start h2=0.15

and with the level of the second tank measured alone:

    design synth examples/systems/two_tanks.py:two_tanks --decay 0.05 --input-limit u=0.006 --measured h2 --rate-hz 10
"""

import quasilpv as ql


def two_tanks(depth_m: float = 0.15) -> ql.DescriptorSystem:
    """Levels within `depth_m` of 0.25 m."""
    return ql.DescriptorSystem.from_equations(
        ["0.1*h1' = u - 0.02*sqrt(h1)", "0.1*h2' = 0.02*sqrt(h1) - 0.02*sqrt(h2)"],
        name="two-tanks",
        state="h1 h2",
        inputs="u",
        domain={"h1": (0.25 - depth_m, 0.25 + depth_m), "h2": (0.25 - depth_m, 0.25 + depth_m)},
        equilibrium=((0.25, 0.25), (0.01,)),
    )
