// The five-bar in motion: formulations and integrators against a reduced model, drift of constraint and energy. Unequal
// legs: with equal ones the constraint is linear, and every integrator keeps it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "five_bar_fixtures.hpp"
#include "quasilpv/errors.hpp"
#include "quasilpv/five_bar.hpp"
#include "quasilpv/ida_integrator.hpp"
#include "quasilpv/rk4_integrator.hpp"

namespace quasilpv {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector4d;
using Eigen::VectorXd;
using ::testing::HasSubstr;
using testing::thesis_five_bar;

constexpr double kSamplePeriod = 1e-3;
constexpr double kPassiveLength = 0.2;

/// The five-bar without constraint: y = (th, w), passive joints from the triangle of the elbows and the tool. With
/// v = T w, T = [1; R] and the remaining acceleration T w' + (0, s), the equations of motion are projected onto T.
class ReducedFiveBar final : public Plant {
 public:
  explicit ReducedFiveBar(const FiveBarParameters& parameters) : five_bar_(parameters) {}

  int joints() const noexcept override { return 2; }
  int size() const noexcept override { return 4; }
  VectorXd initial_state(const JointArray& angle, const JointArray& speed) const override {
    return Vector4d(angle[0], angle[1], speed[0], speed[1]);
  }
  void residual(double t, ConstVector y, ConstVector y_dot, Vector residual) const noexcept override {
    derivative(t, y, residual);
    residual = y_dot - residual;
  }
  void jacobian(double, double, ConstVector, ConstVector, Matrix) const noexcept override {}
  void derivative(double t, ConstVector y, Vector y_dot) const override {
    const Vector2d th = y.head<2>(), w = y.tail<2>();
    const double a = five_bar_.parameters().active.length_m, b = five_bar_.parameters().passive.length_m;
    const double direction = 0.5 * th.sum(), spread = std::asin(a * std::sin(0.5 * (th[1] - th[0])) / b);
    const Vector4d phi(th[0], th[1], direction + spread, direction - spread);
    const Eigen::Matrix<double, 2, 4> J = five_bar_.constraint_jacobian(phi);
    const Matrix2d passive_inverse = J.rightCols<2>().inverse();
    Eigen::Matrix<double, 4, 2> T;
    T << Matrix2d::Identity(), -passive_inverse * J.leftCols<2>();
    const Vector4d v = T * w;
    Vector2d bias = Vector2d::Zero();
    const double length[4] = {a, -a, b, -b};
    for (int i = 0; i < 4; ++i) {
      bias -= length[i] * v[i] * v[i] * Vector2d(std::cos(phi[i]), std::sin(phi[i]));
    }
    Vector4d rest;
    rest << Vector2d::Zero(), -passive_inverse * bias;
    const JointArray torque = joint_torque(t);
    const Vector2d force = Vector2d(torque[0], torque[1]) - T.transpose() * five_bar_.inverse_dynamics(phi, v, rest);
    y_dot << w, (T.transpose() * five_bar_.mass_matrix(phi) * T).inverse() * force;
  }
  PlantSample sample(double, ConstVector y) const override { return {{y[0], y[1]}, {y[2], y[3]}, {}, {}}; }

