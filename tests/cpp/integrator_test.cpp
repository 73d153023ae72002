// IDA and Runge-Kutta against analytic solutions, against conservation laws, against each other, and when they fail.
#include "quasilpv/integrator.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <memory>

#include "arm_fixtures.hpp"
#include "decompositions.hpp"
#include "quasilpv/errors.hpp"
#include "quasilpv/ida_integrator.hpp"
#include "quasilpv/rk4_integrator.hpp"
#include "quasilpv/serial_arm.hpp"

namespace quasilpv {
namespace {

using Eigen::VectorXd;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::Modes;
using testing::modes_of;
using testing::point_pendulum;
using testing::three_link_arm;

constexpr double kSamplePeriod = 1e-3;

void advance_samples(Integrator& integrator, int samples, VectorXd& y) {
  for (int k = 0; k < samples; ++k) {
    integrator.advance(k * kSamplePeriod, (k + 1) * kSamplePeriod, y);
  }
}

class BothIntegrators : public ::testing::TestWithParam<const char*> {
 protected:
  static std::unique_ptr<Integrator> make(const Plant& plant) {
    const bool ida = std::string(GetParam()) == "ida";
    return make_integrator(ida ? IntegratorOptions(IdaOptions{}) : IntegratorOptions(Rk4Options{}), plant,
                           kSamplePeriod);
  }
};

TEST_P(BothIntegrators, a_small_pendulum_swing_is_a_cosine) {
  // I theta'' = -m g r sin theta; at 1e-3 rad the cubic term shifts the phase by 1e-6 of it.
  const double amplitude = 1e-3, length = 0.7;
  const SerialArm pendulum(point_pendulum(length));
  const auto integrator = make(pendulum);
  VectorXd y(2);
  y << amplitude, 0.0;
  const double frequency = std::sqrt(9.81 / length);
  for (int k = 0; k < 5000; ++k) {
    integrator->advance(k * kSamplePeriod, (k + 1) * kSamplePeriod, y);
    ASSERT_NEAR(y[0], amplitude * std::cos(frequency * (k + 1) * kSamplePeriod), 1e-5 * amplitude);
  }
}

TEST_P(BothIntegrators, each_small_mode_of_the_three_link_arm_swings_at_its_own_frequency) {
  const SerialArm arm(three_link_arm());
  // S' diag(g_k) S with the constants of the closed form, c1, c2, c3.
  Eigen::Matrix3d stiffness;
  const double c1 = 113.796, c2 = 60.587541, c3 = 16.4808;
  stiffness << c1 + c2 + c3, c2 + c3, c3, c2 + c3, c2 + c3, c3, c3, c3, c3;
  const Eigen::Matrix3d mass = arm.mass_matrix(VectorXd::Zero(3));
  const Modes modes = modes_of(stiffness, mass);
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d shape = modes.shape.col(i).normalized();
    const double frequency = std::sqrt(modes.squared_frequency[i]), amplitude = 1e-4;
    const auto integrator = make(arm);
    VectorXd y(6);
    y << amplitude * shape, Eigen::Vector3d::Zero();
    advance_samples(*integrator, 1000, y);
    EXPECT_LT((y.head(3) - amplitude * std::cos(frequency) * shape).norm(), 1e-4 * amplitude) << "mode " << i;
  }
}

TEST_P(BothIntegrators, free_motion_conserves_energy) {
  const SerialArm arm(three_link_arm());
  const auto integrator = make(arm);
  VectorXd y(6);
  y << 1.5, 0.5, 0.3, 0.0, 0.0, 0.0;
  const double before = arm.energy(y.head(3), y.tail(3));
  advance_samples(*integrator, 10000, y);
  // The swing turns some 150 J over and over; the tolerance of IDA allows 1e-8 per step.
  EXPECT_NEAR(arm.energy(y.head(3), y.tail(3)), before, 1e-3);
}

TEST_P(BothIntegrators, friction_only_takes_energy) {
  const SerialArm arm(three_link_arm(5.0));
  const auto integrator = make(arm);
  VectorXd y(6);
  y << 1.5, 0.5, 0.3, 0.0, 0.0, 0.0;
  double energy = arm.energy(y.head(3), y.tail(3));
  for (int k = 0; k < 2000; ++k) {
    integrator->advance(k * kSamplePeriod, (k + 1) * kSamplePeriod, y);
    const double now = arm.energy(y.head(3), y.tail(3));
    ASSERT_LT(now, energy + 1e-7);
    energy = now;
  }
  EXPECT_LT(energy, arm.energy(Eigen::Vector3d(1.5, 0.5, 0.3), VectorXd::Zero(3)) - 10.0);
}

TEST_P(BothIntegrators, a_constant_torque_on_a_free_rotor_gives_a_parabola) {
  SerialArmParameters rotor = point_pendulum(1.0, 0.0);
  rotor.links[0].inertia_kg_m2 = 2.0;
  SerialArm arm(rotor);
  const auto integrator = make(arm);
  VectorXd y(2);
  y << 0.1, -0.5;
  arm.set_torque({6.0});  // 3 rad/s^2
  advance_samples(*integrator, 1000, y);
  EXPECT_NEAR(y[0], 0.1 - 0.5 + 1.5, 1e-7);
  EXPECT_NEAR(y[1], -0.5 + 3.0, 1e-7);
}

TEST_P(BothIntegrators, the_external_torque_is_evaluated_continuously) {
  // theta'' = A sin(w t) / I: theta' = A (1 - cos w t) / (I w).
  SerialArm arm(point_pendulum(1.0, 0.0));
  arm.set_external_torque(ExternalTorque({{0, 450.0, 15.0, 0.0}}));
  const auto integrator = make(arm);
  VectorXd y = VectorXd::Zero(2);
  advance_samples(*integrator, 1000, y);
  EXPECT_NEAR(y[1], 450.0 / 15.0 * (1.0 - std::cos(15.0)), 1e-4);
}

INSTANTIATE_TEST_SUITE_P(IdaAndRungeKutta, BothIntegrators, ::testing::Values("ida", "rk4"),
                         [](const auto& test) { return std::string(test.param); });

TEST(Integrators, ida_and_runge_kutta_agree_under_torque_jumps) {
  const auto run = [](const IntegratorOptions& options) {
    SerialArm arm(three_link_arm(2.0));
    arm.set_external_torque(ExternalTorque({{0, 45.0, 15.0, 0.0}, {2, 30.0, 15.0, 0.0}}));
    const auto integrator = make_integrator(options, arm, kSamplePeriod);
    VectorXd y(6);
    y << 0.2, 1.2, -0.7, 0.0, 0.0, 0.0;
    for (int k = 0; k < 1000; ++k) {
      const double jump = k % 2 == 0 ? 20.0 : -10.0;
      arm.set_torque({40.0 + jump, 25.0 - jump, 5.0 + 0.2 * jump});
      integrator->advance(k * kSamplePeriod, (k + 1) * kSamplePeriod, y);
    }
    return y;
  };
  const VectorXd ida = run(IdaOptions{});
  const VectorXd rk4 = run(Rk4Options{4});
  EXPECT_LT((ida - rk4).head(3).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_LT((ida - rk4).tail(3).cwiseAbs().maxCoeff(), 1e-5);
}

TEST(Rk4Integrator, halving_the_step_divides_the_error_by_sixteen) {
  const SerialArm arm(three_link_arm());
  const auto end_state = [&](double step_s) {
    Rk4Integrator integrator(arm, step_s);
    VectorXd y(6);
    y << 1.0, 0.5, -0.3, 0.0, 0.0, 0.0;
    integrator.advance(0.0, 0.5, y);
    return y;
  };
  const VectorXd exact = end_state(2e-4);
  const double ratio = (end_state(1e-2) - exact).norm() / (end_state(5e-3) - exact).norm();
  EXPECT_GT(ratio, 14.0);
  EXPECT_LT(ratio, 18.0);
}

TEST(Rk4Integrator, an_interval_of_a_whole_number_of_steps_takes_exactly_those) {
  // 0.303 - 0.3 is above 3e-3 in floating point: rounding must not add a fourth step.
  const SerialArm arm(three_link_arm());
  VectorXd whole(6);
  whole << 1.0, 0.5, -0.3, 0.0, 0.0, 0.0;
  VectorXd parts = whole;
  Rk4Integrator integrator(arm, 1e-3);
  integrator.advance(0.3, 0.303, whole);
  Rk4Integrator long_steps(arm, 1.0);
  const double h = (0.303 - 0.3) / 3.0;
  for (int i = 0; i < 3; ++i) {
    long_steps.advance(0.3 + i * h, 0.3 + (i + 1) * h, parts);
  }
  EXPECT_LT((whole - parts).cwiseAbs().maxCoeff(), 1e-14);
}

TEST(Rk4Integrator, when_the_step_is_not_positive_expect_refusal) {
  const SerialArm arm(three_link_arm());
  EXPECT_THROW(Rk4Integrator(arm, 0.0), InputError);
  EXPECT_THROW(Rk4Integrator(arm, std::numeric_limits<double>::quiet_NaN()), InputError);
}

// y1' = -y1 + z, 0 = z - sin t, with z an algebraic component. Solution from y1(0) = -1/2: y1 = (sin t - cos t) / 2.
// From `nan_from_s` on the residual is undefined.
class FilteredSine final : public Plant {
 public:
  explicit FilteredSine(double nan_from_s = std::numeric_limits<double>::infinity()) : nan_from_s_(nan_from_s) {}

  int joints() const noexcept override { return 1; }
  int size() const noexcept override { return 2; }
  VectorXd differential() const override { return Eigen::Vector2d(1.0, 0.0); }
  VectorXd initial_state(const JointArray& angle, const JointArray& /*speed*/) const override {
    return Eigen::Vector2d(angle[0], 0.0);
  }
  void residual(double t, ConstVector y, ConstVector y_dot, Vector residual) const noexcept override {
    const double undefined = t >= nan_from_s_ ? std::numeric_limits<double>::quiet_NaN() : 0.0;
    residual << y_dot[0] + y[0] - y[1], y[1] - std::sin(t) + undefined;
  }
  void jacobian(double /*t*/, double c_j, ConstVector /*y*/, ConstVector /*y_dot*/,
                Matrix jacobian) const noexcept override {
    jacobian << c_j + 1.0, -1.0, 0.0, 1.0;
  }
  void derivative(double t, ConstVector y, Vector y_dot) const override { y_dot << -y[0] + std::sin(t), 0.0; }
  void make_consistent(double t, Vector y, Vector y_dot) const override {
    y[1] = std::sin(t);
    derivative(t, y, y_dot);
  }
  PlantSample sample(double /*t*/, ConstVector y) const override {
    PlantSample sample;
    sample.angle[0] = y[0];
    return sample;
  }

 private:
  double nan_from_s_;
};

TEST(IdaIntegrator, a_plant_with_an_algebraic_component_follows_its_analytic_solution) {
  const FilteredSine plant;
  IdaIntegrator ida(plant, IdaOptions{});
  VectorXd y = plant.initial_state({-0.5}, {});
  advance_samples(ida, 2000, y);
  EXPECT_NEAR(y[0], 0.5 * (std::sin(2.0) - std::cos(2.0)), 1e-6);
  EXPECT_NEAR(y[1], std::sin(2.0), 1e-8);
}

TEST(IdaIntegrator, F17_when_the_tolerance_is_below_rounding_expect_the_flag_by_name_and_the_state_untouched) {
  const SerialArm arm(three_link_arm());
  IdaIntegrator ida(arm, IdaOptions{1e-30, 1e-30});
  VectorXd y(6);
  y << 1.0, 0.5, -0.3, 0.1, 0.2, 0.3;
  const VectorXd before = y;
  try {
    ida.advance(0.0, kSamplePeriod, y);
    FAIL() << "integrated";
  } catch (const PlantError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("IDA_TOO_MUCH_ACC"), HasSubstr("t = 0")));
  }
  EXPECT_EQ(y, before);
}

