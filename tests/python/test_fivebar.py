"""The five-bar linkage against a symbolic Lagrangian and Pinocchio's constrained dynamics; reduction, kinematics."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import sympy as sp
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from quasilpv.errors import InputError
from quasilpv.synthesis.baselines.printed import printed_bandwidth_rad_s
from quasilpv.systems.robots.arm_parameters import Link
from quasilpv.systems.robots.fivebar import RhombicFiveBar
from quasilpv.systems.robots.fivebar_linkage import FiveBarLinkage
from quasilpv.systems.robots.registry import fivebar, robot

Array = NDArray[np.float64]

ROBOT = robot("fivebar")
RHOMBUS = ROBOT.model
UNEQUAL = replace(fivebar(), passive=Link(0.2, 0.0825, 0.07, 0.0007))


@st.composite
def links(draw: st.DrawFn, length: float | None = None, friction: float = 0.0) -> Link:
    length = length or draw(st.floats(0.1, 1.0))
    mass = draw(st.floats(0.05, 5.0))
    com, radius = draw(st.floats(-0.3, 1.1)) * length, draw(st.floats(0.1, 0.5)) * length
    return Link(length, mass, com, mass * (com**2 + radius**2), friction)


@st.composite
def linkages(draw: st.DrawFn, ratio: tuple[float, float] = (0.7, 1.5)) -> FiveBarLinkage:
    active = draw(links(friction=draw(st.floats(0.0, 0.5))))
    passive = draw(links(length=active.length_m * draw(st.floats(*ratio))))
    return FiveBarLinkage("drawn", active, passive, assembly=draw(st.sampled_from(["+", "-"])))


@st.composite
def assembled(draw: st.DrawFn, ratio: tuple[float, float] = (0.7, 1.5)) -> tuple[FiveBarLinkage, Array, Array]:
    """A linkage at a regular configuration of its assembly, in motion."""
    linkage = draw(linkages(ratio))
    middle, half = draw(st.floats(-1.5, 1.5)), draw(st.floats(0.2, 1.3))
    assume(linkage.active.length_m * np.sin(half) < 0.95 * linkage.passive.length_m)
    theta = middle + np.array([-half, half]) * (1 if linkage.assembly == "+" else -1)
    assume(linkage.singularity(theta)[1] > 0.15)
    return linkage, theta, np.array([draw(st.floats(-5, 5)), draw(st.floats(-5, 5))])


# ---- two independent derivations -------------------------------------------------------------------------------------


@cache
def lagrangian_forces() -> Any:
    """Of the open chains: d/dt dL/dphi' - dL/dphi from the velocities of four centres of mass, as a function."""
    t, g = sp.Symbol("t"), sp.Symbol("g")
    phi = [sp.Function(f"phi{k}")(t) for k in range(4)]
    a, ma, ra, Ia, mb, rb, Ib = parameters = sp.symbols("a ma ra Ia mb rb Ib", positive=True)

    def towards(angle: sp.Expr) -> sp.Matrix:
        return sp.Matrix([sp.sin(angle), -sp.cos(angle)])

    lagrangian = sp.S.Zero
    for theta, q in ((phi[0], phi[2]), (phi[1], phi[3])):
        bodies = ((ma, Ia, theta, ra * towards(theta)), (mb, Ib, q, a * towards(theta) + rb * towards(q)))
        for mass, com_inertia, angle, centre in bodies:
            velocity = centre.diff(t)
            lagrangian += (
                mass * velocity.dot(velocity) / 2 + com_inertia * angle.diff(t) ** 2 / 2 - mass * g * centre[1]
            )
    forces = [sp.diff(lagrangian, x.diff(t)).diff(t) - sp.diff(lagrangian, x) for x in phi]
    plain = [sp.symbols(f"{name}0:4") for name in ("x", "v", "w")]
    for x, angle, speed, acceleration in zip(phi, *plain, strict=True):
        forces = [f.subs(x.diff(t, 2), acceleration).subs(x.diff(t), speed).subs(x, angle) for f in forces]
    return sp.lambdify([*plain, parameters, g], forces, "numpy", cse=True)


