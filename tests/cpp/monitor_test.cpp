#include "quasilpv/monitor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>

#include "loop_fixture.hpp"
#include "quasilpv/telemetry_ring.hpp"

namespace quasilpv {
namespace {

using namespace quasilpv::testing;  // NOLINT(google-build-using-namespace): fixtures

// The premises of the test arm are cos(y_j), their box is [kLower, kUpper].
constexpr double kWidth = TestArm::kUpper - TestArm::kLower;

TEST(Monitor, when_premises_are_inside_the_box_expect_no_excess_and_weights_that_sum_to_one) {
  Uniform uniform(1);
  for (const char* kind : kLawKinds) {
    const Monitor monitor(artifact(kind));
    for (int i = 0; i < 100; ++i) {
      const double largest = std::acos(TestArm::kLower);
      const MonitorReport seen =
          monitor.observe({uniform(-largest, largest), uniform(-largest, largest), uniform(-largest, largest)});
      EXPECT_EQ(seen.premise_excess, 0.0) << kind;
      EXPECT_NEAR(seen.membership_sum, 1.0, 1e-14) << kind;
    }
  }
}

TEST(Monitor, when_a_premise_is_outside_expect_its_distance_in_widths_of_the_box_and_weights_that_still_sum_to_one) {
  const Monitor monitor(artifact());
  for (const double premise : {-0.6, -0.8, -1.0}) {
    const MonitorReport seen = monitor.observe({0.1, std::acos(premise), 0.2});
    EXPECT_NEAR(seen.premise_excess, (TestArm::kLower - premise) / kWidth, 1e-14);
    EXPECT_NEAR(seen.membership_sum, 1.0, 1e-14);
  }
}

TEST(Monitor, when_an_angle_is_not_a_number_expect_an_infinite_excess) {
  EXPECT_EQ(Monitor(artifact()).observe({0.0, NAN, 0.0}).premise_excess, std::numeric_limits<double>::infinity());
}

TEST(Monitor, is_in_the_telemetry_of_every_sample_and_falls_back_to_the_prediction) {
  ControlLoop loop(artifact(), trajectory(), {});
  auto ring = std::make_unique<SampleRing>();
  loop.publish_to(ring.get());
  const JointArray outside{0.1, std::acos(-0.8), 0.2};
  RobotReading broken = reading(1, outside);
  broken.angle_rad[0] = NAN;
  loop.handle(reading(0, outside), at(0));
  loop.handle(broken, at(1));
  telemetry_v1 sample;
  ASSERT_TRUE(ring->pop(sample));
  EXPECT_NEAR(sample.premise_excess, 0.3 / kWidth, 1e-12);
  EXPECT_NEAR(sample.membership_sum, 1.0, 1e-14);
  ASSERT_TRUE(ring->pop(sample));
  EXPECT_TRUE(std::isfinite(sample.premise_excess));
  EXPECT_NEAR(sample.premise_excess, 0.3 / kWidth, 0.1);  // where the observer believes the arm to be
}

}  // namespace
}  // namespace quasilpv