TEST(IdaIntegrator, when_the_plant_is_undefined_from_the_start_expect_the_flag_by_name) {
  const FilteredSine plant(0.0);
  IdaIntegrator ida(plant, IdaOptions{});
  VectorXd y = plant.initial_state({-0.5}, {});
  try {
    ida.advance(0.0, kSamplePeriod, y);
    FAIL() << "integrated";
  } catch (const PlantError& error) {
    EXPECT_THAT(error.what(), HasSubstr("IDA_"));
    EXPECT_THAT(error.what(), HasSubstr("RES"));
  }
}

TEST(IdaIntegrator, F17_when_the_plant_becomes_undefined_expect_flag_and_the_time_it_happened) {
  const FilteredSine plant(0.0755);
  IdaIntegrator ida(plant, IdaOptions{});
  VectorXd y = plant.initial_state({-0.5}, {});
  try {
    ida.advance(0.0, 1.0, y);
    FAIL() << "integrated";
  } catch (const PlantError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("IDA_REP_RES_ERR"), HasSubstr("t = 0.07")));
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
  }
}

TEST(IdaIntegrator, after_a_failure_the_integrator_can_start_again) {
  const FilteredSine plant(0.0755);
  IdaIntegrator ida(plant, IdaOptions{});
  VectorXd y = plant.initial_state({-0.5}, {});
  EXPECT_THROW(ida.advance(0.0, 1.0, y), PlantError);
  EXPECT_NO_THROW(ida.advance(0.0, 0.05, y));
  EXPECT_NEAR(y[0], 0.5 * (std::sin(0.05) - std::cos(0.05)), 1e-6);
}

