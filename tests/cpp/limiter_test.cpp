#include "quasilpv/limiter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace quasilpv {
namespace {

constexpr double kPeriod = 0.01;
const TorqueLimits kLimits = {{100.0, 10.0}, {1000.0, 50.0}};  // at most 10 and 0.5 N m per sample

class LimiterTest : public ::testing::Test {
 protected:
  std::uint32_t apply(double first, double second) { return limiter_.apply({first, second}, applied_); }

  Limiter limiter_{kLimits, kPeriod, 2};
  JointArray applied_{};
};

TEST_F(LimiterTest, when_the_torque_is_within_limits_expect_it_unchanged) {
  EXPECT_EQ(apply(42.0, -3.0), kStepHealthy);
  EXPECT_EQ(applied_, (JointArray{42.0, -3.0}));
}

TEST_F(LimiterTest, when_the_torque_is_beyond_its_limit_expect_saturation) {
  EXPECT_EQ(apply(-250.0, 3.0), kTorqueSaturated);
  EXPECT_EQ(applied_, (JointArray{-100.0, 3.0}));
}

TEST_F(LimiterTest, expects_the_first_torque_free_of_the_slew_limit_and_the_second_bound_by_it) {
  EXPECT_EQ(apply(90.0, 9.0), kStepHealthy);
  EXPECT_EQ(apply(90.0, 8.0), kSlewLimited);
  EXPECT_DOUBLE_EQ(applied_[1], 8.5);
  EXPECT_EQ(apply(0.0, 8.5), kSlewLimited);
  EXPECT_DOUBLE_EQ(applied_[0], 80.0);
}

TEST_F(LimiterTest, measures_the_slew_from_the_torque_that_was_applied) {
  apply(500.0, 0.0);  // applied: 100
  EXPECT_EQ(apply(95.0, 0.0), kStepHealthy);
}

TEST_F(LimiterTest, when_a_torque_is_not_finite_expect_the_last_one_on_all_joints) {
  apply(50.0, 5.0);
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(apply(60.0, bad), kTorqueNotFinite);
    EXPECT_EQ(applied_, (JointArray{50.0, 5.0}));
  }
  EXPECT_EQ(apply(60.0, 5.0), kStepHealthy);
}

TEST_F(LimiterTest, when_the_first_torque_is_not_finite_expect_zero_and_a_free_first_torque_after_it) {
  EXPECT_EQ(apply(std::nan(""), 5.0), kTorqueNotFinite);
  EXPECT_EQ(applied_, JointArray{});
  EXPECT_EQ(apply(90.0, 9.0), kStepHealthy);
}

TEST_F(LimiterTest, after_a_reset_starts_anew) {
  apply(90.0, 9.0);
  limiter_.reset();
  EXPECT_EQ(limiter_.last_applied(), JointArray{});
  EXPECT_EQ(apply(-90.0, -9.0), kStepHealthy);
}

TEST_F(LimiterTest, after_taking_over_obeys_the_slew_limit_from_the_torque_in_force) {
  limiter_.take_over({20.0, 250.0});
  EXPECT_EQ(limiter_.last_applied(), (JointArray{20.0, 10.0}));
  EXPECT_EQ(apply(100.0, -10.0), kSlewLimited);
  EXPECT_DOUBLE_EQ(applied_[0], 30.0);
  EXPECT_DOUBLE_EQ(applied_[1], 9.5);
}

TEST_F(LimiterTest, when_a_torque_is_not_commanded_expect_the_last_one_held) {
  apply(50.0, 5.0);
  EXPECT_EQ(limiter_.apply({60.0, 6.0}, false, applied_), kStepHealthy);
  EXPECT_EQ(applied_, (JointArray{50.0, 5.0}));
  EXPECT_EQ(limiter_.last_applied(), applied_);
}

TEST_F(LimiterTest, keeps_every_random_sequence_finite_and_within_both_limits) {
  std::mt19937_64 random(53);
  std::uniform_real_distribution<double> exponent(-3.0, 308.0);
  JointArray last{};
  for (int i = 0; i < 10000; ++i) {
    const double size = std::pow(10.0, exponent(random)) * (random() % 2 == 0 ? 1.0 : -1.0);
    const double torque = i % 7 == 0 ? std::nan("") : i % 11 == 0 ? size * 1e308 : size;
    apply(torque, torque / 10.0);
    for (std::size_t j = 0; j < 2; ++j) {
      ASSERT_TRUE(std::isfinite(applied_[j]));
      ASSERT_LE(std::abs(applied_[j]), kLimits.torque_nm[j]);
      if (i > 1) {
        ASSERT_LE(std::abs(applied_[j] - last[j]), kLimits.slew_nm_per_s[j] * kPeriod * (1.0 + 1e-12));
      }
    }
    last = applied_;
  }
}

}  // namespace
}  // namespace quasilpv
