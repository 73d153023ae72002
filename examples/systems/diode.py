"""A circuit with a diode, as differential-algebraic equations: a source charges a capacitor through a coil.

    L i' = u - R i - v,    C v' = i - j,    0 = j - Is (exp(v / Vt) - 1)

i: current of the coil; v: voltage of the capacitor, which a diode is across; j: current of the diode, an algebraic
state. L = 1 mH, C = 100 uF, R = 1 ohm, Is = 1 mA, Vt = 0.2 V (a string of diodes). Source: Shockley 1949.

    design synth examples/systems/diode.py:diode -o out/diode
    design simulate out/diode/artifact.json --start v=0.3
"""

import quasilpv as ql


def diode(voltage_v: float = 0.5) -> ql.DescriptorSystem:
    """While the voltage stays within `voltage_v` of 0."""
    return ql.DescriptorSystem.from_equations(
        ["0.001*i' = u - i - v", "0.0001*v' = i - j", "j = 0.001*(exp(v/0.2) - 1)"],
        name="diode",
        state="i v j",
        inputs="u",
        domain={"v": (-voltage_v, voltage_v)},
    )