TEST(IdaIntegrator, uses_the_analytic_jacobian_and_not_residual_differences) {
  // Difference quotients would add 6 residual evaluations per Jacobian.
  const SerialArm arm(three_link_arm());
  IdaIntegrator ida(arm, IdaOptions{});
  VectorXd y(6);
  y << 1.0, 0.5, -0.3, 0.1, 0.2, 0.3;
  advance_samples(ida, 100, y);
  const IdaStatistics& work = ida.statistics();
  EXPECT_GT(work.steps, 100);
  EXPECT_GT(work.jacobians, 100);
  EXPECT_LT(work.residuals, 3 * work.steps);
  EXPECT_EQ(work.convergence_failures, 0);
}

TEST(ExternalTorque, when_a_term_names_no_joint_expect_refusal) {
  EXPECT_THROW(ExternalTorque({{7, 1.0, 1.0, 0.0}}), InputError);
  EXPECT_THROW(ExternalTorque({{-1, 1.0, 1.0, 0.0}}), InputError);
}

TEST(ExternalTorque, terms_on_one_joint_add_up) {
  const ExternalTorque external({{1, 2.0, 3.0, 0.5}, {1, 4.0, 5.0, 0.0}, {0, 1.0, 0.0, 1.5707963267948966}});
  const JointArray torque = external.at(0.7);
  EXPECT_DOUBLE_EQ(torque[0], 1.0);
  EXPECT_NEAR(torque[1], 2.0 * std::sin(2.6) + 4.0 * std::sin(3.5), 1e-14);
  EXPECT_EQ(torque[2], 0.0);
}

}  // namespace
}  // namespace quasilpv