@given(assembled())
def test_open_chains_move_as_the_lagrangian_says(case: tuple[FiveBarLinkage, Array, Array]) -> None:
    linkage, *_ = case
    rng = np.random.default_rng(1)
    phi, rate, acceleration = rng.uniform(-3, 3, (3, 4))
    a, b = linkage.active, linkage.passive
    numbers = (a.length_m, a.mass_kg, a.com_m, a.com_inertia_kg_m2, b.mass_kg, b.com_m, b.com_inertia_kg_m2)
    expected = np.array(lagrangian_forces()(phi, rate, acceleration, numbers, linkage.gravity_m_s2))
    friction = np.array([*(a.friction_nm_s * rate[:2]), 0.0, 0.0])
    ours = linkage.mass_matrix(phi) @ acceleration + linkage.speed_torque(phi, rate) + linkage.gravity_torque(phi)
    assert_allclose(ours - friction, expected, atol=1e-12 * (1 + np.abs(ours).max()))


def pinocchio_linkage(linkage: FiveBarLinkage) -> tuple[pin.Model, pin.RigidConstraintModel]:
    """Two chains of two joints about Z, links along -Y at rest, whose ends are held together."""
    down = np.array([0.0, -1.0, 0.0])
    model = pin.Model()
    model.gravity.linear = linkage.gravity_m_s2 * down
    tips = []
    for chain in "12":
        joint, offset = 0, np.zeros(3)
        for kind, link in (("active", linkage.active), ("passive", linkage.passive)):
            place = pin.SE3(np.eye(3), offset)
            joint = model.addJoint(joint, pin.JointModelRZ(), place, f"{kind}{chain}")
            inertia = pin.Inertia(link.mass_kg, link.com_m * down, np.diag([0.0, 0.0, link.com_inertia_kg_m2]))
            model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
            offset = link.length_m * down
        tips.append((joint, pin.SE3(np.eye(3), offset)))
    closure = pin.RigidConstraintModel(
        pin.ContactType.CONTACT_3D, model, *tips[0], *tips[1], pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    )
    return model, closure


@given(assembled(), st.floats(-3, 3), st.floats(-3, 3))
def test_closed_linkage_moves_as_pinocchio_says(
    case: tuple[FiveBarLinkage, Array, Array], torque_1: float, torque_2: float
) -> None:
    linkage, theta, omega = case
    phi = linkage.coordinates(theta)
    rate = linkage.velocity_map(phi) @ omega
    friction = linkage.active.friction_nm_s * omega
    torque = np.array([torque_1, torque_2])
    model, closure = pinocchio_linkage(linkage)
    data, closures, closure_data = (
        model.createData(),
        pin.StdVec_RigidConstraintModel(),
        pin.StdVec_RigidConstraintData(),
    )
    closures.append(closure)
    closure_data.append(closure.createData())
    to_relative = np.array([[1, 0, 0, 0], [-1, 0, 1, 0], [0, 1, 0, 0], [0, -1, 0, 1]])  # joints chain by chain
    applied = np.array([torque[0] - friction[0], 0.0, torque[1] - friction[1], 0.0])
    pin.initConstraintDynamics(model, data, closures, closure_data)
    settings = pin.ProximalSettings(1e-14, 1e-10, 200)
    relative = pin.constraintDynamics(
        model, data, to_relative @ phi, to_relative @ rate, applied, closures, closure_data, settings
    )
    expected = np.linalg.solve(to_relative, relative)
    scale = np.abs(expected).max() + np.abs(rate).max() ** 2
    acceleration, multipliers = linkage.constrained_dynamics(phi, rate, torque)
    assert_allclose(acceleration, expected, atol=1e-10 * scale)
    M, bias, G = linkage.reduced_dynamics(theta, omega)
    assert_allclose(np.linalg.solve(M, torque - bias - G), expected[:2], atol=1e-10 * scale)
    load = linkage.mass_matrix(phi) @ acceleration + linkage.speed_torque(phi, rate) + linkage.gravity_torque(phi)
    balance = load - linkage.closure_jacobian(phi).T @ multipliers - np.concatenate([torque, [0.0, 0.0]])
    assert_allclose(balance, 0.0, atol=1e-9 * (1 + np.abs(load).max()))