 private:
  FiveBar five_bar_;
};

// The tool is led around by PD control at 1 kHz, with gravity and a disturbance left to it.
JointArray tracking_torque(double t, const PlantSample& now) {
  constexpr double kStiffness = 60.0, kDamping = 0.8;  // N m, N m s
  JointArray torque{};
  const double centre[2] = {-0.75, 0.75}, amplitude[2] = {0.35, 0.25}, frequency[2] = {4.0, 6.0};
  for (std::size_t j = 0; j < 2; ++j) {
    const double reference = centre[j] + amplitude[j] * std::sin(frequency[j] * t);
    const double rate = amplitude[j] * frequency[j] * std::cos(frequency[j] * t);
    torque[j] = kStiffness * (reference - now.angle[j]) + kDamping * (rate - now.speed[j]);
  }
  return torque;
}

/// States at the end of every sample of the closed loop, the integrator's own: nothing is projected afterwards.
std::vector<VectorXd> closed_loop(Plant& plant, Integrator& integrator, int samples) {
  plant.set_external_torque(ExternalTorque({{0, 5.0, 50.0, 0.0}, {1, 5.0, 5.0, 0.0}}));
  std::vector<VectorXd> states;
  VectorXd y = plant.initial_state({-0.75, 0.75}, {1.4, 1.5});
  for (int k = 0; k < samples; ++k) {
    const double t = k * kSamplePeriod;
    plant.set_torque(tracking_torque(t, plant.sample(t, y)));
    integrator.advance(t, t + kSamplePeriod, y);
    states.push_back(y);
  }
  return states;
}

FiveBarParameters unequal_five_bar(FiveBarFormulation formulation) {
  FiveBarParameters parameters = thesis_five_bar(kPassiveLength);
  parameters.formulation = formulation;
  return parameters;
}

double largest_gap(const FiveBar& five_bar, const std::vector<VectorXd>& states) {
  double gap = 0.0;
  for (const VectorXd& y : states) {
    gap = std::max(gap, five_bar.constraint(y.head<4>()).norm());
  }
  return gap;
}

double largest_angle_difference(const std::vector<VectorXd>& a, const std::vector<VectorXd>& b) {
  double difference = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    difference = std::max(difference, (a[k].head<2>() - b[k].head<2>()).cwiseAbs().maxCoeff());
  }
  return difference;
}

TEST(FiveBarMotion, index_1_index_2_and_runge_kutta_follow_the_reduced_model_in_closed_loop) {
  constexpr int kSamples = 3000;
  ReducedFiveBar reduced(unequal_five_bar(FiveBarFormulation::kIndex1));
  Rk4Integrator fine_steps(reduced, kSamplePeriod / 20.0);
  const std::vector<VectorXd> expected = closed_loop(reduced, fine_steps, kSamples);
  EXPECT_GT(largest_angle_difference(expected, {expected.rbegin(), expected.rend()}), 0.3);  // it moves
  for (const FiveBarFormulation formulation : {FiveBarFormulation::kIndex1, FiveBarFormulation::kGgl}) {
    FiveBar five_bar(unequal_five_bar(formulation));
    IdaIntegrator ida(five_bar, IdaOptions{});
    EXPECT_LT(largest_angle_difference(closed_loop(five_bar, ida, kSamples), expected), 1e-6);
  }
  FiveBar five_bar(unequal_five_bar(FiveBarFormulation::kIndex1));
  Rk4Integrator rk4(five_bar, kSamplePeriod);
  EXPECT_LT(largest_angle_difference(closed_loop(five_bar, rk4, kSamples), expected), 1e-6);
}

TEST(FiveBarMotion, the_legs_stay_together_over_ten_seconds_of_closed_loop) {
  constexpr int kSamples = 10000;
  for (const FiveBarFormulation formulation : {FiveBarFormulation::kIndex1, FiveBarFormulation::kGgl}) {
    FiveBar five_bar(unequal_five_bar(formulation));
    IdaIntegrator ida(five_bar, IdaOptions{});
    EXPECT_LT(largest_gap(five_bar, closed_loop(five_bar, ida, kSamples)), 1e-9);
  }
}

// Held by springs and left alone, from rest.
FiveBarParameters sprung_five_bar(FiveBarFormulation formulation) {
  FiveBarParameters parameters = unequal_five_bar(formulation);
  parameters.spring_nm_rad = 2.0;
  parameters.spring_rest_rad = {-0.8, 0.8};
  return parameters;
}

double energy_of(const FiveBar& five_bar, const VectorXd& y) { return five_bar.energy(y.head<4>(), y.segment<4>(4)); }

