// The equations of the five-bar against two serial arms, against differences, and against reduced models.
#include "quasilpv/five_bar.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "decompositions.hpp"
#include "five_bar_fixtures.hpp"
#include "quasilpv/errors.hpp"
#include "quasilpv/serial_arm.hpp"

namespace quasilpv {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix4d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector4d;
using Eigen::VectorXd;
using ::testing::AllOf;
using testing::derivative_at_zero;
using ::testing::HasSubstr;
using testing::inverse;
using testing::least_eigenvalue;
using testing::random_five_bar;
using testing::random_state;
using testing::solution;
using testing::thesis_five_bar;
using testing::Uniform;

constexpr int kRandomStates = 200;
const FiveBarFormulation kFormulations[] = {FiveBarFormulation::kIndex1, FiveBarFormulation::kGgl};

double largest(const MatrixXd& x) { return x.cwiseAbs().maxCoeff(); }

// Torque on the links of one leg, from the serial arm made of the same links: its second angle is relative, so its
// joint torques are (active + passive, passive).
Vector2d leg_torque(const FiveBarParameters& parameters, Vector2d angle, Vector2d speed, Vector2d acceleration) {
  const SerialArm leg({"leg", parameters.gravity_m_s2, {parameters.active, parameters.passive}});
  for (Vector2d* x : {&angle, &speed, &acceleration}) {
    (*x)[1] -= (*x)[0];
  }
  const VectorXd joint = leg.inverse_dynamics(angle, speed, acceleration);
  return {joint[0] - joint[1], joint[1]};
}

TEST(FiveBar, each_leg_without_its_constraint_is_a_serial_arm_of_two_links) {
  Uniform uniform(1);
  for (int i = 0; i < kRandomStates; ++i) {
    const FiveBarParameters parameters = random_five_bar(uniform);
    const Vector4d phi = uniform.vector(4, 3.0), v = uniform.vector(4, 3.0), a = uniform.vector(4, 10.0);
    const Vector4d torque = FiveBar(parameters).inverse_dynamics(phi, v, a);
    for (int leg = 0; leg < 2; ++leg) {
      const auto of_leg = [&](const Vector4d& x) { return Vector2d(x[leg], x[leg + 2]); };
      Vector2d expected = leg_torque(parameters, of_leg(phi), of_leg(v), of_leg(a));
      expected[0] += parameters.spring_nm_rad * (phi[leg] - parameters.spring_rest_rad[static_cast<std::size_t>(leg)]);
      EXPECT_LT(largest(of_leg(torque) - expected), 1e-12 * (1.0 + largest(expected) + largest(a)));
    }
  }
}

TEST(FiveBar, mass_matrix_is_the_derivative_of_the_torque_by_acceleration_and_positive_definite) {
  Uniform uniform(2);
  for (int i = 0; i < kRandomStates; ++i) {
    const FiveBar five_bar(random_five_bar(uniform));
    const Vector4d phi = uniform.vector(4, 3.0);
    const Matrix4d mass = five_bar.mass_matrix(phi);
    const Vector4d at_rest = five_bar.inverse_dynamics(phi, Vector4d::Zero(), Vector4d::Zero());
    for (int j = 0; j < 4; ++j) {
      const Vector4d column = five_bar.inverse_dynamics(phi, Vector4d::Zero(), Vector4d::Unit(j)) - at_rest;
      EXPECT_LT(largest(mass.col(j) - column), 1e-12 * (largest(mass) + largest(at_rest)));
    }
    EXPECT_GT(least_eigenvalue(mass), 0.0);
  }
}

TEST(FiveBar, energy_changes_by_the_power_of_the_torque_less_friction) {
  Uniform uniform(3);
  for (int i = 0; i < kRandomStates; ++i) {
    const FiveBarParameters parameters = random_five_bar(uniform);
    FiveBar five_bar(parameters);
    five_bar.set_torque({uniform(-5.0, 5.0), uniform(-5.0, 5.0)});
    const VectorXd y = random_state(five_bar, uniform);
    VectorXd y_dot(10);
    five_bar.derivative(0.0, y, y_dot);
    const Vector4d phi = y.head<4>(), v = y.segment<4>(4), a = y_dot.segment<4>(4);
    const double h = 1e-3 / (1.0 + largest(a));
    const double energy_rate = derivative_at_zero(
        [&](double s) -> double { return five_bar.energy(phi + s * v + 0.5 * s * s * a, v + s * a); }, h);
    const double power = five_bar.torque()[0] * v[0] + five_bar.torque()[1] * v[1];
    const double dissipation = parameters.active.friction_nm_s * v.head<2>().squaredNorm() +
                               parameters.passive.friction_nm_s * (v.tail<2>() - v.head<2>()).squaredNorm();
    EXPECT_NEAR(energy_rate, power - dissipation, 1e-11 * (100.0 + std::abs(five_bar.energy(phi, v))) / h);
  }
}

TEST(FiveBar, constraint_rows_are_the_stabilised_second_derivative_of_the_gap_between_the_legs) {
  Uniform uniform(4);
  for (int i = 0; i < kRandomStates; ++i) {
    const FiveBar five_bar(random_five_bar(uniform));
    const Vector4d phi = random_state(five_bar, uniform).head<4>() + uniform.vector(4, 1e-2);
    const Vector4d v = uniform.vector(4, 3.0), a = uniform.vector(4, 10.0);
    const auto gap = [&](double s) -> VectorXd { return five_bar.constraint(phi + s * v + 0.5 * s * s * a); };
    const auto gap_rate = [&](double s) -> VectorXd {
      return five_bar.constraint_jacobian(phi + s * v + 0.5 * s * s * a) * (v + s * a);
    };
    EXPECT_LT(largest(derivative_at_zero(gap, 1e-3) - gap_rate(0.0)), 1e-9);
    const double alpha = five_bar.parameters().baumgarte_per_s;
    const VectorXd expected =
        derivative_at_zero(gap_rate, 1e-3) + 2.0 * alpha * gap_rate(0.0) + alpha * alpha * gap(0.0);
    VectorXd y(10), y_dot(10), residual(10);
    y << phi, v, uniform.vector(2, 10.0);
    y_dot << v, a, 0.0, 0.0;
    five_bar.residual(0.0, y, y_dot, residual);
    EXPECT_LT(largest(residual.tail<2>() - expected), 1e-8 * (1.0 + largest(expected)));
  }
}

TEST(FiveBar, jacobian_equals_differences_of_the_residual_in_both_formulations) {
  Uniform uniform(5);
  for (const FiveBarFormulation formulation : kFormulations) {
    for (const double c_j : {0.0, 1.0, 1e3}) {
      FiveBarParameters parameters = random_five_bar(uniform);
      parameters.formulation = formulation;
      const FiveBar five_bar(parameters);
      const int n = five_bar.size();
      VectorXd y = random_state(five_bar, uniform);
      y.tail(n - 8) = uniform.vector(n - 8, 5.0);
      const VectorXd y_dot = uniform.vector(n, 5.0);
      MatrixXd jacobian = MatrixXd::Constant(n, n, std::numeric_limits<double>::quiet_NaN());
      five_bar.jacobian(0.0, c_j, y, y_dot, jacobian);
      for (int j = 0; j < n; ++j) {
        const VectorXd direction = VectorXd::Unit(n, j);
        const VectorXd expected = derivative_at_zero(
            [&](double s) -> VectorXd {
              VectorXd residual(n);
              five_bar.residual(0.0, y + s * direction, y_dot + c_j * s * direction, residual);
              return residual;
            },
            1e-3);
        EXPECT_LT(largest(jacobian.col(j) - expected), 1e-8 * (1.0 + largest(expected))) << "column " << j;
      }
    }
  }
}

TEST(FiveBar, consistent_values_make_the_residual_and_the_hidden_constraints_zero) {
  Uniform uniform(6);
  for (const FiveBarFormulation formulation : kFormulations) {
    for (int i = 0; i < kRandomStates; ++i) {
      FiveBarParameters parameters = random_five_bar(uniform);
      parameters.formulation = formulation;
      FiveBar five_bar(parameters);
      five_bar.set_torque({uniform(-5.0, 5.0), uniform(-5.0, 5.0)});
      five_bar.set_external_torque(ExternalTorque({{1, 15.0, 50.0, 0.3}}));
      VectorXd y = random_state(five_bar, uniform), y_dot(y.size()), residual(y.size());
      y.head<8>() += uniform.vector(8, 1e-3);
      five_bar.make_consistent(0.7, y, y_dot);
      five_bar.residual(0.7, y, y_dot, residual);
      const double force = largest(five_bar.mass_matrix(y.head<4>()) * y_dot.segment<4>(4)) + largest(y);
      EXPECT_LT(largest(residual), 1e-12 * (100.0 + force + largest(y_dot)));
      EXPECT_LT(largest(five_bar.constraint(y.head<4>())), 2e-14);
      EXPECT_LT(largest(five_bar.constraint_jacobian(y.head<4>()) * y.segment<4>(4)), 1e-13);
    }
  }
}

TEST(FiveBar, projection_changes_speeds_by_an_impulse_of_the_constraint_only) {
  Uniform uniform(7);
  const FiveBar five_bar(random_five_bar(uniform));
  VectorXd y = random_state(five_bar, uniform), y_dot(10);
  const Vector4d phi = y.head<4>();
  const Vector4d before = y.segment<4>(4) + uniform.vector(4, 0.1);
  y.segment<4>(4) = before;
  five_bar.make_consistent(0.0, y, y_dot);
  const Vector4d change = five_bar.mass_matrix(phi) * (y.segment<4>(4) - before);
  const MatrixXd J = five_bar.constraint_jacobian(phi);
  const VectorXd impulse = solution(J * J.transpose(), J * change);
  EXPECT_GT(largest(change), 1e-3);
  EXPECT_LT(largest(J.transpose() * impulse - change), 1e-12);
}

TEST(FiveBar, accelerations_and_multipliers_solve_the_full_kkt_system) {
  Uniform uniform(8);
  for (int i = 0; i < kRandomStates; ++i) {
    FiveBarParameters parameters = random_five_bar(uniform);
    parameters.baumgarte_per_s = 0.0;
    FiveBar five_bar(parameters);
    five_bar.set_torque({uniform(-5.0, 5.0), uniform(-5.0, 5.0)});
    VectorXd y = random_state(five_bar, uniform), y_dot(10);
    five_bar.make_consistent(0.0, y, y_dot);
    const Vector4d phi = y.head<4>(), v = y.segment<4>(4);
    const MatrixXd J = five_bar.constraint_jacobian(phi);
    const VectorXd bias =
        derivative_at_zero([&](double s) -> VectorXd { return five_bar.constraint_jacobian(phi + s * v) * v; }, 1e-3);
    Eigen::Matrix<double, 6, 6> kkt;
    kkt << five_bar.mass_matrix(phi), -J.transpose(), J, Matrix2d::Zero();
    Eigen::Matrix<double, 6, 1> right;
    right << Vector4d(five_bar.torque()[0], five_bar.torque()[1], 0.0, 0.0) -
                 five_bar.inverse_dynamics(phi, v, Vector4d::Zero()),
        -bias;
    const VectorXd expected = solution(kkt, right);
    EXPECT_LT(largest(y_dot.segment<4>(4) - expected.head<4>()), 1e-8 * (1.0 + largest(expected)));
    EXPECT_LT(largest(y.tail<2>() - expected.tail<2>()), 1e-8 * (1.0 + largest(expected)));
  }
}

TEST(FiveBar, equal_legs_are_a_rhombus_with_the_closed_form_of_two_degrees_of_freedom) {
  Uniform uniform(9);
  FiveBar five_bar(thesis_five_bar());
  const double c1 = 9.81 * (0.0825 * 0.0825 + 0.0825 * 0.165), c2 = 9.81 * 0.0825 * 0.0825;
  const double c3 = 0.0825 * 0.0825 * 0.165, c4 = 0.0011 + 0.0825 * 0.165 * 0.165, c5 = 0.0007;
  for (int i = 0; i < kRandomStates; ++i) {
    five_bar.set_torque({uniform(-5.0, 5.0), uniform(-5.0, 5.0)});
    const VectorXd y = random_state(five_bar, uniform);
    EXPECT_NEAR(y[2], y[1], 1e-14);  // q_1 = th_2
    EXPECT_NEAR(y[3], y[0], 1e-14);
    VectorXd y_dot(10);
    five_bar.derivative(0.0, y, y_dot);
    const Vector2d th = y.head<2>(), w = y.segment<2>(4);
    const double opening = th[1] - th[0];
    Matrix2d mass;
    mass << c4 + c5, 2.0 * c3 * std::cos(opening), 2.0 * c3 * std::cos(opening), c4 + c5;
    const Vector2d velocity_torque = 2.0 * c3 * std::sin(opening) * Vector2d(-w[1] * w[1], w[0] * w[0]);
    const Vector2d gravity = (c1 + c2) * th.array().sin();
    const Vector2d expected =
        inverse(mass) * (Vector2d(five_bar.torque()[0], five_bar.torque()[1]) - velocity_torque - gravity);
    EXPECT_LT(largest(y_dot.segment<2>(4) - expected), 1e-10 * (1.0 + largest(expected)));
  }
}

TEST(FiveBar, an_assembled_mechanism_meets_in_the_tool_beyond_its_elbows) {
  Uniform uniform(10);
  for (int i = 0; i < kRandomStates; ++i) {
    const FiveBar five_bar(random_five_bar(uniform));
    const VectorXd y = random_state(five_bar, uniform);
    const double a = five_bar.parameters().active.length_m, b = five_bar.parameters().passive.length_m;
    EXPECT_LT(five_bar.constraint(y.head<4>()).norm(), 1e-14);
    EXPECT_LT((five_bar.constraint_jacobian(y.head<4>()) * y.segment<4>(4)).norm(), 1e-12);
    const Vector2d elbows = 0.5 * a * Vector2d(std::sin(y[0]) + std::sin(y[1]), -std::cos(y[0]) - std::cos(y[1]));
    const Vector2d tool(a * std::sin(y[0]) + b * std::sin(y[2]), -a * std::cos(y[0]) - b * std::cos(y[2]));
    EXPECT_GT((tool - elbows).dot(elbows), 0.0);
    EXPECT_LT(y[0], y[1]);
  }
}

std::string refusal(const FiveBarParameters& parameters) {
  try {
    const FiveBar refused(parameters);
    return "accepted";
  } catch (const InputError& error) {
    return error.what();
  }
}

TEST(FiveBar, when_a_parameter_is_not_physical_expect_refusal_naming_it) {
  FiveBarParameters parameters = thesis_five_bar();
  parameters.passive.mass_kg *= 2.2;  // the payload of Dehak 2022, its inertia forgotten
  parameters.passive.com_m *= 2.2;
  EXPECT_THAT(refusal(parameters), AllOf(HasSubstr("passive.inertia_kg_m2"), HasSubstr("indefinite inertia")));
  parameters = thesis_five_bar();
  parameters.active.friction_nm_s = -0.1;
  EXPECT_THAT(refusal(parameters), HasSubstr("active.friction_nm_s"));
  parameters = thesis_five_bar();
  parameters.gravity_m_s2 = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(refusal(parameters), HasSubstr("gravity_m_s2"));
  parameters = thesis_five_bar();
  parameters.spring_nm_rad = -1.0;
  EXPECT_THAT(refusal(parameters), HasSubstr("spring_nm_rad"));
  parameters = thesis_five_bar();
  parameters.baumgarte_per_s = -1.0;
  EXPECT_THAT(refusal(parameters), HasSubstr("baumgarte_per_s"));
  parameters = thesis_five_bar();
  parameters.spring_rest_rad[1] = std::numeric_limits<double>::infinity();
  EXPECT_THAT(refusal(parameters), HasSubstr("spring_rest_rad"));
}

TEST(FiveBar, when_the_legs_cannot_meet_expect_a_plant_error_naming_the_angles) {
  const FiveBar equal(thesis_five_bar());
  for (const JointArray& angle : {JointArray{0.5, 0.5}, JointArray{0.5, -0.5}, JointArray{-1.6, 1.6}}) {
    EXPECT_THROW(equal.initial_state(angle, {}), PlantError);
  }
  const FiveBar short_passive(thesis_five_bar(0.1));
  EXPECT_NO_THROW(short_passive.initial_state({-0.5, 0.5}, {}));
  try {
    short_passive.initial_state({-1.25, 1.0}, {});
    FAIL() << "assembled";
  } catch (const PlantError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("cannot be assembled"), HasSubstr("-1.25")));
  }
}

