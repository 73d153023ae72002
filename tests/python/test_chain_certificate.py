"""The chain certificate: what it proves holds in sampled postures; what does not hold it refuses."""

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from flint import fmpq, fmpq_mat
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from quasilpv.certificate.exact.chain import ChainForm, ChainJoint, ChainProof, bernstein, prove_chain
from quasilpv.certificate.exact.matrices import matrix, rational
from quasilpv.certificate.exact.rationals import to_floats
from quasilpv.synthesis.chain_storages import InertiaPairing, Side, Storages, find_storages
from quasilpv.systems.robots.tree import JointKind, KinematicTree
from reference.random_trees import coordinates, random_body, random_tree

seeds = st.integers(0, 2**32 - 1)


def pairing(empty: KinematicTree, loads: list, side: Side) -> InertiaPairing:
    """The empty robot as design inertia; of the true ones, those that matter for the side."""
    design = np.array([joint.inertia.matrix for joint in empty.joints])
    true = [body[None] for body in design]
    if side == "highest":
        true[-1] = np.array([empty.carrying(load).joints[-1].inertia.matrix for load in loads])
    return InertiaPairing(empty, design, empty.rotor_inertias, true, empty.rotor_inertias)


def prove(pair: InertiaPairing, side: Side, bound: float, storages: Storages) -> ChainProof:
    """The exact check of a bound with the storages found for another one."""
    sign, c = (1 if side == "highest" else -1), rational(bound)
    bodies = [
        [(matrix(design.tolist()) * c - matrix(body.tolist())) * sign for body in true]
        for design, true in zip(pair.design, pair.true, strict=True)
    ]
    rotors = [(rational(d) * c - rational(t)) * sign for d, t in zip(pair.design_rotors, pair.true_rotors, strict=True)]
    joints = [
        ChainJoint(j.turns, j.placement.rotation, j.placement.translation_m, j.axis, j.lower, j.upper)
        for j in pair.tree.joints
    ]
    return prove_chain(joints, ChainForm(bodies, rotors), [matrix(Z.tolist()) for Z in storages.matrices])


def extreme_ratio(empty: KinematicTree, true: list[KinematicTree], side: Side, seed: int) -> float:
    """Of ``M_n^-1 M_t`` in sampled postures."""
    postures = coordinates(empty, np.random.default_rng(seed), 2000)
    factor = np.linalg.inv(np.linalg.cholesky(empty.inertia(postures)))
    ratios = [np.linalg.eigvalsh(factor @ t.inertia(postures) @ factor.transpose(0, 2, 1)) for t in true]
    return float(np.max(ratios) if side == "highest" else np.min(ratios))