TEST(FiveBarMotion, ten_seconds_of_one_integration_conserve_energy_and_keep_the_legs_together) {
  for (const FiveBarFormulation formulation : {FiveBarFormulation::kIndex1, FiveBarFormulation::kGgl}) {
    const FiveBar five_bar(sprung_five_bar(formulation));
    IdaIntegrator ida(five_bar, IdaOptions{});
    VectorXd y = five_bar.initial_state({-1.0, 0.9}, {});
    const double before = energy_of(five_bar, y);
    ida.advance(0.0, 10.0, y);
    EXPECT_NEAR(energy_of(five_bar, y), before, 1e-6);
    EXPECT_LT(five_bar.constraint(y.head<4>()).norm(), 5e-9);
  }
}

TEST(FiveBarMotion, restarts_at_every_sample_conserve_energy_at_a_tighter_tolerance) {
  const FiveBar five_bar(sprung_five_bar(FiveBarFormulation::kIndex1));
  IdaIntegrator ida(five_bar, IdaOptions{1e-10, 1e-12});
  VectorXd y = five_bar.initial_state({-1.0, 0.9}, {});
  const double before = energy_of(five_bar, y);
  for (int k = 0; k < 10000; ++k) {
    ida.advance(k * kSamplePeriod, (k + 1) * kSamplePeriod, y);
    ASSERT_NEAR(energy_of(five_bar, y), before, 1e-6);
    ASSERT_LT(five_bar.constraint(y.head<4>()).norm(), 1e-9);
  }
}

TEST(FiveBarMotion, without_stabilisation_the_legs_drift_apart) {
  const auto gap_after_ten_seconds = [](double baumgarte_per_s) {
    FiveBarParameters parameters = sprung_five_bar(FiveBarFormulation::kIndex1);
    parameters.baumgarte_per_s = baumgarte_per_s;
    const FiveBar five_bar(parameters);
    IdaIntegrator ida(five_bar, IdaOptions{});
    VectorXd y = five_bar.initial_state({-1.0, 0.9}, {});
    ida.advance(0.0, 10.0, y);
    return five_bar.constraint(y.head<4>()).norm();
  };
  EXPECT_GT(gap_after_ten_seconds(0.0), 10.0 * gap_after_ten_seconds(50.0));
}

TEST(FiveBarMotion, friction_only_takes_energy) {
  FiveBarParameters parameters = sprung_five_bar(FiveBarFormulation::kIndex1);
  parameters.active.friction_nm_s = 1e-3;
  parameters.passive.friction_nm_s = 1e-3;
  const FiveBar five_bar(parameters);
  IdaIntegrator ida(five_bar, IdaOptions{});
  VectorXd y = five_bar.initial_state({-1.0, 0.9}, {});
  const double start = energy_of(five_bar, y);
  double energy = start;
  for (int k = 0; k < 2000; ++k) {
    ida.advance(k * kSamplePeriod, (k + 1) * kSamplePeriod, y);
    const double now = energy_of(five_bar, y);
    ASSERT_LT(now, energy + 1e-9);
    energy = now;
  }
  EXPECT_LT(energy, start - 1e-2);
}

TEST(FiveBarMotion, F17_a_five_bar_that_falls_shut_is_stopped_by_name) {
  for (const char* integrator : {"ida", "rk4"}) {
    const FiveBar five_bar(thesis_five_bar());
    const auto falling = make_integrator(
        std::string(integrator) == "ida" ? IntegratorOptions(IdaOptions{}) : IntegratorOptions(Rk4Options{}), five_bar,
        kSamplePeriod);
    VectorXd y = five_bar.initial_state({-0.8, 0.8}, {});
    try {
      for (int k = 0; k < 400; ++k) {
        falling->advance(k * kSamplePeriod, (k + 1) * kSamplePeriod, y);
      }
      ADD_FAILURE() << integrator << " went through the singularity";
    } catch (const PlantError& error) {
      EXPECT_THAT(error.what(), HasSubstr("five-bar 'five-bar': singular configuration at t = 0.1"));
    }
  }
}

}  // namespace
}  // namespace quasilpv
