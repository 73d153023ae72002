// The plant session and the closed loop in one process.
#include "quasilpv/simulation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <string>

#include "arm_fixtures.hpp"
#include "quasilpv/errors.hpp"
#include "quasilpv/plant_session.hpp"

namespace quasilpv {
namespace {

using ::testing::HasSubstr;

constexpr double kSamplePeriod = 1e-3;

// One rotor of 1 kg m^2 without gravity: theta'' = torque, known in closed form.
Scenario free_rotor(double duration_s = 0.01) {
  Scenario scenario;
  scenario.name = "free rotor";
  scenario.duration_s = duration_s;
  scenario.plant = [] { return std::make_unique<SerialArm>(testing::point_pendulum(1.0, 0.0)); };
  scenario.integrator = Rk4Options{};
  return scenario;
}

// The three-link arm held at a moving reference by a PD law with gravity compensation, under external torque.
Scenario tracking_arm() {
  Scenario scenario;
  scenario.name = "tracking arm";
  scenario.duration_s = 1.0;
  scenario.plant = [] { return std::make_unique<SerialArm>(testing::three_link_arm(1.0)); };
  scenario.external_torque = {{0, 450.0, 15.0, 0.0}, {1, 375.0, 15.0, 0.0}, {2, 300.0, 15.0, 0.0}};
  scenario.initial_angle = {0.2, 1.2, -0.7};
  return scenario;
}

Reference moving_reference(double t) {
  Reference reference;
  reference.angle = {0.2 + 0.1 * (1.0 - std::cos(2.0 * t)), 1.2, -0.7};
  reference.speed = {0.2 * std::sin(2.0 * t)};
  reference.acceleration = {0.4 * std::cos(2.0 * t)};
  return reference;
}

StepReport pd_with_gravity(const SerialArm& arm, const StepInput& input) {
  const Eigen::Map<const Eigen::Vector3d> angle(input.angle.data()), speed(input.speed.data());
  const Eigen::Map<const Eigen::Vector3d> target(input.reference.angle.data()), rate(input.reference.speed.data());
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  const Eigen::Vector3d torque =
      arm.mass_matrix(angle) * Eigen::Vector3d(3600.0 * (target - angle) + 120.0 * (rate - speed)) +
      arm.inverse_dynamics(angle, zero, zero);
  StepReport report;
  report.seq = input.seq;
  std::copy(torque.data(), torque.data() + 3, report.torque_commanded.begin());
  report.torque_applied = report.torque_commanded;
  report.flags = input.seq == 5 ? kTorqueSaturated : kStepHealthy;
  return report;
}

RunRecord track(const Scenario& scenario) {
  const SerialArm model(testing::three_link_arm());
  return run_closed_loop(
      scenario, kSamplePeriod, [&](const StepInput& input) { return pd_with_gravity(model, input); }, moving_reference);
}

double largest_difference(const RunRecord& a, const RunRecord& b, const std::string& column) {
  const auto& x = a.samples[column].values;
  const auto& y = b.samples[column].values;
  EXPECT_EQ(x.size(), y.size());
  double largest = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    largest = std::max(largest, std::abs(x[i] - y[i]));
  }
  return largest;
}

std::string csv(const RunRecord& run) {
  std::ostringstream out;
  CsvWriter writer(out);
  run.samples.write_csv(writer);
  return out.str();
}

class TransportDelay : public ::testing::TestWithParam<double> {};

TEST_P(TransportDelay, the_old_torque_acts_until_the_delay_has_passed) {
  const double delay = GetParam(), period = kSamplePeriod;
  Scenario scenario = free_rotor();
  scenario.transport_delay_s = delay;
  PlantSession session(scenario, period);
  session.advance(0, {2.0});
  EXPECT_NEAR(session.truth().speed[0], 2.0 * (period - delay), 1e-15);
  EXPECT_NEAR(session.truth().angle[0], (period - delay) * (period - delay), 1e-18);
  session.advance(1, {-1.0});
  EXPECT_NEAR(session.truth().speed[0], 2.0 * period - (period - delay), 1e-15);
  EXPECT_EQ(session.torque()[0], -1.0);
}

INSTANTIATE_TEST_SUITE_P(UpToOneSample, TransportDelay, ::testing::Values(0.0, 2.5e-4, 5e-4, 1e-3));

TEST(PlantSession, of_a_torque_beyond_the_actuators_their_limit_acts) {
  Scenario scenario = free_rotor();
  scenario.torque_limit_nm = JointArray{1.5};
  PlantSession session(scenario, kSamplePeriod);
  session.advance(0, {2.0});
  EXPECT_NEAR(session.truth().speed[0], 1.5 * kSamplePeriod, 1e-15);
  session.advance(1, {-7.0});
  EXPECT_NEAR(session.truth().speed[0], 0.0, 1e-15);
  EXPECT_EQ(session.torque()[0], -1.5);
}

TEST(PlantSession, a_delay_within_nanoseconds_of_a_sample_boundary_does_not_trouble_ida) {
  for (const double sliver : {1e-18, 5e-10, 2e-9, 1e-7}) {
    Scenario scenario = free_rotor();
    scenario.integrator = IdaOptions{};
    PlantSession session(scenario, kSamplePeriod);
    session.advance(0, {2.0}, sliver);
    session.advance(1, {2.0}, kSamplePeriod - sliver);
    EXPECT_NEAR(session.truth().speed[0], 2.0 * (2.0 * kSamplePeriod - sliver), 1e-8);
  }
}

TEST(PlantSession, a_delay_given_with_the_command_replaces_that_of_the_scenario) {
  PlantSession session(free_rotor(), kSamplePeriod);
  session.advance(0, {2.0}, 7.5e-4);
  EXPECT_NEAR(session.truth().speed[0], 2.0 * 2.5e-4, 1e-15);
  session.advance(1, {0.0}, 1.0);  // later than the sample: acts from its end
  EXPECT_NEAR(session.truth().speed[0], 2.0 * 1.25e-3, 1e-15);
}

TEST(PlantSession, truth_holds_the_acceleration_before_the_new_torque_acts) {
  for (const double delay : {0.0, 5e-4}) {
    PlantSession session(free_rotor(), kSamplePeriod);
    EXPECT_EQ(session.truth().acceleration[0], 0.0);
    session.advance(0, {2.0}, delay);
    EXPECT_NEAR(session.truth().acceleration[0], 2.0, 1e-15);
    session.advance(1, {-1.0}, delay);
    EXPECT_NEAR(session.truth().acceleration[0], -1.0, 1e-15);
  }
  PlantSession session(free_rotor(), kSamplePeriod);
  session.advance(0, {2.0}, kSamplePeriod);  // torque 0 acts from t_1 on, so not yet in the left limit at t_1
  EXPECT_EQ(session.truth().acceleration[0], 0.0);
}

TEST(PlantSession, asking_twice_for_a_measurement_gives_the_same_noise) {
  Scenario scenario = free_rotor();
  scenario.sensors = {0, 0.1, 1};
  PlantSession session(scenario, kSamplePeriod);
  const JointArray first = session.measure(0).speed;
  EXPECT_NE(first[0], 0.0);
  EXPECT_EQ(session.measure(0).speed, first);
  session.advance(0, {});
  EXPECT_NE(session.measure(1).speed, first);
}

TEST(PlantSession, when_a_sample_is_asked_for_out_of_turn_expect_refusal) {
  PlantSession session(free_rotor(), kSamplePeriod);
  EXPECT_THROW(session.measure(1), InputError);
  EXPECT_THROW(session.advance(1, {}), InputError);
  session.advance(0, {});
  EXPECT_THROW(session.measure(0), InputError);
}

TEST(PlantSession, when_delay_period_or_duration_do_not_fit_expect_refusal_naming_the_field) {
  const auto refused_field = [](const Scenario& scenario, double period) -> std::string {
    try {
      const PlantSession session(scenario, period);
      return "accepted";
    } catch (const InputError& error) {
      return error.field();
    }
  };
  Scenario scenario = free_rotor();
  scenario.transport_delay_s = 1.1e-3;
  EXPECT_EQ(refused_field(scenario, 1e-3), "transport_delay_s");
  EXPECT_EQ(refused_field(scenario, 2e-3), "accepted");
  EXPECT_EQ(refused_field(free_rotor(), 0.0), "sample period");
  EXPECT_EQ(refused_field(free_rotor(), std::numeric_limits<double>::quiet_NaN()), "sample period");
  EXPECT_EQ(refused_field(free_rotor(4e-4), 1e-3), "duration_s");
}

TEST(PlantSession, when_the_torque_is_not_a_number_expect_a_plant_error_from_either_integrator) {
  for (const IntegratorOptions& integrator : {IntegratorOptions(IdaOptions{}), IntegratorOptions(Rk4Options{})}) {
    Scenario scenario = tracking_arm();
    scenario.integrator = integrator;
    PlantSession session(scenario, kSamplePeriod);
    EXPECT_THROW(session.advance(0, {std::numeric_limits<double>::quiet_NaN()}), PlantError);
  }
}

TEST(ClosedLoop, two_runs_are_equal_to_the_bit) {
  Scenario scenario = tracking_arm();
  scenario.sensors = {20, 0.05, 7};
  scenario.transport_delay_s = 5e-4;
  const std::string first = csv(track(scenario));
  EXPECT_EQ(first, csv(track(scenario)));
  scenario.sensors.seed = 8;
  EXPECT_NE(first, csv(track(scenario)));
}

TEST(ClosedLoop, ida_and_runge_kutta_agree_to_a_millionth_of_a_radian) {
  for (const double delay : {0.0, 5e-4}) {
    Scenario scenario = tracking_arm();
    scenario.transport_delay_s = delay;
    const RunRecord ida = track(scenario);
    scenario.integrator = Rk4Options{4};
    const RunRecord rk4 = track(scenario);
    EXPECT_LT(largest_difference(ida, rk4, "angle_rad"), 1e-6);
    EXPECT_LT(largest_difference(ida, rk4, "speed_rad_s"), 1e-4);
  }
}

TEST(ClosedLoop, has_one_sample_per_period_and_records_what_went_in_and_out) {
  const RunRecord run = track(tracking_arm());
  EXPECT_EQ(run.joints, 3);
  EXPECT_EQ(run.sample_period_s, kSamplePeriod);
  EXPECT_EQ(run.flags, kTorqueSaturated);
  EXPECT_EQ(run.samples["time_s"].samples(), 1000u);
  for (const Record::Column& column : run.samples.columns()) {
    EXPECT_EQ(column.samples(), 1000u) << column.name;
  }
  const auto at = [&](const char* name, std::size_t k, std::size_t joint) {
    const Record::Column& column = run.samples[name];
    return column.values[k * column.width + joint];
  };
  EXPECT_EQ(at("flags", 5, 0), 4.0);
  EXPECT_EQ(at("time_s", 999, 0), 999 * kSamplePeriod);
  EXPECT_EQ(at("angle_rad", 0, 1), 1.2);
  EXPECT_EQ(at("measured_angle_rad", 500, 2), at("angle_rad", 500, 2));
  EXPECT_EQ(at("reference_speed_rad_s", 500, 0), 0.2 * std::sin(2.0 * 0.5));
  EXPECT_NEAR(at("external_torque_nm", 500, 0), 450.0 * std::sin(15.0 * 0.5), 1e-9);
}

TEST(ClosedLoop, recorded_accelerations_obey_the_equations_of_motion_of_the_torque_before) {
  const RunRecord run = track(tracking_arm());
  const SerialArm arm(testing::three_link_arm(1.0));
  const auto joints = [&](const char* name, std::size_t k) {
    return Eigen::Map<const Eigen::Vector3d>(&run.samples[name].values[3 * k]);
  };
  for (std::size_t k = 1; k < 1000; k += 37) {
    const Eigen::Vector3d needed =
        arm.inverse_dynamics(joints("angle_rad", k), joints("speed_rad_s", k), joints("acceleration_rad_s2", k));
    const Eigen::Vector3d given = joints("torque_applied_nm", k - 1) + joints("external_torque_nm", k);
    EXPECT_LT((needed - given).cwiseAbs().maxCoeff(), 1e-9);
  }
}

TEST(ClosedLoop, encoder_resolution_bounds_the_measurement_error) {
  Scenario scenario = tracking_arm();
  scenario.sensors.encoder_bits = 17;
  const RunRecord run = track(scenario);
  const auto& truth = run.samples["angle_rad"].values;
  const auto& measured = run.samples["measured_angle_rad"].values;
  double largest = 0.0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    largest = std::max(largest, std::abs(truth[i] - measured[i]));
  }
  const double quantum = 2.0 * std::acos(-1.0) / 131072.0;
  EXPECT_LE(largest, 0.5 * quantum * (1.0 + 1e-9));
  EXPECT_GT(largest, 0.4 * quantum);
}

TEST(ClosedLoop, when_the_law_returns_nan_expect_a_plant_error_and_no_record) {
  const auto nan_at_third = [](const StepInput& input) {
    StepReport report;
    report.torque_applied[0] = input.seq == 3 ? std::numeric_limits<double>::quiet_NaN() : 0.0;
    return report;
  };
  EXPECT_THROW(run_closed_loop(tracking_arm(), kSamplePeriod, nan_at_third, moving_reference), PlantError);
}

}  // namespace
}  // namespace quasilpv
