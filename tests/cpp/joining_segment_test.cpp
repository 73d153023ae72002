#include "quasilpv/joining_segment.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "artifact_fixture.hpp"

namespace quasilpv::testing {
namespace {

constexpr double kFastest = 2.0;  // of the domain
constexpr double kLimit = 1500.0;

class Joining : public ::testing::TestWithParam<std::pair<double, double>> {
 protected:
  void SetUp() override {
    const auto [offset, speed] = GetParam();
    segment_.begin(100, {offset, -offset / 2.0}, {speed, 0.0});
  }

  std::int64_t last() const { return 99 + static_cast<std::int64_t>(std::ceil(segment_.duration_s() / kSamplePeriod)); }

  Artifact artifact_ = Artifact::parse(json_twin(artifact_table("pid", 2)), "test");
  JoiningSegment segment_{artifact_};
};

TEST_P(Joining, begins_at_the_offset_without_acceleration_and_ends_at_rest_at_zero) {
  const auto [offset, speed] = GetParam();
  const Reference first = segment_.offset(100);
  EXPECT_EQ(first.angle, (JointArray{offset, -offset / 2.0}));
  EXPECT_EQ(first.speed, (JointArray{speed, 0.0}));
  EXPECT_EQ(first.acceleration, JointArray{});
  EXPECT_TRUE(segment_.is_joining(last()));
  EXPECT_FALSE(segment_.is_joining(last() + 1));
  // At most one sample before its end, where angle, speed and acceleration are zero to third, second and first order.
  const double share = kSamplePeriod / segment_.duration_s();
  const double size = std::abs(offset) + std::abs(speed) * segment_.duration_s();
  EXPECT_LE(std::abs(segment_.offset(last()).angle[0]), 20.0 * size * share * share * share);
}

TEST_P(Joining, has_speed_and_acceleration_as_its_derivatives) {
  for (std::int64_t seq = 101; seq < last(); ++seq) {
    const Reference before = segment_.offset(seq - 1);
    const Reference now = segment_.offset(seq);
    const Reference after = segment_.offset(seq + 1);
    const double scale = std::abs(now.acceleration[0]) + 60.0 / std::pow(segment_.duration_s(), 2);
    const double step = kSamplePeriod / segment_.duration_s();
    EXPECT_NEAR((after.angle[0] - before.angle[0]) / (2 * kSamplePeriod), now.speed[0], 100.0 * step * step);
    EXPECT_NEAR((after.speed[0] - before.speed[0]) / (2 * kSamplePeriod), now.acceleration[0], scale * 10.0 * step);
  }
}

TEST_P(Joining, is_within_the_stated_speeds_and_torques) {
  const auto [offset, speed] = GetParam();
  const TestArm arm{2};
  for (std::int64_t seq = 100; seq <= last(); ++seq) {
    const Reference now = segment_.offset(seq);
    for (std::size_t j = 0; j < 2; ++j) {
      EXPECT_LE(std::abs(now.speed[j]), 0.25 * kFastest + std::abs(speed) + 1e-12);
    }
    for (const double angle : {0.0, 1.0, 2.0}) {  // a fifth and three tenths of the limit
      const Eigen::VectorXd torque = arm.inertia(Eigen::VectorXd::Constant(2, angle)) * to_vector(now.acceleration, 2);
      EXPECT_LE(torque.cwiseAbs().maxCoeff(), 0.5 * kLimit + 1e-9);
    }
  }
  EXPECT_GE(segment_.duration_s(), 0.02);
}

INSTANTIATE_TEST_SUITE_P(Starts, Joining,
                         ::testing::Values(std::pair{0.1, 0.0}, std::pair{-0.1, 0.0}, std::pair{1.0, 0.0},
                                           std::pair{0.0, 1.0}, std::pair{0.02, -3.0}, std::pair{1e-6, 0.0},
                                           std::pair{-0.3, 2.0}));

TEST(JoiningSegment, is_over_before_it_begins_and_after_it_is_ended) {
  JoiningSegment segment(Artifact::parse(json_twin(artifact_table("pid", 2)), "test"));
  EXPECT_FALSE(segment.is_joining(0));
  segment.begin(5, {0.1}, {});
  EXPECT_TRUE(segment.is_joining(5));
  segment.end();
  EXPECT_FALSE(segment.is_joining(5));
}

}  // namespace
}  // namespace quasilpv::testing
