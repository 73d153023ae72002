// The spring-disc against its reduced truth, against differences, and the rolling condition.
#include "quasilpv/spring_disc.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include "arm_fixtures.hpp"
#include "quasilpv/errors.hpp"
#include "quasilpv/ida_integrator.hpp"
#include "quasilpv/rk4_integrator.hpp"

namespace quasilpv {
namespace {

using Eigen::Vector4d;
using Eigen::VectorXd;
using testing::derivative_at_zero;
using ::testing::HasSubstr;
using testing::Uniform;

constexpr double kSamplePeriod = 1e-3;

/// Example III.12 of Dehak 2022 with its largest uncertainty: 1/J_delta = 1/4 + 3/4.
SpringDiscParameters thesis_disc() { return {"disc", 0.1, 2.0, 4.0, 3.0, 1.0, 1.0, 2.0}; }

SpringDiscParameters random_disc(Uniform& uniform) {
  return {"random",          uniform(0.1, 5.0), uniform(0.2, 2.0), uniform(0.5, 5.0),
          uniform(0.0, 3.0), uniform(0.0, 5.0), uniform(0.0, 5.0), uniform(0.0, 3.0)};
}

TEST(SpringDisc, rolls_as_its_reduced_equation_of_second_order_says) {
  // (M + J_delta / r^2) x1'' = -k1 x1 - k2 x1^3 - b x1' + u / r
  Uniform uniform(1);
  for (int i = 0; i < 200; ++i) {
    const SpringDiscParameters p = random_disc(uniform);
    SpringDisc disc(p);
    const double u = uniform(-10.0, 10.0);
    disc.set_torque({u});
    const VectorXd y = disc.initial_state({uniform(-2.0, 2.0)}, {uniform(-3.0, 3.0)});
    VectorXd y_dot(4);
    disc.derivative(0.0, y, y_dot);
    const double inertia = 1.0 / (1.0 / p.inertia_kg_m2 + p.inertia_uncertainty_per_kg / (p.radius_m * p.radius_m));
    const double force =
        -p.stiffness_n_m * y[0] - p.cubic_stiffness_n_m3 * std::pow(y[0], 3) - p.damping_n_s_m * y[1] + u / p.radius_m;
    const double acceleration = force / (p.mass_kg + inertia / (p.radius_m * p.radius_m));
    EXPECT_NEAR(y_dot[1], acceleration, 1e-12 * (1.0 + std::abs(force / p.mass_kg)));
    EXPECT_NEAR(y_dot[2] * p.radius_m, acceleration, 1e-11 * (1.0 + std::abs(force / p.mass_kg)));
    EXPECT_NEAR(disc.sample(0.0, y).acceleration[0] * p.radius_m, acceleration,
                1e-11 * (1.0 + std::abs(force / p.mass_kg)));
  }
}

TEST(SpringDisc, contact_force_of_the_thesis_example_is_consistent) {
  // x1(0) = -5 m, x2(0) = 10 m/s, J_delta = 1: x3 = 5 rad/s and lambda = -1100 / 14 N.
  const SpringDisc disc(thesis_disc());
  VectorXd y = disc.initial_state({-2.5}, {5.0}), y_dot(4);
  disc.make_consistent(0.0, y, y_dot);
  EXPECT_EQ(y[0], -5.0);
  EXPECT_EQ(y[1], 10.0);
  EXPECT_EQ(y[2], 5.0);
  EXPECT_NEAR(y[3], -1100.0 / 14.0, 1e-12);
}

TEST(SpringDisc, jacobian_equals_differences_of_the_residual) {
  Uniform uniform(2);
  for (const double c_j : {0.0, 1.0, 1e3}) {
    const SpringDisc disc(random_disc(uniform));
    const Vector4d y = uniform.vector(4, 3.0), y_dot = uniform.vector(4, 5.0);
    Eigen::MatrixXd jacobian = Eigen::MatrixXd::Constant(4, 4, std::numeric_limits<double>::quiet_NaN());
    disc.jacobian(0.0, c_j, y, y_dot, jacobian);
    for (int j = 0; j < 4; ++j) {
      const Vector4d expected = derivative_at_zero(
          [&](double s) -> Vector4d {
            VectorXd residual(4);
            disc.residual(0.0, y + s * Vector4d::Unit(j), y_dot + c_j * s * Vector4d::Unit(j), residual);
            return residual;
          },
          1e-3);
      EXPECT_LT((jacobian.col(j) - expected).cwiseAbs().maxCoeff(), 1e-8 * (1.0 + expected.cwiseAbs().maxCoeff()));
    }
  }
}

TEST(SpringDisc, consistent_values_roll_and_make_the_residual_zero_under_torque_and_disturbance) {
  Uniform uniform(3);
  for (int i = 0; i < 200; ++i) {
    SpringDisc disc(random_disc(uniform));
    disc.set_torque({uniform(-10.0, 10.0)});
    disc.set_external_torque(ExternalTorque({{0, 5.0, 7.0, 0.3}}));
    VectorXd y = uniform.vector(4, 3.0), y_dot(4), residual(4);
    const double r = disc.parameters().radius_m;
    const VectorXd before = y;
    disc.make_consistent(0.4, y, y_dot);
    disc.residual(0.4, y, y_dot, residual);
    EXPECT_LT(residual.cwiseAbs().maxCoeff(), 1e-11 * (1.0 + y.cwiseAbs().maxCoeff() + y_dot.cwiseAbs().maxCoeff()));
    EXPECT_NEAR(disc.slip(y), 0.0, 1e-14 * (1.0 + std::abs(y[1])));
    // The impulse acts at the contact: what the centre gains, times r, the disc loses.
    const double inertia =
        1.0 / (1.0 / disc.parameters().inertia_kg_m2 + disc.parameters().inertia_uncertainty_per_kg / (r * r));
    EXPECT_NEAR(disc.parameters().mass_kg * (y[1] - before[1]) * r, -inertia * (y[2] - before[2]), 1e-11);
  }
}

TEST(SpringDisc, ida_and_runge_kutta_agree_and_the_disc_does_not_slip) {
  const auto run = [](const IntegratorOptions& options) {
    SpringDisc disc(thesis_disc());
    const auto integrator = make_integrator(options, disc, kSamplePeriod);
    VectorXd y = disc.initial_state({-2.5}, {5.0});
    for (int k = 0; k < 5000; ++k) {
      disc.set_torque({k % 100 < 50 ? 2.0 : -1.0});
      integrator->advance(k * kSamplePeriod, (k + 1) * kSamplePeriod, y);
      EXPECT_NEAR(disc.slip(y), 0.0, 1e-9);
    }
    return y;
  };
  const VectorXd ida = run(IdaOptions{}), rk4 = run(Rk4Options{4});
  EXPECT_LT((ida - rk4).head(3).cwiseAbs().maxCoeff(), 1e-6);
}

TEST(SpringDisc, without_damper_the_rolling_disc_conserves_energy) {
  SpringDiscParameters p = thesis_disc();
  p.damping_n_s_m = 0.0;
  const SpringDisc disc(p);
  const auto energy = [&](const VectorXd& y) {  // J_delta = 1
    return 0.5 * p.mass_kg * y[1] * y[1] + 0.5 * y[2] * y[2] + 0.5 * y[0] * y[0] + 0.25 * std::pow(y[0], 4);
  };
  IdaIntegrator ida(disc, IdaOptions{});
  VectorXd y = disc.initial_state({-0.5}, {1.0});
  const double before = energy(y);
  ida.advance(0.0, 10.0, y);
  EXPECT_NEAR(energy(y), before, 1e-5);
}

TEST(SpringDisc, when_a_parameter_is_not_physical_expect_refusal_naming_it) {
  const auto refusal = [](const SpringDiscParameters& parameters) -> std::string {
    try {
      const SpringDisc refused(parameters);
      return "accepted";
    } catch (const InputError& error) {
      return error.field();
    }
  };
  SpringDiscParameters p = thesis_disc();
  p.mass_kg = 0.0;
  EXPECT_THAT(refusal(p), HasSubstr("mass_kg"));
  p = thesis_disc();
  p.radius_m = -1.0;
  EXPECT_THAT(refusal(p), HasSubstr("radius_m"));
  p = thesis_disc();
  p.inertia_kg_m2 = 0.0;
  EXPECT_THAT(refusal(p), HasSubstr("inertia_kg_m2"));
  p = thesis_disc();
  p.inertia_uncertainty_per_kg = -1.0;
  EXPECT_THAT(refusal(p), HasSubstr("inertia_uncertainty_per_kg"));
  p = thesis_disc();
  p.stiffness_n_m = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(refusal(p), HasSubstr("stiffness_n_m"));
  p = thesis_disc();
  p.cubic_stiffness_n_m3 = -1.0;
  EXPECT_THAT(refusal(p), HasSubstr("cubic_stiffness_n_m3"));
  p = thesis_disc();
  p.damping_n_s_m = std::numeric_limits<double>::infinity();
  EXPECT_THAT(refusal(p), HasSubstr("damping_n_s_m"));
}

}  // namespace
}  // namespace quasilpv
