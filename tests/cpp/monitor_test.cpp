#include "quasilpv/monitor.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
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

MonitorReport observe(const Artifact& artifact, const JointArray& angle) {
  StepInput input;
  input.angle = angle;
  return Monitor(artifact).observe(input, {});
}

TEST(Monitor, when_premises_are_inside_the_box_expect_no_excess_and_weights_that_sum_to_one) {
  Uniform uniform(1);
  for (const char* kind : kLawKinds) {
    const Artifact watched = artifact(kind);
    for (int i = 0; i < 100; ++i) {
      const double largest = std::acos(TestArm::kLower);
      const MonitorReport seen =
          observe(watched, {uniform(-largest, largest), uniform(-largest, largest), uniform(-largest, largest)});
      EXPECT_EQ(seen.premise_excess, 0.0) << kind;
      EXPECT_NEAR(seen.membership_sum, 1.0, 1e-14) << kind;
    }
  }
}

TEST(Monitor, when_a_premise_is_outside_expect_its_distance_in_widths_of_the_box_and_weights_that_still_sum_to_one) {
  for (const double premise : {-0.6, -0.8, -1.0}) {
    const MonitorReport seen = observe(artifact(), {0.1, std::acos(premise), 0.2});
    EXPECT_NEAR(seen.premise_excess, (TestArm::kLower - premise) / kWidth, 1e-14);
    EXPECT_NEAR(seen.membership_sum, 1.0, 1e-14);
  }
}

TEST(Monitor, when_an_angle_is_not_a_number_expect_an_infinite_excess) {
  EXPECT_EQ(observe(artifact(), {0.0, NAN, 0.0}).premise_excess, std::numeric_limits<double>::infinity());
}

JointArray random_joints(Uniform& uniform) { return {uniform(-1.0, 1.0), uniform(-1.0, 1.0), uniform(-1.0, 1.0)}; }

// Signals of any size, one joint after the other, and the Kronecker product of the weights.
TEST(Monitor, when_the_law_has_a_bound_expect_the_quadratic_form_of_the_known_signals) {
  Uniform uniform(2);
  const Monitor monitor(artifact());
  const Eigen::MatrixXd of_signals = TestArm::weights(5);
  const Eigen::MatrixXd of_joints = TestArm::weights(kJoints);
  const double T = kSamplePeriod;
  for (int i = 0; i < 100; ++i) {
    StepInput input;
    StepReport report;
    for (JointArray* values : {&input.angle, &input.reference.angle, &input.reference.speed, &report.estimated_angle,
                               &report.estimated_speed, &report.estimated_disturbance, &report.filtered_disturbance,
                               &report.integral_error}) {
      *values = random_joints(uniform);
    }
    const auto vector = [](const JointArray& values) { return to_vector(values, kJoints); };
    Eigen::MatrixXd z(kJoints, 5);
    z << vector(input.angle) - vector(input.reference.angle),
        (vector(input.angle) - vector(report.estimated_angle)) / (1.0 - 0.9),
        T * (vector(report.estimated_speed) - vector(input.reference.speed)),
        T * T * (vector(report.estimated_disturbance) - vector(report.filtered_disturbance)),
        vector(report.integral_error) / T;
    double expected = 0.0;
    for (int a = 0; a < 5; ++a) {
      for (int b = 0; b < 5; ++b) {
        expected += of_signals(a, b) * z.col(a).dot(of_joints * z.col(b));
      }
    }
    EXPECT_NEAR(monitor.observe(input, report).lyapunov, expected, 1e-12 * expected);
  }
}

TEST(Monitor, when_there_is_no_bound_no_measurement_or_no_reference_expect_not_a_number) {
  StepReport report;
  EXPECT_EQ(Monitor(artifact()).observe({}, report).lyapunov, 0.0);
  for (const std::uint32_t flag : {kMeasurementInvalid, kReferenceInvalid}) {
    report.flags = flag;
    EXPECT_TRUE(std::isnan(Monitor(artifact()).observe({}, report).lyapunov));
  }
  for (const char* kind : kLawKinds) {
    const Artifact without = Artifact::parse(json_twin(artifact_table(kind, kJoints)), "test");
    EXPECT_TRUE(std::isnan(Monitor(without).observe({}, {}).lyapunov)) << kind;
  }
}

// The commands of the first samples with and without a bound in the artifact.
TEST(Monitor, changes_no_command) {
  const Artifact without = Artifact::parse(json_twin(artifact_table("dob-acceleration", kJoints)), "test");
  ControlLoop watched(artifact(), trajectory(), {});
  ControlLoop plain(without, trajectory(), {});
  for (std::int64_t seq = 0; seq < 200; ++seq) {
    const JointArray angle{0.3 + 1e-3 * std::sin(0.1 * static_cast<double>(seq)), -0.2, 0.4};
    watched.handle(reading(seq, angle), at(seq));
    plain.handle(reading(seq, angle), at(seq));
    ASSERT_EQ(watched.command().torque_nm, plain.command().torque_nm);
  }
}

TEST(Monitor, is_in_the_telemetry_of_every_sample_and_falls_back_to_the_prediction) {
  Json table = artifact_table("dob-acceleration", kJoints);
  table["law"]["lyapunov_bound"] = TestArm{kJoints}.lyapunov_bound();
  table["domain"]["angle_rad"][1] = {-3.0, 3.0};  // wider than the box of its premise
  ControlLoop loop(Artifact::parse(json_twin(table), "test"), trajectory(), {});
  auto ring = std::make_unique<SampleRing>();
  loop.publish_to(ring.get());
  const JointArray outside{0.1, std::acos(-0.8), 0.2};
  RobotReading broken = reading(1, outside);
  broken.angle_rad[0] = NAN;
  loop.handle(reading(0, outside), at(0));
  loop.handle(broken, at(1));
  TelemetrySample sample;
  ASSERT_TRUE(ring->pop(sample));
  EXPECT_NEAR(sample.premise_excess, 0.3 / kWidth, 1e-12);
  EXPECT_NEAR(sample.membership_sum, 1.0, 1e-14);
  EXPECT_GT(sample.lyapunov_rad2, 0.0);
  ASSERT_TRUE(ring->pop(sample));
  EXPECT_TRUE(std::isfinite(sample.premise_excess));
  EXPECT_NEAR(sample.premise_excess, 0.3 / kWidth, 0.1);  // where the observer believes the arm to be
  EXPECT_TRUE(std::isnan(sample.lyapunov_rad2));
}

}  // namespace
}  // namespace quasilpv