@given(seeds, st.integers(2, 5))
@settings(max_examples=8)
def test_a_proved_bound_holds_in_every_sampled_posture_and_a_smaller_one_is_refused(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    empty, load = random_tree(rng, n), random_body(rng)
    pair = pairing(empty, [load], "highest")
    found = find_storages(pair, "highest")
    assert found is not None

    sampled = extreme_ratio(empty, [empty.carrying(load)], "highest", seed)

    assert prove(pair, "highest", found.bound, found).holds
    assert found.bound > sampled
    assert not prove(pair, "highest", 0.995 * sampled, found).holds


def test_both_sides_of_a_robot_with_a_set_of_payloads_are_proved_close_to_what_occurs() -> None:
    rng = np.random.default_rng(7)
    design = random_tree(rng, 6, sliding=0.0)
    body = random_body(rng, 0.1)
    loads = [body.scaled(f) for f in (0.3, 1.0)]
    lighter = design.scaled(0.8, 0.9)

    upper_pair = pairing(design, loads, "highest")
    lower_pair = InertiaPairing(
        design,
        upper_pair.design,
        upper_pair.design_rotors,
        [j.inertia.matrix[None] for j in lighter.joints],
        lighter.rotor_inertias,
    )
    for side, pair, true in (
        ("highest", upper_pair, [design.carrying(load) for load in loads]),
        ("lowest", lower_pair, [lighter]),
    ):
        found = find_storages(pair, side)
        assert found is not None
        sampled = extreme_ratio(design, true, side, 1)
        assert prove(pair, side, found.bound, found).holds
        assert abs(found.bound / sampled - 1.0) < 0.04
        assert (found.bound > sampled) == (side == "highest")


def test_an_arm_of_one_joint_needs_no_storage() -> None:
    tree = random_tree(np.random.default_rng(3), 1)
    load = random_body(np.random.default_rng(4))
    pair = pairing(tree, [load], "highest")
    S = tree.joints[0].twist
    ratio = (S @ pair.true[0][0] @ S + tree.rotor_inertias[0]) / (S @ pair.design[0] @ S + tree.rotor_inertias[0])
    none = Storages(0.0, (), 0.0, 0)

    assert prove(pair, "highest", float(ratio) * (1 + 1e-12), none).holds
    assert not prove(pair, "highest", float(ratio) * (1 - 1e-12), none).holds


@pytest.mark.parametrize("joint", [1, 2])
def test_storages_that_are_not_symmetric_or_changed_are_refused(joint: int) -> None:
    rng = np.random.default_rng(11)
    tree, load = random_tree(rng, 4), random_body(rng)
    pair = pairing(tree, [load], "highest")
    found = find_storages(pair, "highest")
    assert found is not None
    assert prove(pair, "highest", found.bound, found).holds

    for change in (np.triu(np.ones((6, 6)), 1), 10.0 * np.eye(6), -10.0 * np.eye(6)):
        changed = list(found.matrices)
        changed[joint] = changed[joint] + change * np.abs(changed[joint]).max()
        assert not prove(pair, "highest", found.bound, replace(found, matrices=tuple(changed))).holds


def test_the_interval_of_a_joint_matters_and_a_continuous_joint_is_a_full_circle() -> None:
    """A long load behind a short arm: its ratio is largest stretched out, which small limits exclude."""
    rng = np.random.default_rng(5)
    tree = random_tree(rng, 3, sliding=0.0)
    load = random_body(rng)
    narrow = replace(tree, joints=tuple(replace(j, lower=-0.1, upper=0.1) for j in tree.joints))
    free = replace(tree, joints=tuple(replace(j, kind=JointKind.CONTINUOUS) for j in tree.joints))
    bounds = {}
    for name, robot in (("narrow", narrow), ("free", free)):
        pair = pairing(robot, [load], "highest")
        found = find_storages(pair, "highest")
        assert found is not None
        assert prove(pair, "highest", found.bound, found).holds
        bounds[name] = pair, found

    assert bounds["narrow"][1].bound < bounds["free"][1].bound
    pair, found = bounds["narrow"]
    on_free = replace(pair, tree=free)
    assert not prove(on_free, "highest", found.bound, found).holds


@pytest.mark.parametrize("limits", [(-3.0, 3.0), (-0.1, 0.2), (1.5, 1.65), (-9.0, -5.0), (3.1, 3.2), (-1.6, 1.6)])
def test_charts_are_the_motion_of_the_joint_and_cover_its_limits(limits: tuple[float, float]) -> None:
    joint = replace(random_tree(np.random.default_rng(2), 1, sliding=0.0).joints[0], lower=limits[0], upper=limits[1])
    exact = ChainJoint(True, joint.placement.rotation, joint.placement.translation_m, joint.axis, *limits)
    covered = []
    for chart in exact.charts():
        for share in np.linspace(0, 1, 5):
            t = chart.low + (chart.high - chart.low) * rational(share)
            weight = sum((w * t**i for i, w in enumerate(chart.weight)), fmpq(0))
            X = sum((M * t**i for i, M in enumerate(chart.motion)), fmpq_mat(6, 6)) * (1 / weight)
            assert_allclose(to_floats(X), joint.motion_matrices(np.array(chart.coordinate(t))), atol=1e-12)
        covered.append((chart.coordinate(chart.low), chart.coordinate(chart.high)))
    covered.sort()
    assert covered[0][0] <= limits[0] + 1e-15
    assert covered[-1][1] >= limits[1] - 1e-15
    assert covered[-1][1] - covered[0][0] < limits[1] - limits[0] + 1e-10
    assert all(after[0] <= before[1] + 1e-15 for before, after in pairwise(covered))


@given(seeds, st.integers(1, 4))
def test_bernstein_coefficients_reproduce_the_polynomial(seed: int, degree: int) -> None:
    rng = np.random.default_rng(seed)
    entry = tuple(matrix(rng.normal(size=(2, 2)).tolist()) for _ in range(degree + 1))
    low, high = sorted(rational(x) for x in rng.normal(size=2))
    coefficients = bernstein(entry, low, high)
    s = rational(rng.uniform())
    t = low + (high - low) * s
    binomials = [fmpq(int(np.prod([(degree - i) / (i + 1) for i in range(k)]) + 0.5)) for k in range(degree + 1)]

    direct = sum((G * t**i for i, G in enumerate(entry)), fmpq_mat(2, 2))
    blended = sum(
        (B * (binomials[k] * s**k * (1 - s) ** (degree - k)) for k, B in enumerate(coefficients)), fmpq_mat(2, 2)
    )

    assert direct == blended


def test_parts_that_do_not_belong_together_are_refused() -> None:
    with pytest.raises(ValueError, match="do not belong together"):
        prove_chain([], ChainForm([], []), [fmpq_mat(1, 1)])


def test_a_corner_of_a_box_of_payloads_covers_what_is_inside() -> None:
    """Kinetic energy is convex in the place of the centre of mass: the corners bound every load in the box."""
    rng = np.random.default_rng(9)
    tree, load = random_tree(rng, 4, sliding=0.0), random_body(rng, 0.05)
    shifted = [
        load.seen_from(replace(tree.tool, rotation=np.eye(3), translation_m=0.1 * np.array(corner)))
        for corner in product((-1, 1), repeat=3)
    ]
    pair = pairing(tree, shifted, "highest")
    found = find_storages(pair, "highest")
    assert found is not None
    assert prove(pair, "highest", found.bound, found).holds
    inside = [
        load.seen_from(replace(tree.tool, rotation=np.eye(3), translation_m=rng.uniform(-0.1, 0.1, 3)))
        for _ in range(20)
    ]
    assert extreme_ratio(tree, [tree.carrying(body) for body in inside], "highest", 2) < found.bound
