"""The planar serial arm against a symbolic Lagrangian and Pinocchio, both independent of it; and its invariants."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from quasilpv.errors import InputError
from quasilpv.systems.robots.arm_parameters import Link, OperatingDomain, PayloadSet
from quasilpv.systems.robots.arms import PlanarSerialArm
from quasilpv.systems.robots.printed_arms import PrintedSerialArm
from quasilpv.systems.robots.registry import arm2, arm3, robot

ARM2, ARM3 = arm2(), arm3()
NAMED = [ARM2, ARM3, replace(ARM2, equilibrium="upright"), ARM3.skew]
names = pytest.mark.parametrize("arm", NAMED, ids=["arm2", "arm3", "arm2-upright", "arm3-christoffel"])


def truncated_arm3() -> PrintedSerialArm:
    """The 3-DoF arm with r_2 as printed."""
    first, second, third = ARM3.links
    return replace(ARM3, links=(first, replace(second, com_m=0.489), third))


@st.composite
def links(draw: st.DrawFn) -> Link:
    length, mass = draw(st.floats(0.2, 2.0)), draw(st.floats(0.1, 20.0))
    com, radius = draw(st.floats(-0.5, 1.2)) * length, draw(st.floats(0.1, 0.5)) * length
    return Link(length, mass, com, mass * (com**2 + radius**2), draw(st.floats(0.0, 10.0)))


@st.composite
def arms_in_motion(draw: st.DrawFn) -> tuple[PlanarSerialArm, NDArray[np.float64], NDArray[np.float64]]:
    n = draw(st.integers(1, 5))
    arm = PlanarSerialArm(
        "drawn", tuple(draw(links()) for _ in range(n)), equilibrium=draw(st.sampled_from(["hanging", "upright"]))
    )
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return arm, rng.uniform(-np.pi, np.pi, n), rng.uniform(-5, 5, n)


def random_state(arm: PlanarSerialArm, rng: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return rng.uniform(-np.pi, np.pi, arm.joints), rng.uniform(-5, 5, arm.joints)


# ---- two independent derivations -------------------------------------------------------------------------------------


@cache
def lagrangian_inverse_dynamics(n: int) -> tuple[list[sp.Symbol], sp.Function]:
    """Torque of n point-mass-plus-inertia links from d/dt dL/dw - dL/dq, hanging, as a function of symbols."""
    t = sp.Symbol("t")
    q = [sp.Function(f"q{k}")(t) for k in range(n)]
    L, m, r, Ic = (sp.symbols(f"{name}0:{n}", positive=True) for name in ("L", "m", "r", "Ic"))
    g = sp.Symbol("g")
    kinetic, potential, joint = sp.S.Zero, sp.S.Zero, sp.Matrix([0, 0])
    for k in range(n):
        alpha = sum(q[: k + 1])
        along = sp.Matrix([sp.sin(alpha), -sp.cos(alpha)])
        centre = joint + r[k] * along
        velocity = centre.diff(t)
        kinetic += m[k] * velocity.dot(velocity) / 2 + Ic[k] * sp.diff(alpha, t) ** 2 / 2
        potential += m[k] * g * centre[1]
        joint += L[k] * along
    lagrangian = kinetic - potential
    torque = [sp.diff(lagrangian, v.diff(t)).diff(t) - sp.diff(lagrangian, v) for v in q]
    plain = [sp.symbols(f"{name}0:{n}") for name in ("q", "w", "a")]
    substitution = {}
    for v, angle, speed, acceleration in zip(q, *plain, strict=True):
        substitution |= {v.diff(t, 2): acceleration, v.diff(t): speed, v: angle}
    torque = [entry.subs(substitution) for entry in torque]
    arguments = [*plain, L, m, r, Ic, g]
    return sp.lambdify(arguments, torque, "numpy", cse=True)


def pinocchio_model(arm: PlanarSerialArm) -> pin.Model:
    """Joints about Z, links along -Y at rest (+Y when upright), gravity along -Y; the last frame is the tool."""
    down = np.array([0.0, -1.0, 0.0]) * arm.equilibrium_sign
    model, joint, offset = pin.Model(), 0, np.zeros(3)
    model.gravity.linear = np.array([0.0, -arm.gravity_m_s2, 0.0])
    for k, link in enumerate(arm.links):
        joint = model.addJoint(joint, pin.JointModelRZ(), pin.SE3(np.eye(3), offset), f"joint{k + 1}")
        inertia = np.diag([0.0, 0.0, link.inertia_kg_m2 - link.mass_kg * link.com_m**2])
        model.appendBodyToJoint(joint, pin.Inertia(link.mass_kg, link.com_m * down, inertia), pin.SE3.Identity())
        offset = link.length_m * down
    model.addFrame(pin.Frame("tool", joint, 0, pin.SE3(np.eye(3), offset), pin.FrameType.OP_FRAME))
    return model


@pytest.mark.parametrize("arm", [PlanarSerialArm("arm1", ARM3.links[:1]), ARM2, ARM3], ids=lambda arm: arm.name)
def test_inverse_dynamics_is_that_of_the_lagrangian(arm: PlanarSerialArm) -> None:
    inverse_dynamics = lagrangian_inverse_dynamics(arm.joints)
    com_inertia = [link.inertia_kg_m2 - link.mass_kg * link.com_m**2 for link in arm.links]
    lengths, masses, coms = zip(*[(link.length_m, link.mass_kg, link.com_m) for link in arm.links], strict=True)
    rng = np.random.default_rng(1)
    for _ in range(200):
        theta, omega = random_state(arm, rng)
        acceleration = rng.uniform(-20, 20, arm.joints)
        expected = inverse_dynamics(theta, omega, acceleration, lengths, masses, coms, com_inertia, arm.gravity_m_s2)
        assert_allclose(arm.inverse_dynamics(theta, omega, acceleration), expected, atol=1e-8)  # torques reach 1e4 N m


@given(arms_in_motion())
def test_dynamics_and_kinematics_are_those_of_pinocchio(case: tuple) -> None:
    arm, theta, omega = case
    model = pinocchio_model(arm)
    data = model.createData()
    M = np.array(pin.crba(model, data, theta))
    M = np.triu(M) + np.triu(M, 1).T
    scale = np.abs(M).max()
    assert_allclose(arm.inertia(theta), M, rtol=0, atol=1e-12 * scale)
    G = pin.computeGeneralizedGravity(model, data, theta)
    weight = arm.gravity_m_s2 * sum(link.mass_kg for link in arm.links)
    assert_allclose(arm.gravity(theta), G, rtol=0, atol=1e-13 * weight * arm.length_m.sum())
    velocity_torque = pin.rnea(model, data, theta, omega, np.zeros(arm.joints)) - G
    friction = arm.friction_nm_s * omega
    assert_allclose(arm.coriolis(theta, omega) - friction, velocity_torque, atol=1e-10 * scale * (1 + omega @ omega))

    tool = model.getFrameId("tool")
    pin.forwardKinematics(model, data, theta, omega, np.zeros(arm.joints))
    pin.updateFramePlacements(model, data)
    X, Y, Phi = arm.forward_kinematics(theta)
    assert_allclose([X, Y], data.oMf[tool].translation[:2], atol=1e-13)
    assert_allclose(np.exp(1j * Phi), data.oMf[tool].rotation[0, 0] + 1j * data.oMf[tool].rotation[1, 0], atol=1e-13)
    J = pin.computeFrameJacobian(model, data, theta, tool, pin.LOCAL_WORLD_ALIGNED).reshape(6, arm.joints)
    assert_allclose(arm.jacobian(theta), J[[0, 1, 5]], atol=1e-13)
    rate = pin.getFrameClassicalAcceleration(model, data, tool, pin.LOCAL_WORLD_ALIGNED)
    expected = np.array([*rate.linear[:2], rate.angular[2]])
    speed = np.abs(omega).sum() ** 2
    assert_allclose(arm.jacobian_rate_times_speed(theta, omega), expected, atol=1e-12 * (1 + speed))


@given(arms_in_motion())
def test_forward_dynamics_inverts_inverse_dynamics(case: tuple) -> None:
    arm, theta, omega = case
    acceleration = np.linspace(-3, 4, arm.joints)
    torque = arm.inverse_dynamics(theta, omega, acceleration)
    tolerance = 1e-12 * np.linalg.cond(arm.inertia(theta)) * (1 + np.abs(torque).max())
    assert_allclose(arm.forward_dynamics(theta, omega, torque), acceleration, atol=tolerance)


@names
def test_symbolic_model_is_the_numeric_one(arm: PlanarSerialArm) -> None:
    model = arm.symbolic
    matrices = [model.inertia, model.coriolis, model.gravity, model.stiffness * sp.Matrix(model.theta)]
    function = sp.lambdify(model.theta + model.omega, matrices, "numpy")
    rng = np.random.default_rng(2)
    for _ in range(50):
        theta, omega = random_state(arm, rng)
        M, N, G, H_theta = function(*theta, *omega)
        assert_allclose(M, arm.inertia(theta), atol=1e-12)
        assert_allclose(N, arm.coriolis_matrix(theta, omega), atol=1e-11)
        assert_allclose(G.ravel(), arm.gravity(theta), atol=1e-11)
        assert_allclose(H_theta.ravel(), arm.gravity(theta), atol=1e-11)


@given(arms_in_motion())
def test_inertia_is_affine_in_its_premises(case: tuple) -> None:
    arm, theta, _ = case
    premises = arm.inertia_premises(OperatingDomain.symmetric(arm.joints, angle_rad=np.pi, speed_rad_s=1.0))
    z = [float(premise.expression.subs(dict(zip(arm.symbolic.theta, theta, strict=True)))) for premise in premises]
    affine = arm.inertia_affine()
    assert affine.premises == arm.joints * (arm.joints - 1) // 2
    assert_allclose(affine.evaluate(z), arm.inertia(theta), atol=1e-12 * np.abs(affine.constant).max())


# ---- invariants ------------------------------------------------------------------------------------------------------


def inertia_rate(arm: PlanarSerialArm, theta: NDArray[np.float64], omega: NDArray[np.float64]) -> NDArray[np.float64]:
    """dM/dt by central difference, error about 1e-9 of the size of M."""
    step = 1e-5
    return (arm.inertia(theta + step * omega) - arm.inertia(theta - step * omega)) / (2 * step)


def frictionless(arm: PlanarSerialArm) -> PlanarSerialArm:
    return replace(arm, links=tuple(replace(link, friction_nm_s=0.0) for link in arm.links))


@given(arms_in_motion())
def test_inertia_rate_minus_twice_the_christoffel_matrix_is_skew_symmetric(case: tuple) -> None:
    arm, theta, omega = frictionless(case[0]), *case[1:]
    difference = inertia_rate(arm, theta, omega) - 2 * arm.coriolis_matrix(theta, omega)
    tolerance = 1e-6 * np.abs(arm.inertia(theta)).max() * (1 + omega @ omega)
    assert_allclose(difference + difference.T, 0, atol=tolerance)


@pytest.mark.parametrize("arm", [ARM2, ARM3], ids=lambda arm: arm.name)
def test_printed_factorisation_is_passive_along_the_motion_but_not_skew(arm: PrintedSerialArm) -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        theta, omega = random_state(arm, rng)
        difference = inertia_rate(arm, theta, omega) - 2 * arm.coriolis_matrix(theta, omega)
        assert_allclose(omega @ difference @ omega, 0, atol=1e-4)
        christoffel = arm.skew
        assert_allclose(arm.coriolis(theta, omega), christoffel.coriolis(theta, omega), atol=1e-11)
        assert np.abs(difference + difference.T).max() > 1e-3


def test_printed_entries_of_the_arm3_matrices_are_those_of_example_i4() -> None:
    """Dehak 2022, Example I.4, with m_11 = 2 (...) + c_7 and z_4 = (2 w_1 + w_2) sin(theta_2)."""
    arm = truncated_arm3()
    c1, c2, c3, c4, c5, c6, c7, c8, c9 = 113.796, 60.587541, 16.4808, 6.1761, 1.68, 1.512, 17.702, 6.602, 1.3
    domain = robot("arm3").domain
    system = arm.as_descriptor_system(domain)
    rng = np.random.default_rng(4)
    for _ in range(20):
        z = rng.uniform(system.lower, system.upper)
        z1, z2, z3, z4, z5, z6, z7, z8, z9, z10, z11, z12 = z
        m12, m13, m23 = c4 * z1 + 2 * c6 * z2 + c5 * z3 + c8, c6 * z2 + c5 * z3 + c9, c6 * z2 + c9
        M = [[2 * (c4 * z1 + c6 * z2 + c5 * z3) + c7, m12, m13], [m12, 2 * c6 * z2 + c8, m23], [m13, m23, c9]]
        a, b = c6 * (z7 - z8), c5 * z6
        N = [
            [c5 * (z6 - z9) + a, -c4 * z4 + a - c5 * z9, -c6 * z8 - c5 * z9],
            [c4 * z5 + b + a, a, -c6 * z8],
            [b + c6 * z7, c6 * z7, 0],
        ]
        h1, h2, h3 = c1 * z10 + c2 * z11 + c3 * z12, c2 * z11 + c3 * z12, c3 * z12
        H = [[h1, h2, h3], [h2, h2, h3], [h3, h3, h3]]
        E, A, _, _ = system.evaluate(z)
        assert_allclose(E[3:, 3:], M, atol=1e-10)
        assert_allclose(A[3:], -np.hstack([H, N]), atol=1e-10)


def test_printed_entries_of_the_arm2_matrices_are_those_of_example_i2_on_the_right_hand_side() -> None:
    """Dehak 2022, Example I.2, read as M theta'' = N theta' + H theta + Gamma: the hanging arm."""
    c1, c2, c3 = 4.25, 1.125, 0.75
    system = ARM2.as_descriptor_system(robot("arm2").domain)
    z1, z2, z3, z4, z5 = z = [0.8, -95.0, -20.0, 0.7, -0.3]
    E, A, _, _ = system.evaluate(z)
    assert_allclose(E[2:, 2:], [[c1 + 2 * c2 * z1, c3 + c2 * z1], [c3 + c2 * z1, c3]], rtol=1e-12)
    assert_allclose(A[2:], [[z2, z3, 2 * z4, z4], [z3, z3, z5, 0]], atol=1e-12)


