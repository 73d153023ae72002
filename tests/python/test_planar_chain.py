"""Planar arms by a chain certificate: the range of branch and bound, false bounds refused; five links and more."""

from __future__ import annotations

from copy import deepcopy
from functools import cache
from math import comb
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from quasilpv.certificate import gate, shipped
from quasilpv.certificate.robot.data import inertia_data
from quasilpv.certificate.robot.planar_chain import PlanarChain, PlanarWitness
from quasilpv.certificate.robot.range import InertiaPair, needed_range
from quasilpv.errors import InputError
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import track
from quasilpv.release import checked_artifact, to_artifact
from quasilpv.scenarios import TrackingExperiment
from quasilpv.synthesis import DesignRequest, synthesise
from quasilpv.synthesis.acceleration import planar_range
from quasilpv.systems.robots.arm_parameters import ActuatorLimits, Link, OperatingDomain, PayloadSet
from quasilpv.systems.robots.arms import PlanarSerialArm
from quasilpv.systems.robots.registry import Robot, robot
from quasilpv.trajectories import Trajectory


@cache
def content(name: str = "arm3") -> dict[str, Any]:
    """An artifact of a planar arm, with the chain of its inertia in its witness."""
    source, made = robot(name), synthesise(DesignRequest.of(name))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(planar_range, "FEWEST_JOINTS", 2)
        chain = planar_range.planar_chain_witness(source, float(made.report["inertia_scale"]))
    document = dict(to_artifact(made).content())
    return {**document, "witness": {**document["witness"], **chain}}


def changed(*path: str | int, value: Any) -> dict[str, Any]:
    document = deepcopy(content())
    place: Any = document
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return document


def test_the_chain_and_branch_and_bound_prove_the_same_range() -> None:
    """Two proofs without a line in common; both are at most 1 % from what occurs."""
    document = content()
    by_chain = gate(document)
    searched = needed_range(InertiaPair(inertia_data(shipped(document))))
    assert searched is not None
    assert by_chain.passed
    lowest, highest = by_chain.needed.to_floats()
    other_lowest, other_highest = searched.to_floats()
    low, high = by_chain.sampled_range
    assert lowest < low < high < highest
    assert lowest == pytest.approx(other_lowest, rel=0.01)
    assert highest == pytest.approx(other_highest, rel=0.01)
    assert (low, high) == pytest.approx((searched.where_lowest.inertia_ratio, searched.where_highest.inertia_ratio))


def test_a_bound_that_samples_refute_is_refused() -> None:
    document = content()
    chain, witness = PlanarChain(inertia_data(shipped(document))), shipped(document).witness(PlanarWitness).chain
    assert witness is not None
    low, high = gate(document).sampled_range
    for side, true, false in (("lowest", low, 1.005 * low), ("highest", high, 0.995 * high)):
        own = getattr(witness, side)
        assert chain.prove(side, own).holds
        assert abs(own.bound / true - 1.0) < 0.02
        assert not chain.prove(side, own.model_copy(update={"bound": false})).holds


@pytest.mark.parametrize(
    "document",
    [
        changed("payloads", "mass_scale", value=[1.4, 1.4, 2.4]),
        changed("payloads", "com_scale", value=[1.4, 1.4, 2.4]),
        changed("robot", "parameters", "links", 2, "mass_kg", value=5.0),
    ],
    ids=["mass", "centre of mass", "link"],
)
def test_a_chain_of_another_robot_is_refused(document: dict[str, Any]) -> None:
    found = gate(document)
    assert found.needed is None
    assert not found.passed


def test_what_a_table_of_another_inertia_differs_by_is_paid_for() -> None:
    """Vertices off by 10^-3 of themselves: more than the spare of the bounds."""
    document = deepcopy(content())
    for block in document["law"]["inertia"]["blocks"]:
        for vertex in block["vertices"]:
            vertex[1][1] *= 0.97
    assert gate(document).needed is None


def test_storages_of_another_number_or_size_are_a_line() -> None:
    for change in (
        lambda s: s.pop(),
        lambda s: s[0].pop(),
        lambda s: s[0].__setitem__(1, np.eye(6).tolist()),
    ):
        document = deepcopy(content())
        change(document["witness"]["chain"]["lowest"]["storages"])
        with pytest.raises(InputError, match=r"witness\.chain"):
            gate(document)


@given(st.floats(0.0, 1.0))
def test_a_loaded_link_is_a_mean_of_its_bernstein_coefficients(fraction: float) -> None:
    arm = robot("arm3")
    bodies = planar_range._loaded_bodies(arm, arm.model)
    true = arm.with_payload_fraction(fraction)
    weights = [comb(3, j) * fraction**j * (1.0 - fraction) ** (3 - j) for j in range(4)]
    for k, link in enumerate(true.links):
        np.testing.assert_allclose(
            np.einsum("j,jab->ab", weights, bodies[:, k]), planar_range._in_plane(link), atol=1e-12
        )


def long_arm(joints: int) -> Robot:
    """Links that get shorter and lighter, a load of 80 % of the last one."""
    links = tuple(
        Link(length_m=L, mass_kg=m, com_m=0.5 * L, inertia_kg_m2=m * L**2 / 3.0)
        for L, m in ((0.4 - 0.03 * k, 5.0 - 0.5 * k) for k in range(joints))
    )
    return Robot(
        id=f"arm{joints}-long",
        summary="of the tests",
        model=PlanarSerialArm(f"arm{joints}-long", links),
        domain=OperatingDomain.symmetric(joints, angle_rad=0.6, speed_rad_s=2.0),
        limits=ActuatorLimits((300.0, 220.0, 150.0, 90.0, 50.0, 30.0, 15.0)[:joints], (1e6,) * joints),
        payloads=PayloadSet((1.0,) * (joints - 1) + (1.8,), (1.0,) * joints),
    )


@pytest.mark.full
@pytest.mark.parametrize("joints", [5, 6, 7])
def test_an_arm_of_many_links_is_released_and_follows_its_reference(joints: int, tmp_path: Any) -> None:
    source = long_arm(joints)
    artifact = checked_artifact(synthesise(DesignRequest.of(source)))
    found = artifact.verification["gate"]
    assert found["passed"]
    assert found["proved"]
    low, high = found["needed_range"]
    assert low > 0.98 * found["sampled_range"][0]
    assert high < 1.02 * found["sampled_range"][1]
    start = np.full(joints, 0.1)
    reference = Trajectory.through([start, -start, start], [0.0, 1.0, 2.0], name="swing")
    result = track(RunSetup(TrackingExperiment("swing", source, reference), artifact, log=False), tmp_path)
    assert result.metrics.share_at_limit == 0.0
    assert result.metrics.rms_tool_m < 1e-3


def test_a_short_arm_ships_no_chain() -> None:
    assert planar_range.planar_chain_witness(robot("arm3"), 1.0) == {}
