"""The worked example of a user's own system says what its equations say."""

import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from quasilpv.systems.descriptor.premise import PremiseKind
from quasilpv.systems.descriptor.structure import Standing, StructureVerdict, structure_report
from quasilpv.systems.descriptor.system import DescriptorSystem

EXAMPLE = Path(__file__).parents[2] / "examples" / "own_system.py"
NAMES = runpy.run_path(str(EXAMPLE))


@pytest.fixture(scope="module")
def bus() -> DescriptorSystem:
    return NAMES["dc_bus"]()


def test_bus_obeys_the_circuit(bus: DescriptorSystem) -> None:
    rng = np.random.default_rng(8)
    assert [str(symbol) for symbol in bus.state] == ["i", "v", "j"]
    for _ in range(30):
        i, v, u, power = rng.uniform(-20, 20), rng.uniform(-12, 12), rng.uniform(-5, 5), rng.uniform(200, 600)
        load_current = power / (48 + v) - power / 48  # the converter draws the same power at another voltage
        E, A, B, C = bus.evaluate([v, power])
        right = A @ [i, v, load_current] + B[:, 0] * u
        assert_allclose(right[2], 0, atol=1e-10)
        di, dv = np.linalg.solve(E[:2, :2], right[:2])
        assert_allclose(di, (-0.05 * i - v + u) / 0.002, rtol=1e-12)
        assert_allclose(dv, (i - load_current) / (0.005 + 0.00005 * v), rtol=1e-12)
        assert_allclose(C @ [i, v, load_current], [i, v])


def test_capacitance_and_load_share_one_premise_and_the_power_is_unknown(bus: DescriptorSystem) -> None:
    assert [(str(p.expression), p.bounds, p.kind) for p in bus.premises] == [
        ("v", (-12.0, 12.0), PremiseKind.MEASURED),
        ("P", (200.0, 600.0), PremiseKind.UNKNOWN),
    ]
    assert bus.uncertainty is not None
    assert bus.uncertainty.Ha.shape == (3, 1)


def test_bus_has_index_one_only_while_its_voltage_is_positive(bus: DescriptorSystem) -> None:
    assert structure_report(bus).verdict is StructureVerdict.INDEX_ONE
    beyond = structure_report(NAMES["dc_bus"](deviation_max_v=50.0))
    assert beyond.verdict is StructureVerdict.NOT_PROVED
    assert beyond.algebraic_pivot.standing is Standing.REFUTED


def test_constant_power_makes_the_bus_unstable_above_the_power_that_circuit_theory_gives(bus: DescriptorSystem) -> None:
    # s^2 + (R/L - g/C) s + (1 - R g)/(L C) with g = P/V0^2: unstable from g = R C/L on.
    critical = 0.05 * 0.005 / 0.002 * 48.0**2
    growth = NAMES["growth_rate_per_s"]
    assert growth(bus, 0.99 * critical) < 0 < growth(bus, 1.01 * critical)


def test_example_runs_and_names_its_verdicts() -> None:
    printed = subprocess.run([sys.executable, str(EXAMPLE)], check=True, capture_output=True, text=True).stdout
    assert "dc-bus: index-one" in printed
    assert "dc-bus: not proved" in printed