@names
def test_without_friction_energy_is_conserved(arm: PlanarSerialArm) -> None:
    start = np.concatenate([np.full(arm.joints, np.radians(22.5)), np.zeros(arm.joints)])

    def rate(_: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        theta, omega = np.split(x, 2)
        return np.concatenate([omega, arm.forward_dynamics(theta, omega, np.zeros(arm.joints))])

    path = solve_ivp(rate, (0.0, 1.0), start, rtol=1e-10, atol=1e-10).y
    energies = [arm.energy(*np.split(x, 2)) for x in path.T]
    assert np.ptp(path, axis=1).max() > 0.1
    assert_allclose(energies, energies[0], atol=1e-6)


def test_friction_takes_away_the_power_it_absorbs() -> None:
    arm = replace(ARM3, links=tuple(replace(link, friction_nm_s=4.0) for link in ARM3.links))
    theta, omega = np.array([0.3, 1.0, -0.5]), np.array([1.0, -2.0, 0.7])
    acceleration = arm.forward_dynamics(theta, omega, np.zeros(3))
    step = 1e-6
    ahead = arm.energy(theta + step * omega, omega + step * acceleration)
    behind = arm.energy(theta - step * omega, omega - step * acceleration)
    assert_allclose((ahead - behind) / (2 * step), -4.0 * omega @ omega, rtol=1e-6)


# ---- the numbers of the thesis ---------------------------------------------------------------------------------------


def test_constants_of_arm3_are_the_printed_ones() -> None:
    arm = truncated_arm3()
    D = arm.inertia_constants
    printed = [113.796, 60.587541, 16.4808, 6.1761, 1.68, 1.512, 17.702, 6.602, 1.3]
    computed = [*arm.gravity_constants, D[0, 1], D[0, 2], D[1, 2], np.trace(D), D[1, 1] + D[2, 2], D[2, 2]]
    assert_allclose(computed, printed, rtol=1e-12)


def test_constants_of_arm2_are_the_printed_ones() -> None:
    D = ARM2.inertia_constants
    computed = [np.trace(D), D[0, 1], D[1, 1], *ARM2.gravity_constants]
    assert_allclose(computed, [4.25, 1.125, 0.75, 80.9325, 22.0725], rtol=1e-12)


def test_arm3_hanging_has_the_printed_linearisation() -> None:
    """Independent of H: the slope of the gravity torque by finite differences."""
    arm, step = truncated_arm3(), 1e-6
    slope = np.column_stack([(arm.gravity(step * e) - arm.gravity(-step * e)) / (2 * step) for e in np.eye(3)])
    eigenvalues = np.sort(np.linalg.eigvals(-np.linalg.solve(arm.inertia(np.zeros(3)), slope)).real)[::-1]
    assert_allclose(eigenvalues, [-5.04, -20.2, -62.1], rtol=1e-3)


def test_arm2_upright_has_the_printed_unstable_linearisation() -> None:
    arm = replace(ARM2, equilibrium="upright")
    H = np.array(arm.symbolic.stiffness.subs(dict.fromkeys(arm.symbolic.theta, 0)), dtype=float)
    eigenvalues = np.sort(np.linalg.eigvals(-np.linalg.solve(arm.inertia(np.zeros(2)), H)).real)
    assert_allclose(eigenvalues, [15.24, 86.25], rtol=5e-4)


def test_pid_gains_from_the_largest_inertias_are_the_printed_digits() -> None:
    """Dehak 2022, (III.55): k_p = 3 a w^2, k_d = 3 a w, k_i = a w^3, w = 15 pi, a the largest diagonal of M."""
    w, a = 15 * np.pi, np.diag(ARM3.inertia(np.zeros(3)))
    assert_allclose(3 * a * w**2 / 1e4, [24.280, 6.413, 0.866], rtol=0, atol=6e-4)
    assert_allclose(3 * a * w / 1e4, [0.51524, 0.13608, 0.01838], rtol=0, atol=6e-6)
    assert_allclose(a * w**3 / 1e4, [381.39, 100.73, 13.60], rtol=0, atol=6e-3)
    truncated = np.diag(truncated_arm3().inertia(np.zeros(3)))[0]
    assert abs(3 * truncated * w**2 / 1e4 - 24.280) > 4e-3  # r_2 = .489 does not give them


# ---- kinematics ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("equilibrium", ["hanging", "upright"])
def test_inverse_kinematics_inverts_forward_kinematics_for_the_elbow_in_0_pi(equilibrium: str) -> None:
    arm = replace(ARM3, equilibrium=equilibrium)
    rng = np.random.default_rng(6)
    for _ in range(200):
        theta = np.array([rng.uniform(-1.5, 1.5), rng.uniform(0.05, 3.0), rng.uniform(-2, 2)])
        assert_allclose(arm.inverse_kinematics(arm.forward_kinematics(theta)), theta, atol=1e-11)


def test_jacobian_determinant_vanishes_with_the_sine_of_the_elbow() -> None:
    for theta2 in (-0.7, 0.0, 1.2):
        determinant = np.linalg.det(ARM3.jacobian([0.4, theta2, -0.9]))
        assert_allclose(determinant, 1.0 * 0.9 * np.sin(theta2), atol=1e-14)


@pytest.mark.parametrize("pose", [(3.0, 0.0, 0.0), (0.8 * np.sin(1.0), -0.8 * np.cos(1.0) - 0.05, 1.0)])
def test_when_pose_is_out_of_reach_expect_refusal_with_the_distances(pose: tuple[float, float, float]) -> None:
    with pytest.raises(InputError, match=r"expected a distance strictly between 0\.1 and 1\.9 m"):
        ARM3.inverse_kinematics(pose)


def test_when_arm_has_not_three_joints_expect_inverse_kinematics_refused() -> None:
    with pytest.raises(InputError, match="arm2: joints"):
        ARM2.inverse_kinematics([0.5, -0.5, 0.0])


# ---- perturbation ----------------------------------------------------------------------------------------------------


def test_loaded_plant_has_the_parallel_axis_inertias_and_a_definite_inertia_matrix() -> None:
    """Dehak 2022, IV.5.1: m_1, m_2, r_1, r_2 times 1.4, m_3, r_3 times 2.2; I_c = .75, .7283, .628 unchanged."""
    nominal = truncated_arm3()
    loaded = nominal.perturbed([1.4, 1.4, 2.2], [1.4, 1.4, 2.2])
    assert_allclose([link.com_inertia_kg_m2 for link in loaded.links], [0.75, 0.7283071, 0.628], atol=5e-8)
    assert_allclose([link.inertia_kg_m2 for link in loaded.links], [4.18, 3.9434, 7.7835], atol=5e-5)
    postures = np.random.default_rng(7).uniform(-np.pi, np.pi, (2000, 3))
    assert min(np.linalg.eigvalsh(loaded.inertia(theta))[0] for theta in postures) > 0.45


def test_payload_fraction_runs_from_the_nominal_to_the_loaded_plant() -> None:
    arm3 = robot("arm3")
    assert arm3.with_payload_fraction(0.0).links == arm3.model.perturbed([1] * 3, [1] * 3).links
    assert arm3.with_payload_fraction(1.0).links == arm3.model.perturbed([1.4, 1.4, 2.2], [1.4, 1.4, 2.2]).links
    half = arm3.with_payload_fraction(0.5).links[2]
    assert_allclose([half.mass_kg, half.com_m], [4.2 * 1.6, 0.4 * 1.6], rtol=1e-15)
    masses = [arm3.with_payload_fraction(f).links[2].inertia_kg_m2 for f in np.linspace(0, 1, 9)]
    assert all(lighter < heavier for lighter, heavier in pairwise(masses))
    # The inertia is a cubic of the fraction: its fourth differences vanish.
    assert_allclose(np.diff(masses, n=4), 0, atol=1e-12)
    assert np.abs(np.diff(masses, n=3)).min() > 1e-3


def test_when_payload_fraction_is_outside_0_1_expect_refusal() -> None:
    with pytest.raises(InputError, match=r"fraction: got 1\.1"):
        PayloadSet((1.4,), (1.4,)).scales_at(1.1)


def test_when_inertia_is_less_than_the_parallel_axis_term_expect_refusal() -> None:
    with pytest.raises(InputError, match=r"link: inertia_kg_m2: got 1\.3, expected a number >= .* = 7\.15546"):
        Link(length_m=0.8, mass_kg=9.24, com_m=0.88, inertia_kg_m2=1.3)


@pytest.mark.parametrize(
    ("field", "value"),
    [("length_m", 0.0), ("mass_kg", -1.0), ("friction_nm_s", -0.1), ("com_m", float("nan")), ("mass_kg", float("inf"))],
)
def test_when_link_parameter_is_out_of_range_expect_its_name(field: str, value: float) -> None:
    with pytest.raises(InputError, match=f"link: {field}"):
        replace(ARM3.links[0], **{field: value})


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"links": ()}, "at least one link"),
        ({"gravity_m_s2": -9.81}, "gravity_m_s2"),
        ({"equilibrium": "sideways"}, "hanging or upright"),
        ({"links": ARM3.links[:1]}, "2 or 3, the arms of the source"),
    ],
)
def test_when_arm_is_not_well_defined_expect_refusal(changes: dict, words: str) -> None:
    with pytest.raises(InputError, match=words):
        replace(ARM3, **changes)


