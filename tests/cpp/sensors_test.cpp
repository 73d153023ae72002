// Encoder and speed noise.
#include "quasilpv/sensors.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "arm_fixtures.hpp"

namespace quasilpv {
namespace {

using testing::Uniform;

constexpr double kTwoPi = 6.283185307179586;
constexpr double kPeriod = 1e-3;

class EncoderOfBits : public ::testing::TestWithParam<int> {};

TEST_P(EncoderOfBits, reads_the_nearest_multiple_of_its_quantum) {
  Sensors sensors({GetParam(), 0.0, 0}, 1, kPeriod);
  const double quantum = kTwoPi / std::pow(2.0, GetParam());
  EXPECT_DOUBLE_EQ(sensors.angle_quantum_rad(), quantum);
  Uniform uniform(11);
  double largest_error = 0.0;
  for (int i = 0; i < 2000; ++i) {
    const double angle = uniform(-7.0, 7.0);
    const double read = sensors.measure(i, PlantSample{{angle}}).angle[0];
    const double counts = read / quantum;
    EXPECT_NEAR(counts, std::round(counts), 1e-9 * std::max(1.0, std::abs(counts)));
    EXPECT_LE(std::abs(read - angle), 0.5 * quantum * (1.0 + 1e-9));
    largest_error = std::max(largest_error, std::abs(read - angle));
  }
  EXPECT_GT(largest_error, 0.49 * quantum);  // rounds to the nearest, so the bound is used up
}

INSTANTIATE_TEST_SUITE_P(CommonResolutions, EncoderOfBits, ::testing::Values(1, 8, 12, 17, 20));

TEST(Sensors, when_bits_and_noise_are_zero_expect_the_truth_to_the_bit) {
  Sensors sensors({0, 0.0, 5}, 3, kPeriod);
  const JointArray angle{0.1, -1.0 / 3.0, 1e-9};
  const JointArray speed{-0.2, 2.0 / 3.0, 1e9};
  const Measurement measurement = sensors.measure(42, PlantSample{angle, speed});
  EXPECT_EQ(measurement.seq, 42);
  EXPECT_EQ(measurement.angle, angle);
  EXPECT_EQ(measurement.speed, speed);
}

TEST(Sensors, quantisation_is_odd_and_rounds_ties_away_from_zero) {
  EXPECT_EQ(quantise(0.75, 0.5), 1.0);
  EXPECT_EQ(quantise(-0.75, 0.5), -1.0);
  EXPECT_EQ(quantise(0.2, 0.5), 0.0);
  EXPECT_EQ(quantise(0.2, 0.0), 0.2);
}

TEST(Sensors, entries_past_the_joints_stay_zero) {
  Sensors sensors({0, 1.0, 5}, 2, kPeriod);
  const Measurement measurement = sensors.measure(0, PlantSample{{1.0, 1.0, 1.0}, {1.0, 1.0, 1.0}});
  EXPECT_EQ(measurement.angle[2], 0.0);
  EXPECT_EQ(measurement.speed[2], 0.0);
}

TEST(Sensors, noise_is_on_the_speed_only_and_the_same_for_the_same_seed) {
  Sensors first({0, 0.05, 7}, 3, kPeriod), second({0, 0.05, 7}, 3, kPeriod), other({0, 0.05, 8}, 3, kPeriod);
  for (int k = 0; k < 100; ++k) {
    const PlantSample truth{{0.1, 0.2, 0.3}};
    const Measurement measurement = first.measure(k, truth);
    EXPECT_EQ(measurement.angle, truth.angle);
    EXPECT_EQ(measurement.speed, second.measure(k, truth).speed);
    EXPECT_NE(measurement.speed, other.measure(k, truth).speed);
  }
}

TEST(Sensors, a_filtered_speed_starts_at_the_first_and_forgets_a_step_exponentially) {
  Sensors sensors({0, 0.0, 0, 4e-3}, 1, kPeriod);
  EXPECT_EQ(sensors.measure(0, PlantSample{{}, {2.0}}).speed[0], 2.0);
  for (int k = 1; k <= 20; ++k) {
    EXPECT_NEAR(sensors.measure(k, PlantSample{{}, {3.0}}).speed[0], 3.0 - std::exp(-k * kPeriod / 4e-3), 1e-14);
  }
}

TEST(Sensors, encoders_on_both_sides_have_counts_of_their_own_and_torques_are_exact) {
  SensorOptions options{12, 0.0, 0};
  options.link_encoder_bits = 8;
  PlantSample truth{{0.1, -0.2}, {3.0, 4.0}};
  truth.motors = MotorSample{{0.1234, -0.2345}, {5.0, 6.0}, {}, {7.0 / 3.0, -8.0}, kAllGearSensors};
  const Measurement measured = Sensors(options, 2, kPeriod).measure(0, truth);
  const double fine = std::ldexp(2.0 * 3.14159265358979323846, -12), coarse = 16.0 * fine;
  EXPECT_EQ(measured.gears.available, kAllGearSensors);
  for (std::size_t j = 0; j < 2; ++j) {
    EXPECT_NEAR(measured.gears.motor_angle_rad[j], std::round(truth.motors->angle[j] / fine) * fine, 1e-15);
    EXPECT_NEAR(measured.gears.link_angle_rad[j], std::round(truth.angle[j] / coarse) * coarse, 1e-15);
    EXPECT_EQ(measured.gears.joint_torque_nm[j], truth.motors->joint_torque[j]);
  }
  EXPECT_EQ(measured.angle, measured.gears.motor_angle_rad);
  EXPECT_EQ(measured.speed[0], 5.0);
  EXPECT_EQ(measured.gears.motor_angle_rad[2], 0.0);
}

TEST(Sensors, a_torque_is_rounded_behind_its_noise_and_exact_without_either) {
  PlantSample truth{{0.1, -0.2}, {3.0, 4.0}};
  truth.motors = MotorSample{{}, {}, {}, {7.3, -8.0}, kAllGearSensors, {0.0, 0.5}, {0.25, 0.0}};
  Sensors sensors({0, 0.0, 5}, 2, kPeriod);
  GaussianNoise noise(5);
  for (int k = 0; k < 50; ++k) {
    const GearReading gears = sensors.measure(k, truth).gears;
    EXPECT_EQ(gears.joint_torque_nm[0], 7.25);
    EXPECT_EQ(gears.joint_torque_nm[1], -8.0 + 0.5 * noise());
  }
}

TEST(Sensors, what_a_robot_does_not_have_is_not_said) {
  PlantSample truth{{0.1}, {3.0}};
  EXPECT_EQ(Sensors({20, 0.0, 0}, 1, kPeriod).measure(0, truth).gears.available, kNoGearSensor);
  truth.motors = MotorSample{{0.2}, {5.0}, {}, {7.0}, kLinkAngle};
  const Measurement measured = Sensors({0, 0.0, 0}, 1, kPeriod).measure(0, truth);
  EXPECT_EQ(measured.gears.available, kLinkAngle);
  EXPECT_EQ(measured.angle[0], 0.1);
  EXPECT_EQ(measured.gears.link_angle_rad[0], 0.1);
  EXPECT_EQ(measured.gears.motor_angle_rad[0], 0.0);
  EXPECT_EQ(measured.gears.joint_torque_nm[0], 0.0);
}

TEST(GaussianNoise, is_the_box_muller_transform_of_the_standard_generator) {
  // The C++ standard fixes every output of std::mt19937_64, so this is the definition written out.
  std::mt19937_64 generator(20);
  GaussianNoise noise(20);
  for (int i = 0; i < 100; ++i) {
    const double u = std::ldexp(static_cast<double>(generator() >> 11), -53);
    const double v = std::ldexp(static_cast<double>(generator() >> 11), -53);
    const double radius = std::sqrt(-2.0 * std::log(1.0 - u));
    EXPECT_DOUBLE_EQ(noise(), radius * std::cos(kTwoPi * v));
    EXPECT_DOUBLE_EQ(noise(), radius * std::sin(kTwoPi * v));
  }
}

TEST(GaussianNoise, has_the_moments_of_white_standard_normal_noise) {
  constexpr int kCount = 200000;
  GaussianNoise noise(3);
  std::vector<double> x(kCount);
  for (double& value : x) {
    value = noise();
  }
  double mean = 0.0, variance = 0.0, fourth = 0.0, correlation = 0.0;
  int within_one_sigma = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    mean += x[i] / kCount;
    variance += x[i] * x[i] / kCount;
    fourth += std::pow(x[i], 4) / kCount;
    correlation += i > 0 ? x[i] * x[i - 1] / kCount : 0.0;
    within_one_sigma += std::abs(x[i]) < 1.0 ? 1 : 0;
  }
  // Five standard deviations of each estimate.
  const double deviation = 5.0 / std::sqrt(kCount);
  EXPECT_NEAR(mean, 0.0, deviation);
  EXPECT_NEAR(correlation, 0.0, deviation);
  EXPECT_NEAR(variance, 1.0, deviation * std::sqrt(2.0));
  EXPECT_NEAR(fourth, 3.0, deviation * std::sqrt(96.0));
  EXPECT_NEAR(within_one_sigma / double{kCount}, std::erf(std::sqrt(0.5)), deviation * 0.5);
}

}  // namespace
}  // namespace quasilpv
