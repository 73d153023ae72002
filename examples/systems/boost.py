"""A boost converter with a resistive load, averaged, around its operating point.

    L i' = V - (1 - d) v,    C v' = (1 - d) i - v / R

i: current of the coil, A; v: output voltage, V; d: duty ratio, the input; V = 12 V, R = 20 ohm. Around d = 1/2, where
v = 24 V and i = 2.4 A. The input multiplies both states, so B(z) depends on them. Source: Middlebrook and Cuk 1976.

    design synth examples/systems/boost.py:boost --input-limit d=0.4 -o out/boost
    design simulate out/boost/artifact.json --start v=22
"""

import quasilpv as ql


def boost(current_a: float = 2.0, voltage_v: float = 6.0) -> ql.DescriptorSystem:
    """Within `current_a` and `voltage_v` of the operating point."""
    return ql.DescriptorSystem.from_equations(
        ["0.0005*i' = 12 - (1 - d)*v", "0.0005*v' = (1 - d)*i - v/20"],
        name="boost",
        state="i v",
        inputs="d",
        domain={"i": (2.4 - current_a, 2.4 + current_a), "v": (24 - voltage_v, 24 + voltage_v)},
        equilibrium=((2.4, 24), (0.5,)),
    )
