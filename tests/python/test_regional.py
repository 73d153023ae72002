"""Feedback of general systems with the region it is proved in: designs, and what the checker finds."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import quasilpv as ql
from quasilpv.arrays import FloatArray
from quasilpv.certificate.systems import verify_system
from quasilpv.certificate.systems.sampled import SampledLoop
from quasilpv.documents.strict_model import validate
from quasilpv.documents.system_artifact import SystemArtifactDocument
from quasilpv.errors import ClaimError, InfeasibleError, InputError
from quasilpv.experiments.system_run import SystemExperiment, simulate
from quasilpv.synthesis.regional.feedback import design_feedback
from quasilpv.synthesis.regional.request import RegionalRequest
from quasilpv.system_release import release_system
from reference.released_systems import (
    ASKED,
    changed,
    on_the_border,
    released,
    request_of,
    runs_from_the_border,
)

# ---- designs and their proof -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ASKED)
def test_what_is_released_is_proved_and_says_what_is_sampled(name: str) -> None:
    found = verify_system(released(name))
    assert found.verified
    assert [claim.name for claim in found.claims if claim.evidence.value == "sampled"] == [
        "plant: residual of the model at 64 points (sampled)"
    ]


@pytest.mark.parametrize("name", ASKED)
@pytest.mark.parametrize("count", [60, pytest.param(10_000, marks=pytest.mark.full)])
def test_no_run_from_the_border_leaves_the_region_or_the_limits(name: str, count: int) -> None:
    for start, level, flags, left in runs_from_the_border(released(name), count):
        assert left is None, start
        assert flags == 0, start
        assert level[0] < 1.0, start
        assert (np.diff(level) <= 1e-12).all(), start


def test_a_period_far_beyond_the_proved_one_breaks_the_loop() -> None:
    # What is held to be proved above can fail: the pole falls before the next sample.
    artifact, rng = released("cart-pole"), np.random.default_rng(7)
    slow = changed(artifact, sample_period_s=0.5, sampling=None)
    runs = [simulate(slow, SystemExperiment(on_the_border(slow, rng), {}, 25.0, rk4_steps=50)) for _ in range(5)]
    assert not any(each.stayed for each in runs)


@pytest.mark.parametrize(
    "change",
    [
        {"region.lyapunov": 1.1},
        {"region.decay_rate_per_s": 4.0},
        {"law.gain": -1.0},
        {"model.lower": 0.7},
        {"signals.high": 0.5},
        {"model.A": 1.5},
        {"sample_period_s": 1000.0},
    ],
    ids=lambda change: next(iter(change)),
)
def test_a_claim_that_is_not_so_is_found(change: dict[str, float]) -> None:
    [(member, factor)] = change.items()
    content = released("two-tanks").content()
    part, _, name = member.partition(".")
    if part == "signals":
        for signal in content["signals"]:
            signal["high"] = signal["high"] and factor * signal["high"]
            signal["low"] = signal["low"] and factor * signal["low"]
    elif not name:
        content[part] = min(content[part] * factor, 10.0)
    elif name == "lower":
        half = [
            0.5 * (high - low) * factor
            for low, high in zip(content[part]["lower"], content[part]["upper"], strict=True)
        ]
        for place in (content["model"], content["law"]["gain"]):
            place["lower"] = [high - 2.0 * h for high, h in zip(place["upper"], half, strict=True)]
    else:
        content[part][name] = _scaled(content[part][name], factor)
    try:
        found = verify_system(validate(SystemArtifactDocument, content, "changed"))
    except InputError:
        return
    assert not found.verified


def _scaled(value: Any, factor: float) -> Any:
    """Numbers of matrices times a factor; what schedules them stays."""
    if isinstance(value, dict):
        return {
            k: v if k in {"premises", "lower", "upper", "centre", "kind"} else _scaled(v, factor)
            for k, v in value.items()
        }
    if isinstance(value, list):
        return [_scaled(v, factor) for v in value]
    return factor * value if isinstance(value, int | float) else value


def test_the_enclosed_slope_is_above_every_sampled_one() -> None:
    artifact, rng = released("cart-pole"), np.random.default_rng(3)
    loop = SampledLoop(artifact, 200)
    system = request_of("cart-pole").system
    root = np.linalg.cholesky(np.array(artifact.region.lyapunov))

    def f(x: FloatArray, u: float) -> FloatArray:
        E, A, B, _ = system.evaluate(system.premise_values(x))
        return np.asarray(np.linalg.solve(E, A @ x + B[:, 0] * u))

    largest = 0.0
    for _ in range(300):
        direction = rng.normal(size=4)
        x = root @ (direction / np.linalg.norm(direction)) * rng.uniform() ** 0.25
        u = 60.0 * rng.uniform(-1, 1)
        J = np.array([(f(x + 1e-6 * e, u) - f(x - 1e-6 * e, u)) / 2e-6 for e in np.eye(4)]).T
        largest = max(largest, np.linalg.norm(np.linalg.solve(root, J @ root), 2))
    assert largest <= loop.bound.lipschitz * (1 + 1e-6)
    assert loop.bound.lipschitz <= 6.0 * largest  # and not far above


def with_algebraic(equation: str) -> ql.DescriptorSystem:
    """A tank whose outflow, algebraic, is nonlinear in itself."""
    return ql.DescriptorSystem.from_equations(
        ["x' = u - y", equation], state="x y", inputs="u", domain={"x": (-1, 1), "y": (-0.8, 0.8)}, name="tank"
    )


def test_a_premise_in_an_algebraic_state_is_bounded_by_its_domain_unless_the_input_moves_it() -> None:
    # Between samples the input is not that of the law: what was proved of the algebraic state with it is not so then.
    still = release_system(RegionalRequest(with_algebraic("2*y + y^3 = x"), input_limits={"u": 2.0}))
    assert still.sampling is not None
    assert verify_system(still).verified
    moved = RegionalRequest(with_algebraic("2*y + y^3 = x + u/20"), input_limits={"u": 2.0})
    with pytest.raises(ClaimError, match="the algebraic state y, which moves with the input"):
        release_system(moved)
    assert release_system(moved, allow_unproved_rate=True).sampling is None


def test_an_algebraic_equation_that_folds_is_refused() -> None:
    # 0 = x - (y - 0.4 y^3) has no solution near y where x exceeds its largest value: the state would jump.
    folding = with_algebraic("0 = x - (y - 0.8*y^3)")
    with pytest.raises(InputError, match="the algebraic equation folds"):
        release_system(RegionalRequest(folding, input_limits={"u": 5.0}), allow_unproved_rate=True)


def test_more_decay_less_input_and_a_slower_loop_give_smaller_regions() -> None:
    base = replace(request_of("two-tanks"), rate_hz=None)
    size = [np.linalg.det(design_feedback(r).lyapunov) for r in (base, replace(base, decay_rate=0.3))]
    assert size[1] < size[0]
    tight = replace(base, decay_rate=0.3, input_limits={"u": 0.001})
    assert np.linalg.det(design_feedback(tight).lyapunov) < size[1]


def test_each_objective_is_best_at_what_it_is_for() -> None:
    base = replace(request_of("two-tanks"), rate_hz=None)
    largest = design_feedback(base)
    fastest = design_feedback(replace(base, objective="fastest", decay_rate=None))
    least = design_feedback(replace(base, objective="least-gain"))
    assert fastest.decay_rate > largest.decay_rate
    assert np.abs(least.gains).max() < np.abs(largest.gains).max()
    assert np.linalg.det(largest.lyapunov) > max(np.linalg.det(d.lyapunov) for d in (fastest, least))
    assert (fastest.extent >= 0.5 * 0.15 * (1 - 1e-6)).all()  # half of the domain is covered


def test_another_factoring_is_found_where_the_first_one_has_no_design() -> None:
    # With the documented rule this has none; (x^2 y) as y (x^2) instead of x (x y) has one.
    system = ql.DescriptorSystem.from_equations(
        ["x' = v", "v' = x - x*v^2 + u"], state="x v", inputs="u", domain={"x": (-1, 1), "v": (-1, 1)}, name="two-ways"
    )
    assert release_system(RegionalRequest(system, input_limits={"u": 20.0})).region.decay_rate_per_s > 0.0


# ---- refusals --------------------------------------------------------------------------------------------------------


def test_nothing_bounds_the_region_where_neither_domain_nor_limit_does() -> None:
    system = ql.DescriptorSystem.from_equations(
        ["x' = v", "v' = sin(x) + u"], state="x v", inputs="u", domain={"x": (-1, 1)}, name="half"
    )
    with pytest.raises(InputError, match=r"half: domain of v: got none, expected an interval"):
        design_feedback(RegionalRequest(system))


def test_no_feedback_is_said_to_exist_where_the_input_is_too_weak() -> None:
    system = ql.DescriptorSystem.from_equations(
        ["x' = 2*x + x^3 + u"], state="x", inputs="u", domain={"x": (-1, 1)}, name="weak"
    )
    strong = design_feedback(RegionalRequest(system, input_limits={"u": 10.0}, decay_rate=1.0))
    assert strong.extent[0] == pytest.approx(1.0, rel=0.02)
    # |u| <= 0.1 holds |x| < about 0.1 / 3: the region shrinks with the input and does not vanish.
    feeble = design_feedback(RegionalRequest(system, input_limits={"u": 0.1}, decay_rate=1.0))
    assert 0.02 < feeble.extent[0] < 0.1 / 3.0


@pytest.mark.parametrize(
    ("drift", "mode"), [("x", "at every point the mode 1"), ("x + x^2", "the mode 1"), ("x*u", "the mode 0")]
)
def test_where_no_input_reaches_a_mode_that_is_proved(drift: str, mode: str) -> None:
    unreachable = ql.DescriptorSystem.from_equations(
        [f"x' = {drift}", "v' = u"], state="x v", inputs="u", domain={"x": (-1, 1), "v": (-1, 1)}, name="unreachable"
    )
    with pytest.raises(InfeasibleError, match=rf"unreachable: no feedback has a decay of .*, proved: .*{mode} of x is"):
        release_system(RegionalRequest(unreachable, input_limits={"u": 1.0}))


def test_a_mode_that_no_input_reaches_is_in_the_way_of_a_faster_decay_only() -> None:
    slow = ql.DescriptorSystem.from_equations(
        ["x' = -x/100", "v' = u"], state="x v", inputs="u", domain={"x": (-1, 1), "v": (-1, 1)}, name="slow"
    )
    with pytest.raises(InfeasibleError, match=r"the mode -0\.01 of x"):
        release_system(RegionalRequest(slow, decay_rate=1.0))
    assert release_system(RegionalRequest(slow, decay_rate=0.005)).name


def test_a_rate_that_is_not_proved_is_refused_with_one_that_would_be() -> None:
    asked = replace(request_of("dc-bus"), rate_hz=200.0)
    with pytest.raises(ClaimError, match=r"dc-bus: 200 Hz is not proved; \d+ Hz would be \(--rate-hz\)"):
        release_system(asked)
    unproved = release_system(asked, allow_unproved_rate=True)
    assert unproved.sampling is None
    assert verify_system(unproved).verified  # what is left is so; nothing is claimed of the rate