# ---- the constraint and its derivatives ------------------------------------------------------------------------------


@given(assembled())
def test_closure_jacobian_and_drift_are_derivatives_of_the_closure(case: tuple[FiveBarLinkage, Array, Array]) -> None:
    linkage, theta, omega = case
    phi = linkage.coordinates(theta)
    rate, step = linkage.velocity_map(phi) @ omega, 1e-6
    ahead, behind = phi + step * rate, phi - step * rate
    along = (linkage.closure(ahead) - linkage.closure(behind)) / (2 * step)
    assert_allclose(linkage.closure_jacobian(phi) @ rate, along, atol=1e-7)
    turned = (linkage.closure_jacobian(ahead) - linkage.closure_jacobian(behind)) @ rate / (2 * step)
    assert_allclose(linkage.closure_drift(phi, rate), turned, atol=1e-6 * (1 + np.abs(turned).max()))


@given(assembled())
def test_assembled_linkage_is_closed_and_stays_closed(case: tuple[FiveBarLinkage, Array, Array]) -> None:
    linkage, theta, omega = case
    phi = linkage.coordinates(theta)
    assert_allclose(linkage.closure(phi), 0.0, atol=1e-13)
    T = linkage.velocity_map(phi)
    rate = T @ omega
    assert_allclose(linkage.closure_jacobian(phi) @ rate, 0.0, atol=1e-11 * (1 + np.abs(rate).max()))
    acceleration = T @ np.array([1.0, -2.0]) + linkage.acceleration_drift(phi, rate)
    opened = linkage.closure_jacobian(phi) @ acceleration + linkage.closure_drift(phi, rate)
    assert_allclose(opened, 0.0, atol=1e-10 * (1 + np.abs(acceleration).max()))


def test_when_the_elbows_are_too_far_apart_expect_the_distance() -> None:
    short = replace(fivebar(), passive=Link(0.1, 0.0825, 0.05, 0.0007))
    with pytest.raises(InputError, match=r"0\.2777 m between the elbows, expected at most 0\.2 m"):
        short.passive_angles([-1.0, 1.0])


# ---- kinematics ------------------------------------------------------------------------------------------------------


@given(linkages(), st.floats(0.05, 0.95), st.floats(-3.0, 3.0))
def test_inverse_kinematics_returns_to_the_tool_position_in_the_chosen_assembly(
    linkage: FiveBarLinkage, share: float, direction: float
) -> None:
    a, b = linkage.active.length_m, linkage.passive.length_m
    nearest = max(abs(a - b), np.sqrt(abs(a**2 - b**2)))  # nearer than that the tool is between motors and elbows
    distance = nearest + share * (a + b - nearest)
    position = distance * np.array([np.sin(direction), -np.cos(direction)])
    theta = linkage.driven_angles(position)
    assert (theta[0] < theta[1]) == (linkage.assembly == "+")
    assert_allclose(linkage.tool_position(theta), position, atol=1e-9 * (a + b))
    assert_allclose(linkage.closure(linkage.coordinates(theta)), 0.0, atol=1e-12)


@pytest.mark.parametrize("distance", [0.0, 0.33, 0.4])
def test_when_the_tool_is_out_of_reach_expect_the_workspace(distance: float) -> None:
    with pytest.raises(InputError, match=r"a distance strictly between 0 and 0\.33 m"):
        RHOMBUS.inverse_kinematics([distance, 0.0])


