"""A system of your own, from its equations: a DC bus that feeds a constant-power load.

A 48 V source with series resistance R and inductance L charges a bus capacitor; a converter draws the power P from the
bus whatever its voltage is. Its current falls when the voltage rises, which is a negative resistance: above a certain
power the bus oscillates unless the source voltage is controlled. In deviations from the operating point V0, P/V0:

    L i' = -R i - v + u                    current of the source
    (C + c v) v' = i - j                   bus voltage; the capacitance of an ultracapacitor grows with its voltage
    0 = (V0 + v) j + P/V0 v                (V0 + v)(P/V0 + j) = P, the load

The load is an algebraic equation, the capacitance makes E depend on the state, and the controller does not know P.

Run it: python examples/own_system.py. Ask it: design solve examples/own_system.py:dc_bus --condition II.5
--representation uncertain --decay 5. The same bus as a document of equations, without code: examples/dc_bus.json.
"""

from __future__ import annotations

import numpy as np

from quasilpv.systems.descriptor.structure import structure_report
from quasilpv.systems.descriptor.system import DescriptorSystem


def dc_bus(deviation_max_v: float = 12.0, power_w: tuple[float, float] = (200.0, 600.0)) -> DescriptorSystem:
    """The bus while its voltage stays within `deviation_max_v` of 48 V, for every load power in an interval."""
    return DescriptorSystem.from_equations(
        [
            "0.002*i' = -0.05*i - v + u",
            "(0.005 + 0.00005*v)*v' = i - j",
            "(48 + v)*j + P/48*v = 0",
        ],
        name="dc-bus",
        state="i v j",
        inputs="u",
        outputs=["i", "v"],
        domain={"v": (-deviation_max_v, deviation_max_v), "P": power_w},
        unknown="P",
        units={"i": "A", "v": "V", "j": "A", "u": "V", "P": "W"},
    )


def growth_rate_per_s(system: DescriptorSystem, power_w: float) -> float:
    """Largest real part of the eigenvalues at v = 0 without control, after elimination of the load current."""
    q = system.differential
    E, A, _, _ = system.evaluate([0.0, power_w])
    reduced = A[:q, :q] - A[:q, q:] @ np.linalg.solve(A[q:, q:], A[q:, :q])
    return float(np.linalg.eigvals(np.linalg.solve(E[:q, :q], reduced)).real.max())


def main() -> None:
    """Print what was found of the system."""
    system = dc_bus()
    print("state", system.state, "of which", system.differential, "differential; inputs", system.inputs)
    for premise in system.premises:
        print(f"{premise.name} = {premise.expression} in [{premise.lower}, {premise.upper}], {premise.kind}")
    print(structure_report(system))
    for power_w in (200.0, 600.0):
        print(f"uncontrolled at {power_w:.0f} W: growth rate {growth_rate_per_s(system, power_w):+.1f} 1/s")
    print("beyond the bus voltage:", structure_report(dc_bus(deviation_max_v=50.0)), sep="\n")


if __name__ == "__main__":
    main()
