// The loop without a transport: this program links quasilpv::core alone.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <memory>

#include "../artifact_fixture.hpp"
#include "document/document.hpp"
#include "quasilpv/loop.hpp"
#include "quasilpv/run_controller.hpp"

// Nobody who includes its headers sees a transport, and nobody needs one to link it.
#if __has_include("quasilpv/link.hpp") || __has_include("quasilpv/telemetry_v2.hpp")
#error "quasilpv::core must not bring the headers of quasilpv::link"
#endif

namespace quasilpv {
namespace {

using testing::artifact_table;
using testing::json_twin;
using testing::TestArm;

constexpr int kJoints = 2;
constexpr double kPeriod = 1e-3;
constexpr std::int64_t kSamples = 1000;

Artifact artifact() {
  Json table = artifact_table("dob-acceleration", kJoints);
  table["domain"]["speed_rad_s"] = std::vector<Json>(kJoints, Json::array({-50.0, 50.0}));
  return Artifact::parse(json_twin(table), "core_test");
}

/// Least jerk from 0 to 0.2 rad in 1 s, both joints.
Trajectory trajectory() {
  const Json polynomial = {0.0, 0.0, 0.0, 2.0, -3.0, 1.2};
  return Trajectory::parse(json_twin({{"schema", "quasilpv.trajectory"},
                                      {"schema_version", 1},
                                      {"name", "least-jerk"},
                                      {"joints", kJoints},
                                      {"task", nullptr},
                                      {"knots_s", {0.0, 1.0}},
                                      {"coefficients", {{polynomial, polynomial}}}}),
                           "core_test");
}

/// The arm of the fixture under the torques it is given, by small Euler steps: M(y) y'' + G(y) = torque.
class EulerRobot final : public Robot {
 public:
  bool read(RobotReading& reading, std::int64_t /*timeout_ns*/) noexcept override {
    if (seq_ == kSamples) {
      return false;
    }
    reading.seq = seq_;
    for (int j = 0; j < kJoints; ++j) {
      reading.angle_rad[static_cast<std::size_t>(j)] = angle_[j];
    }
    return true;
  }

  void write(const RobotCommand& command) noexcept override {
    constexpr int kSteps = 20;
    const Eigen::Vector2d torque(command.torque_nm[0], command.torque_nm[1]);
    for (int step = 0; step < kSteps; ++step) {
      speed_ += kPeriod / kSteps * arm_.inertia(angle_).ldlt().solve(torque - arm_.gravity(angle_));
      angle_ += kPeriod / kSteps * speed_;
    }
    ++seq_;
  }

  RobotRequest take_request() noexcept override { return seq_ == kSamples ? RobotRequest::kEnd : RobotRequest::kNone; }

  const Eigen::VectorXd& angle() const noexcept { return angle_; }

 private:
  TestArm arm_{kJoints};
  Eigen::VectorXd angle_ = Eigen::VectorXd::Zero(kJoints);
  Eigen::VectorXd speed_ = Eigen::VectorXd::Zero(kJoints);
  std::int64_t seq_ = 0;
};

TEST(Core, follows_a_trajectory_in_process_and_leaves_every_sample_in_the_ring) {
  ControlLoop loop(artifact(), trajectory(), {});
  const auto ring = std::make_unique<SampleRing>();
  loop.publish_to(ring.get());
  EulerRobot robot;
  const std::atomic<bool> stop{false};
  const ControllerRunReport report = run_controller(loop, robot, {}, stop);
  EXPECT_EQ(report.end, ControllerRunEnd::kPlantEnded);
  EXPECT_EQ(report.commands, kSamples);
  EXPECT_EQ(loop.faults(), 0);
  EXPECT_NEAR(robot.angle()[0], 0.2, 1e-4);
  EXPECT_NEAR(robot.angle()[1], 0.2, 1e-4);
  TelemetrySample sample;
  for (std::int64_t seq = 0; seq < kSamples; ++seq) {
    ASSERT_TRUE(ring->pop(sample));
    ASSERT_EQ(sample.seq, seq);
    ASSERT_NEAR(sample.measured_angle_rad[0], sample.reference_angle_rad[0], 1e-3);
  }
  EXPECT_EQ(sample.state, ControllerState::kRunning);
  EXPECT_EQ(sample.premises, kJoints);
}

}  // namespace
}  // namespace quasilpv