@given(assembled())
def test_tool_jacobian_and_drift_are_derivatives_of_the_tool_position(
    case: tuple[FiveBarLinkage, Array, Array],
) -> None:
    linkage, theta, omega = case
    step = 1e-6
    columns = [
        (linkage.tool_position(theta + step * unit) - linkage.tool_position(theta - step * unit)) / (2 * step)
        for unit in np.eye(2)
    ]
    J = linkage.tool_jacobian(theta)
    assert_allclose(J, np.array(columns).T, atol=1e-6 * (1 + np.abs(J).max()))
    turned = linkage.tool_jacobian(theta + step * omega) - linkage.tool_jacobian(theta - step * omega)
    expected = turned @ omega / (2 * step)
    assert_allclose(linkage.tool_drift(theta, omega), expected, atol=1e-5 * (1 + np.abs(expected).max()))


@given(st.floats(-1.0, 1.0), st.floats(0.05, 3.0))
def test_singularity_of_the_rhombus_is_the_sine_between_its_active_links(middle: float, difference: float) -> None:
    theta = middle + np.array([-difference, difference]) / 2
    assert RHOMBUS.singularity(theta)[1] == pytest.approx(abs(np.sin(difference)), abs=1e-12)
    expected = RHOMBUS.linkage.active.length_m**2 * np.sin(difference)
    assert abs(np.linalg.det(RHOMBUS.jacobian(theta))) == pytest.approx(abs(expected), abs=1e-12)


# ---- the rhombus -----------------------------------------------------------------------------------------------------


@given(assembled(ratio=(1.0, 1.0)))
def test_when_links_are_equal_expect_the_closed_form_of_the_general_reduction(
    case: tuple[FiveBarLinkage, Array, Array],
) -> None:
    linkage, theta, omega = case
    linkage = replace(linkage, passive=replace(linkage.passive, length_m=linkage.active.length_m))
    rhombus = RhombicFiveBar(linkage)
    M, bias, G = linkage.reduced_dynamics(theta, omega)
    assert_allclose(linkage.passive_angles(theta), theta[::-1], atol=1e-14)
    scale = np.abs(M).max()
    assert_allclose(rhombus.inertia(theta), M, atol=1e-11 * scale)
    assert_allclose(rhombus.coriolis(theta, omega), bias, atol=1e-10 * scale * (1 + omega @ omega) + 1e-12)
    assert_allclose(rhombus.gravity(theta), G, atol=1e-11 * np.abs(rhombus.gravity_constants).max())
    assert rhombus.driven_inertia == pytest.approx(np.diag(linkage.mass_matrix(linkage.coordinates(theta)))[:2])


def test_gravity_torque_is_the_gravity_stiffness_times_the_angles() -> None:
    theta = np.array([-0.7, 0.9])
    assert_allclose(RHOMBUS.gravity_stiffness(theta) @ theta, RHOMBUS.gravity(theta), rtol=1e-14)


def test_when_links_differ_in_length_expect_no_rhombus() -> None:
    with pytest.raises(InputError, match=r"0\.165 and 0\.2 m, expected equal lengths"):
        RhombicFiveBar(UNEQUAL)


def test_when_nothing_dissipates_expect_constant_energy() -> None:
    start = np.array([-0.7, 0.8, 2.0, -1.0])

    def rate(_: float, state: Array) -> Array:
        return np.concatenate([state[2:], RHOMBUS.forward_dynamics(state[:2], state[2:], np.zeros(2))])

    end = solve_ivp(rate, (0.0, 0.05), start, rtol=1e-11, atol=1e-12).y[:, -1]
    assert np.abs(end - start).max() > 0.05
    assert RHOMBUS.energy(end[:2], end[2:]) == pytest.approx(RHOMBUS.energy(start[:2], start[2:]), abs=1e-11)


