"""The sharper proof of a sampling period: its constants against independent ones, and how near it is to the truth."""

from __future__ import annotations

import math

import numpy as np
import pytest
from flint import arb

import quasilpv as ql
from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.program_values import program_values
from quasilpv.certificate.exact.tangents import Tangent
from quasilpv.certificate.exact.trigonometric import UnsupportedError
from quasilpv.certificate.systems import verify_system
from quasilpv.certificate.systems.linearised import LinearisedLoop
from quasilpv.certificate.systems.sampled import SampledLoop
from quasilpv.documents.system_artifact import SystemArtifactDocument
from quasilpv.experiments.system_run import SystemExperiment, simulate
from quasilpv.synthesis.regional.request import RegionalRequest
from quasilpv.system_release import release_system
from reference.released_systems import changed, on_the_border, released, request_of


def linear(period_s: float) -> SystemArtifactDocument:
    """x' = x + u with its feedback, released at a rate that is proved by Euler's bound, then sampled at another."""
    system = ql.DescriptorSystem.from_equations(
        ["x' = x + u"], state="x", inputs="u", domain={"x": (-1, 1)}, name="linear"
    )
    artifact = release_system(RegionalRequest(system, decay_rate=2.0, input_limits={"u": 4.0}, rate_hz=1000.0))
    return changed(artifact, sample_period_s=period_s)


def test_of_a_linear_plant_the_proof_ends_where_the_sampled_loop_does() -> None:
    artifact = linear(1e-3)
    (gain,) = {vertex for block in artifact.law.gain.blocks for vertex in block.vertices}
    K = gain[0][0]
    # x(T) = (e^T + (e^T - 1) K) x, which is -x at e^T = (K - 1)/(K + 1).
    limit = math.log((K - 1.0) / (K + 1.0))
    loop = LinearisedLoop(artifact)
    assert loop.cells_of_proof(0.9 * limit) is not None
    assert loop.cells_of_proof(1.01 * limit) is None
    assert SampledLoop(artifact).bound.longest_period_s < 0.9 * limit


def test_the_sharper_period_is_many_times_that_of_euler_and_runs_keep_the_region() -> None:
    artifact, rng = released("boost"), np.random.default_rng(7)
    assert artifact.sampling is not None
    assert artifact.sampling is not None
    assert artifact.sampling.method == "linearised"
    proved = artifact.sample_period_s
    assert SampledLoop(artifact, 400).bound.longest_period_s < 0.3 * proved
    starts = [on_the_border(artifact, rng) for _ in range(30)]

    def stayed(period_s: float) -> bool:
        slower = changed(artifact, sample_period_s=period_s, sampling=None)
        return all(simulate(slower, SystemExperiment(s, {}, 40 * period_s, rk4_steps=20)).stayed for s in starts)

    assert stayed(0.9 * proved)
    periods = proved * 1.25 ** np.arange(0.0, 20.0)
    limit = next(period for period in periods if not stayed(period))
    assert not stayed(3.0 * limit)
    assert limit > proved


def test_cells_are_cut_along_what_matters() -> None:
    # Cut along the widest signal, 20 000 cells do not prove this.
    artifact = released("cart-pole")
    euler = SampledLoop(artifact, 400).bound.longest_period_s
    cells = LinearisedLoop(artifact, 3000).cells_of_proof(2.0 * euler)
    assert cells is not None
    assert cells < 2000


def test_a_period_that_is_not_proved_is_found() -> None:
    artifact = released("boost")
    slow = verify_system(changed(artifact, sample_period_s=20.0 * artifact.sample_period_s))
    assert [claim.name.split(":")[0] for claim in slow.claims if not claim.holds] == ["sampling"]


def test_growth_and_curvature_are_above_every_sampled_one_and_not_far_above() -> None:
    artifact, rng = released("two-tanks"), np.random.default_rng(3)
    system, loop = request_of("two-tanks").system, LinearisedLoop(artifact)
    root = np.linalg.cholesky(np.array(artifact.region.lyapunov))

    def f(x: FloatArray, u: float) -> FloatArray:
        E, A, B, _ = system.evaluate(system.premise_values(x))
        return np.asarray(np.linalg.solve(E, A @ x + B[:, 0] * u))

    def slope(x: FloatArray, u: float) -> FloatArray:
        J = np.array([(f(x + 1e-5 * e, u) - f(x - 1e-5 * e, u)) / 2e-5 for e in np.eye(2)]).T
        return np.asarray(np.linalg.solve(root, J @ root))

    growth, curvature = 0.0, 0.0
    for _ in range(300):
        direction, along = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 2)))
        x, u = root @ direction * rng.uniform() ** 0.5, loop.cells.whole[2][1] * rng.choice([-1.0, 1.0])
        J = slope(x, u)
        growth = max(growth, np.linalg.eigvalsh(0.5 * (J + J.T))[-1])
        bent = slope(x + 1e-3 * root @ along, u) - slope(x - 1e-3 * root @ along, u)
        curvature = max(curvature, np.linalg.norm(bent, 2) / 2e-3)
    assert growth <= loop.growth
    assert curvature * (1.0 - 1e-3) <= loop.curvature <= 4.0 * curvature


@pytest.mark.parametrize(
    "code",
    [
        [("signal", 0), ("sin",), ("signal", 1), ("cos",), ("mul",)],
        [("signal", 0), ("exp",), ("signal", 1), ("div",)],
        [("signal", 1), ("sqrt",), ("signal", 0), ("tanh",), ("sub",)],
        [("signal", 1), ("log",), ("signal", 0), ("pow_int", 3), ("add",), ("neg",)],
        [("signal", 1), ("pow_int", -2), ("const", 2.5), ("mul",)],
    ],
)
def test_tangents_hold_the_slopes_of_programs(code: list[tuple[object, ...]]) -> None:
    x, h = np.array([0.7, 1.3]), 1e-6
    balls = [Tangent(arb(v, 1e-9), tuple(arb(int(i == k)) for k in range(2))) for i, v in enumerate(x)]
    (found,) = program_values(code, signal=balls)
    for k in range(2):
        ends = [program_values(code, signal=list(x + s * h * np.eye(2)[k]))[0] for s in (1, -1)]
        assert float(found.slopes[k].mid()) == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-7)


def test_an_operation_without_a_slope_is_refused() -> None:
    with pytest.raises(UnsupportedError, match="the slope of sinc"):
        program_values([("signal", 0), ("sinc",)], signal=[Tangent(arb(0.1), (arb(1),))])


def test_even_powers_of_a_ball_around_zero_are_not_negative() -> None:
    (found,) = program_values([("signal", 0), ("pow_int", 2)], signal=[arb(0, 2)])
    assert 0.0 >= found.lower() >= -1e-7
    assert 4.0 <= found.upper() <= 4.0 + 1e-6
