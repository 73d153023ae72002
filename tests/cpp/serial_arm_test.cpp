// The arm against an independent Lagrangian, against the printed closed form, and against the laws of mechanics.
#include "quasilpv/serial_arm.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <complex>
#include <limits>
#include <vector>

#include "arm_fixtures.hpp"
#include "decompositions.hpp"
#include "quasilpv/errors.hpp"

namespace quasilpv {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using ::testing::AllOf;
using testing::derivative_at_zero;
using ::testing::HasSubstr;
using testing::least_eigenvalue;
using testing::modes_of;
using testing::random_arm;
using testing::three_link_arm;
using testing::Uniform;

constexpr int kRandomStates = 200;

// Kinetic and potential energy from the Cartesian motion of each centre of mass. Knows nothing of the class under test:
// it walks along the chain with positions and velocities. `Scalar` may be complex, for complex-step derivatives.
template <class Scalar>
struct CartesianEnergy {
  Scalar kinetic{};
  Scalar potential{};
};

template <class Scalar>
CartesianEnergy<Scalar> cartesian_energy(const SerialArmParameters& arm, const std::vector<Scalar>& angle,
                                         const std::vector<Scalar>& speed) {
  CartesianEnergy<Scalar> energy;
  Scalar absolute_angle{}, absolute_speed{};
  Scalar height{}, velocity_x{}, velocity_y{};
  for (std::size_t k = 0; k < arm.links.size(); ++k) {
    const PlanarLink& link = arm.links[k];
    absolute_angle += angle[k];
    absolute_speed += speed[k];
    const Scalar along_x = absolute_speed * std::cos(absolute_angle);  // velocity of a point at distance 1
    const Scalar along_y = absolute_speed * std::sin(absolute_angle);
    const Scalar com_x = velocity_x + link.com_m * along_x;
    const Scalar com_y = velocity_y + link.com_m * along_y;
    const double com_inertia = link.inertia_kg_m2 - link.mass_kg * link.com_m * link.com_m;
    energy.kinetic += 0.5 * link.mass_kg * (com_x * com_x + com_y * com_y);
    energy.kinetic += 0.5 * com_inertia * absolute_speed * absolute_speed;
    energy.potential += link.mass_kg * arm.gravity_m_s2 * (height - link.com_m * std::cos(absolute_angle));
    velocity_x += link.length_m * along_x;
    velocity_y += link.length_m * along_y;
    height -= link.length_m * std::cos(absolute_angle);
  }
  return energy;
}

// d(T - V)/d(angle_j) or, for `by_speed`, d(T - V)/d(speed_j), by the complex step: exact to rounding.
VectorXd lagrangian_gradient(const SerialArmParameters& arm, const VectorXd& angle, const VectorXd& speed,
                             bool by_speed) {
  using Complex = std::complex<double>;
  constexpr double kStep = 1e-40;
  VectorXd gradient(angle.size());
  for (Eigen::Index j = 0; j < angle.size(); ++j) {
    std::vector<Complex> q(angle.data(), angle.data() + angle.size());
    std::vector<Complex> v(speed.data(), speed.data() + speed.size());
    (by_speed ? v : q)[static_cast<std::size_t>(j)] += Complex(0.0, kStep);
    const auto energy = cartesian_energy<Complex>(arm, q, v);
    gradient[j] = (energy.kinetic - energy.potential).imag() / kStep;
  }
  return gradient;
}

// d/dt dL/dv - dL/dq along q'' = acceleration.
VectorXd lagrange_torque(const SerialArmParameters& arm, const VectorXd& angle, const VectorXd& speed,
                         const VectorXd& acceleration) {
  const VectorXd momentum_rate = derivative_at_zero(
      [&](double s) -> VectorXd {
        return lagrangian_gradient(arm, angle + s * speed + 0.5 * s * s * acceleration, speed + s * acceleration, true);
      },
      1e-3);
  return momentum_rate - lagrangian_gradient(arm, angle, speed, false);
}

VectorXd friction_torque(const SerialArmParameters& arm, const VectorXd& speed) {
  VectorXd torque(speed.size());
  for (Eigen::Index j = 0; j < speed.size(); ++j) {
    torque[j] = arm.links[static_cast<std::size_t>(j)].friction_nm_s * speed[j];
  }
  return torque;
}

class SerialArmOfSize : public ::testing::TestWithParam<int> {};

TEST_P(SerialArmOfSize, inverse_dynamics_equals_the_differentiated_lagrangian) {
  Uniform uniform(1);
  for (int i = 0; i < kRandomStates; ++i) {
    const SerialArmParameters parameters = random_arm(GetParam(), uniform);
    const SerialArm arm(parameters);
    const VectorXd angle = uniform.vector(GetParam(), 3.0);
    const VectorXd speed = uniform.vector(GetParam(), 2.0);
    const VectorXd acceleration = uniform.vector(GetParam(), 5.0);
    const VectorXd expected =
        lagrange_torque(parameters, angle, speed, acceleration) + friction_torque(parameters, speed);
    const VectorXd actual = arm.inverse_dynamics(angle, speed, acceleration);
    EXPECT_LT((actual - expected).cwiseAbs().maxCoeff(), 1e-7 * (1.0 + expected.cwiseAbs().maxCoeff()));
  }
}

TEST_P(SerialArmOfSize, energy_equals_the_cartesian_energy) {
  Uniform uniform(2);
  for (int i = 0; i < kRandomStates; ++i) {
    const SerialArmParameters parameters = random_arm(GetParam(), uniform);
    const VectorXd angle = uniform.vector(GetParam(), 3.0);
    const VectorXd speed = uniform.vector(GetParam(), 2.0);
    const auto expected = cartesian_energy<double>(parameters, {angle.data(), angle.data() + angle.size()},
                                                   {speed.data(), speed.data() + speed.size()});
    EXPECT_NEAR(SerialArm(parameters).energy(angle, speed), expected.kinetic + expected.potential,
                1e-11 * (1.0 + expected.kinetic + std::abs(expected.potential)));
  }
}

TEST_P(SerialArmOfSize, mass_matrix_is_symmetric_and_positive_definite) {
  Uniform uniform(3);
  for (int i = 0; i < kRandomStates; ++i) {
    const SerialArm arm(random_arm(GetParam(), uniform));
    const MatrixXd mass = arm.mass_matrix(uniform.vector(GetParam(), 3.0));
    EXPECT_LT((mass - mass.transpose()).cwiseAbs().maxCoeff(), 1e-14 * mass.cwiseAbs().maxCoeff());
    EXPECT_GT(least_eigenvalue(mass), 0.0);
  }
}

TEST_P(SerialArmOfSize, velocity_torque_does_no_work_beyond_the_change_of_mass) {
  // v' (Mdot - 2 N) v = 0.
  Uniform uniform(4);
  for (int i = 0; i < kRandomStates; ++i) {
    SerialArmParameters parameters = random_arm(GetParam(), uniform);
    parameters.gravity_m_s2 = 0.0;
    const SerialArm arm(parameters);
    const VectorXd angle = uniform.vector(GetParam(), 3.0);
    const VectorXd speed = uniform.vector(GetParam(), 2.0);
    const MatrixXd mass_rate =
        derivative_at_zero([&](double s) -> MatrixXd { return arm.mass_matrix(angle + s * speed); }, 1e-3);
    const VectorXd velocity_torque =
        arm.inverse_dynamics(angle, speed, VectorXd::Zero(GetParam())) - friction_torque(parameters, speed);
    const double scale = speed.cwiseAbs().dot(velocity_torque.cwiseAbs());
    EXPECT_NEAR(speed.dot(mass_rate * speed), 2.0 * speed.dot(velocity_torque), 1e-8 * (1.0 + scale));
  }
}

TEST_P(SerialArmOfSize, energy_changes_by_the_power_of_the_torque_less_friction) {
  Uniform uniform(5);
  const int n = GetParam();
  for (int i = 0; i < kRandomStates; ++i) {
    const SerialArmParameters parameters = random_arm(n, uniform);
    SerialArm arm(parameters);
    JointArray torque{};
    for (int j = 0; j < n; ++j) {
      torque[static_cast<std::size_t>(j)] = uniform(-50.0, 50.0);
    }
    arm.set_torque(torque);
    arm.set_external_torque(ExternalTorque({{n - 1, 20.0, 3.0, 0.5}}));
    const double t = 0.7;
    VectorXd y(2 * n), y_dot(2 * n);
    y << uniform.vector(n, 3.0), uniform.vector(n, 2.0);
    arm.derivative(t, y, y_dot);
    const VectorXd speed = y.tail(n);
    VectorXd applied = Eigen::Map<const VectorXd>(torque.data(), n);
    applied[n - 1] += 20.0 * std::sin(3.0 * t + 0.5);
    const double power = speed.dot(applied - friction_torque(parameters, speed));
    const double h = 1e-3 / (1.0 + y_dot.cwiseAbs().maxCoeff());
    const double energy_rate = derivative_at_zero(
        [&](double s) -> double {
          const VectorXd moved = y + s * y_dot;
          return arm.energy(moved.head(n), moved.tail(n));
        },
        h);
    const double scale = std::abs(arm.energy(y.head(n), speed)) + 100.0;
    EXPECT_NEAR(energy_rate, power, 1e-11 * scale / h);
  }
}

TEST_P(SerialArmOfSize, residual_vanishes_at_the_explicit_derivative) {
  Uniform uniform(6);
  const int n = GetParam();
  for (int i = 0; i < kRandomStates; ++i) {
    SerialArm arm(random_arm(n, uniform));
    arm.set_torque({10.0, -7.0});
    VectorXd y(2 * n), y_dot(2 * n), residual(2 * n);
    y << uniform.vector(n, 3.0), uniform.vector(n, 2.0);
    arm.derivative(0.3, y, y_dot);
    arm.residual(0.3, y, y_dot, residual);
    // A backward-stable solve leaves a residual of rounding size relative to M w'.
    const double scale = 100.0 + (arm.mass_matrix(y.head(n)) * y_dot.tail(n)).cwiseAbs().maxCoeff();
    EXPECT_LT(residual.cwiseAbs().maxCoeff(), 1e-12 * scale);
  }
}

TEST_P(SerialArmOfSize, jacobian_equals_differences_of_the_residual) {
  Uniform uniform(7);
  const int n = GetParam();
  for (const double c_j : {0.0, 1.0, 1e3}) {
    const SerialArm arm(random_arm(n, uniform));
    VectorXd y(2 * n), y_dot(2 * n);
    y << uniform.vector(n, 3.0), uniform.vector(n, 2.0);
    y_dot << uniform.vector(n, 2.0), uniform.vector(n, 5.0);
    MatrixXd jacobian(2 * n, 2 * n);
    arm.jacobian(0.0, c_j, y, y_dot, jacobian);
    for (int j = 0; j < 2 * n; ++j) {
      const VectorXd direction = VectorXd::Unit(2 * n, j);
      const VectorXd expected = derivative_at_zero(
          [&](double s) -> VectorXd {
            VectorXd residual(2 * n);
            arm.residual(0.0, y + s * direction, y_dot + c_j * s * direction, residual);
            return residual;
          },
          1e-3);
      EXPECT_LT((jacobian.col(j) - expected).cwiseAbs().maxCoeff(), 1e-8 * (1.0 + expected.cwiseAbs().maxCoeff()))
          << "column " << j << ", c_j = " << c_j;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(AllSizes, SerialArmOfSize, ::testing::Range(1, kMaxJoints + 1));

// The printed closed form of the three-link arm, with m11 = 2 (c4 z1 + c6 z2 + c5 z3) + c7 and
// z4 = (2 w1 + w2) sin t2 in place of the misprints. Constants of Table I.4.
struct PrintedArm {
  Eigen::Matrix3d mass;
  Eigen::Matrix3d velocity;
  Eigen::Vector3d gravity;
};

PrintedArm printed_arm(const VectorXd& t, const VectorXd& w) {
  const double c1 = 113.796, c2 = 60.587541, c3 = 16.4808, c4 = 6.1761, c5 = 1.68, c6 = 1.512, c7 = 17.702, c8 = 6.602,
               c9 = 1.3;
  const double z1 = std::cos(t[1]), z2 = std::cos(t[2]), z3 = std::cos(t[1] + t[2]);
  const double z4 = (2.0 * w[0] + w[1]) * std::sin(t[1]), z5 = w[0] * std::sin(t[1]);
  const double z6 = w[0] * std::sin(t[1] + t[2]), z7 = (w[0] + w[1]) * std::sin(t[2]);
  const double z8 = w.sum() * std::sin(t[2]), z9 = w.sum() * std::sin(t[1] + t[2]);
  const double m11 = 2.0 * (c4 * z1 + c6 * z2 + c5 * z3) + c7, m12 = c4 * z1 + 2.0 * c6 * z2 + c5 * z3 + c8;
  const double m13 = c6 * z2 + c5 * z3 + c9, m22 = 2.0 * c6 * z2 + c8, m23 = c6 * z2 + c9;
  const double g3 = c3 * std::sin(t.sum()), g2 = c2 * std::sin(t[0] + t[1]) + g3, g1 = c1 * std::sin(t[0]) + g2;
  PrintedArm arm;
  arm.mass << m11, m12, m13, m12, m22, m23, m13, m23, c9;
  arm.velocity << c5 * (z6 - z9) + c6 * (z7 - z8), -c4 * z4 + c6 * (z7 - z8) - c5 * z9, -c6 * z8 - c5 * z9,
      c4 * z5 + c5 * z6 + c6 * (z7 - z8), c6 * (z7 - z8), -c6 * z8, c5 * z6 + c6 * z7, c6 * z7, 0.0;
  arm.gravity << g1, g2, g3;
  return arm;
}

TEST(SerialArm, three_links_match_the_printed_closed_form_with_its_errata) {
  Uniform uniform(8);
  const SerialArm arm(three_link_arm());
  const VectorXd rest = VectorXd::Zero(3);
  for (int i = 0; i < kRandomStates; ++i) {
    const VectorXd angle = uniform.vector(3, 3.0);
    const VectorXd speed = uniform.vector(3, 3.0);
    const PrintedArm printed = printed_arm(angle, speed);
    const VectorXd gravity = arm.inverse_dynamics(angle, rest, rest);
    EXPECT_LT((MatrixXd(arm.mass_matrix(angle)) - printed.mass).cwiseAbs().maxCoeff(), 1e-12);
    EXPECT_LT((gravity - printed.gravity).cwiseAbs().maxCoeff(), 1e-10);
    const VectorXd velocity_torque = arm.inverse_dynamics(angle, speed, rest) - gravity;
    EXPECT_LT((velocity_torque - printed.velocity * speed).cwiseAbs().maxCoeff(), 1e-11);
  }
}

TEST(SerialArm, three_links_hang_at_zero_with_the_known_stiffness_spectrum) {
  const SerialArm arm(three_link_arm());
  const VectorXd zero = VectorXd::Zero(3);
  MatrixXd stiffness(3, 3);
  for (int j = 0; j < 3; ++j) {
    stiffness.col(j) = derivative_at_zero(
        [&](double s) -> VectorXd { return arm.inverse_dynamics(s * VectorXd::Unit(3, j), zero, zero); }, 1e-3);
  }
  const VectorXd squared_frequency = modes_of(stiffness, arm.mass_matrix(zero)).squared_frequency;
  EXPECT_NEAR(squared_frequency[0], 5.04, 0.01);
  EXPECT_NEAR(squared_frequency[1], 20.2, 0.1);
  EXPECT_NEAR(squared_frequency[2], 62.1, 0.1);
}

TEST(SerialArm, when_inertia_is_below_the_parallel_axis_bound_expect_refusal_naming_link_and_numbers) {
  // The payload of Dehak 2022, chapter IV, with the inertia left as it was: 4.2 * 2.2 * (0.4 * 2.2)^2 = 7.155.
  SerialArmParameters arm = three_link_arm();
  arm.links[2].mass_kg *= 2.2;
  arm.links[2].com_m *= 2.2;
  try {
    const SerialArm refused(arm);
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("links[2].inertia_kg_m2"), HasSubstr("1.3"), HasSubstr("7.155456"),
                                    HasSubstr("indefinite inertia")));
  }
}

TEST(SerialArm, a_point_mass_meets_the_parallel_axis_bound) {
  EXPECT_NO_THROW(SerialArm(testing::point_pendulum(0.7)));
}

TEST(SerialArm, when_a_parameter_is_not_physical_expect_refusal_naming_it) {
  const auto refusal = [](const SerialArmParameters& arm) -> std::string {
    try {
      const SerialArm refused(arm);
      return "accepted";
    } catch (const InputError& error) {
      return error.field();
    }
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  SerialArmParameters arm = three_link_arm();
  arm.links[0].inertia_kg_m2 = 0.0;
  EXPECT_THAT(refusal(arm), HasSubstr("links[0].inertia_kg_m2"));
  arm = three_link_arm();
  arm.links[1].mass_kg = -4.9;
  EXPECT_THAT(refusal(arm), HasSubstr("links[1].mass_kg"));
  arm = three_link_arm();
  arm.links[1].length_m = nan;
  EXPECT_THAT(refusal(arm), HasSubstr("links[1].length_m"));
  arm = three_link_arm();
  arm.links[1].com_m = nan;
  EXPECT_THAT(refusal(arm), HasSubstr("links[1].com_m"));
  arm = three_link_arm(-1.0);
  EXPECT_THAT(refusal(arm), HasSubstr("links[0].friction_nm_s"));
  arm = three_link_arm();
  arm.gravity_m_s2 = nan;
  EXPECT_THAT(refusal(arm), HasSubstr("gravity_m_s2"));
  arm.links.clear();
  arm.gravity_m_s2 = 9.81;
  EXPECT_THAT(refusal(arm), HasSubstr("links"));
  arm.links.assign(8, three_link_arm().links[0]);
  EXPECT_THAT(refusal(arm), HasSubstr("links"));
}

TEST(SerialArm, when_the_mass_matrix_is_singular_to_working_precision_expect_refusal) {
  // A weightless first link that carries a point mass: stretched, the point mass cannot tell the two joints apart.
  SerialArmParameters arm = testing::point_pendulum(1.0);
  arm.links.insert(arm.links.begin(), {1.0, 1e-6, 0.0, 1e-6, 0.0});
  EXPECT_NO_THROW(SerialArm{arm});
  arm.links[0].inertia_kg_m2 = 1e-14;
  EXPECT_THROW(SerialArm{arm}, InputError);
}

TEST(SerialArm, when_the_state_is_not_a_number_expect_a_plant_error_from_the_mass_matrix) {
  const SerialArm arm(three_link_arm());
  VectorXd y = VectorXd::Zero(6), y_dot(6);
  y[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(arm.derivative(0.0, y, y_dot), PlantError);
}

}  // namespace
}  // namespace quasilpv