TEST(FiveBar, when_the_passive_links_are_in_line_expect_a_plant_error_naming_the_singularity) {
  const FiveBar five_bar(thesis_five_bar());
  VectorXd y = five_bar.initial_state({-0.8, 0.8}, {}), y_dot(10);
  y.head<4>() << -0.02, 0.02, 0.02, -0.02;
  for (const auto& call : std::vector<std::function<void()>>{[&] { five_bar.derivative(0.25, y, y_dot); },
                                                             [&] { five_bar.make_consistent(0.25, y, y_dot); },
                                                             [&] { five_bar.sample(0.25, y); }}) {
    try {
      call();
      ADD_FAILURE() << "no error";
    } catch (const PlantError& error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr("singular configuration at t = 0.25 s"), HasSubstr("0.039989")));
    }
  }
  EXPECT_THROW(five_bar.initial_state({-0.02, 0.02}, {}), PlantError);
}

TEST(FiveBar, beyond_the_singularity_and_for_nan_the_residual_is_undefined) {
  const FiveBar five_bar(thesis_five_bar());
  for (const double angle : {-0.1, std::numeric_limits<double>::quiet_NaN()}) {
    VectorXd y = VectorXd::Zero(10), residual(10);
    y.head<4>() << -angle, angle, angle, -angle;
    five_bar.residual(0.0, y, VectorXd::Zero(10), residual);
    EXPECT_TRUE(residual.array().isNaN().all());
    EXPECT_THROW(five_bar.derivative(0.0, y, residual), PlantError);
  }
}

TEST(FiveBar, when_the_legs_are_far_apart_expect_a_plant_error_from_the_projection) {
  const FiveBar five_bar(thesis_five_bar());
  VectorXd y = VectorXd::Zero(10), y_dot(10);
  y.head<4>() << 2.0, -2.0, 1.0, -0.5;
  EXPECT_THROW(five_bar.make_consistent(0.0, y, y_dot), PlantError);
}

}  // namespace
}  // namespace quasilpv