def test_when_vector_or_factors_have_the_wrong_length_expect_refusal() -> None:
    with pytest.raises(InputError, match=r"joint vector: got shape \(2,\), expected shape \(3,\)"):
        ARM3.inertia([0.0, 0.0])
    with pytest.raises(InputError, match="mass_scale: got 2 factors, expected 3 factors"):
        ARM3.perturbed([1.0, 1.0], [1.0, 1.0, 1.0])


def test_scenario_plant_has_the_documented_members_and_an_upright_arm_hangs_in_the_opposite_gravity() -> None:
    document = ARM3.plant_document("nominal")
    assert set(document) == {"kind", "label", "gravity_m_s2", "links"}
    assert set(document["links"][0]) == {"length_m", "mass_kg", "com_m", "inertia_kg_m2", "friction_nm_s"}
    assert_array_equal([link["inertia_kg_m2"] for link in document["links"]], [2.0, 1.9, 1.3])
    upright = replace(ARM3, equilibrium="upright")
    assert upright.plant_document("nominal")["gravity_m_s2"] == -ARM3.gravity_m_s2
    theta = np.array([0.3, -0.5, 1.1])
    assert_array_equal(upright.gravity(theta), -ARM3.gravity(theta))
    assert_array_equal(upright.gravity_stiffness(theta), -ARM3.gravity_stiffness(theta))
    assert_allclose(ARM3.gravity_stiffness(theta) @ theta, ARM3.gravity(theta), rtol=1e-13)