@given(assembled(), st.floats(-20, 20), st.floats(-20, 20))
def test_parallel_computed_torque_with_passive_joints_is_computed_torque_on_the_reduced_model(
    case: tuple[FiveBarLinkage, Array, Array], command_1: float, command_2: float
) -> None:
    """(IV.78), the sign of N_b corrected: J = [J_a, -J_b], passive speeds J_b^-1 J_a theta'."""
    linkage, theta, omega = case
    phi = linkage.coordinates(theta)
    J, M, G = linkage.closure_jacobian(phi), linkage.mass_matrix(phi), linkage.gravity_torque(phi)
    J_a, J_b = J[:, :2], -J[:, 2:]
    passive = np.linalg.solve(J_b, J_a @ omega)
    rate = np.concatenate([omega, passive])
    command = np.array([command_1, command_2])
    passive_command = np.linalg.solve(J_b, J_a @ command + linkage.closure_drift(phi, rate))
    N = linkage.speed_torque(phi, rate)
    own = M[:2, :2] @ command + M[:2, 2:] @ passive_command + N[:2] + G[:2]
    carried = M[2:, :2] @ command + M[2:, 2:] @ passive_command + N[2:] + G[2:]
    expected = own + J_a.T @ np.linalg.solve(J_b.T, carried)
    reduced, bias, gravity = linkage.reduced_dynamics(theta, omega)
    assert_allclose(reduced @ command + bias + gravity, expected, atol=1e-11 * (1 + np.abs(expected).max()))


# ---- parameters ------------------------------------------------------------------------------------------------------


def test_when_the_gains_of_the_thesis_are_rebuilt_expect_the_printed_ones_but_for_truncated_inertias() -> None:
    w = printed_bandwidth_rad_s(ROBOT)
    printed = np.array([634.71, 2.5254, 5.3173e4])
    ours = RHOMBUS.driven_inertia[0] * np.array([3 * w**2, 3 * w, w**3])
    assert ours == pytest.approx(printed, rel=2e-3)
    assert [3 * w**2, 3 * w, w**3] == pytest.approx([18.95e4, 753.9822, 1587.5e4], rel=1e-4)
    a, b = RHOMBUS.linkage.active, RHOMBUS.linkage.passive
    about_com = a.inertia_kg_m2 + a.mass_kg * a.com_m**2 + b.mass_kg * a.length_m**2
    assert about_com * 3 * w**2 > 1.15 * printed[0]  # the printed formula of c_4


def test_when_the_payload_is_carried_expect_inertias_about_the_centres_of_mass_unchanged() -> None:
    loaded = ROBOT.with_payload_fraction(1.0)
    assert isinstance(loaded, RhombicFiveBar)
    for before, after, factor in (
        (RHOMBUS.linkage.active, loaded.linkage.active, 1.4),
        (RHOMBUS.linkage.passive, loaded.linkage.passive, 2.2),
    ):
        assert after.mass_kg == pytest.approx(factor * before.mass_kg)
        assert after.com_m == before.com_m
        assert after.com_inertia_kg_m2 == pytest.approx(before.com_inertia_kg_m2)


def test_when_joint_inertias_did_not_follow_the_payload_expect_no_rigid_body() -> None:
    passive = RHOMBUS.linkage.passive
    with pytest.raises(InputError, match="inertia_kg_m2"):
        replace(passive, mass_kg=2.2 * passive.mass_kg)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"gravity_m_s2": -1.0}, "gravity_m_s2"),
        ({"assembly": "x"}, "assembly"),
        ({"passive": Link(0.165, 0.0825, 0.0825, 0.0007, 0.1)}, "friction_nm_s"),
    ],
)
def test_when_a_linkage_is_not_well_defined_expect_the_field(change: dict[str, Any], field: str) -> None:
    with pytest.raises(InputError, match=field):
        replace(fivebar(), **change)


def test_when_a_payload_has_not_two_factors_expect_it_refused() -> None:
    with pytest.raises(InputError, match="com_scale: got 3 factors, expected 2"):
        RHOMBUS.perturbed([1.0, 1.0], [1.0, 1.0, 1.0])


def test_when_the_other_assembly_is_simulated_expect_it_refused() -> None:
    assert RHOMBUS.plant_document("nominal")["kind"] == "five-bar"
    with pytest.raises(InputError, match="assembly"):
        replace(fivebar(), assembly="-").plant_document("nominal")
