// The example of a driver: what examples/hardware_driver shows must work.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <memory>

#include "drive_robot.hpp"
#include "loop_fixture.hpp"
#include "quasilpv/run_controller.hpp"

namespace quasilpv {
namespace {

using ::hardware_driver::BenchDrive;
using ::hardware_driver::DriveRobot;
using ::quasilpv::testing::artifact;
using ::quasilpv::testing::kJoints;
using ::quasilpv::testing::kSamplePeriod;
using ::quasilpv::testing::kStart;
using ::quasilpv::testing::trajectory;

DriveRobot robot_at_the_start(std::int64_t samples) {
  std::vector<BenchDrive> drives;
  for (std::size_t j = 0; j < kJoints; ++j) {
    drives.emplace_back(8.0, kStart[j], kSamplePeriod);
  }
  return {std::move(drives), kSamplePeriod, samples};
}

class HardwareDriver : public ::testing::Test {
 protected:
  ControllerRunReport run(DriveRobot& robot, bool exit_on_fault) {
    ControllerRunSettings settings;
    settings.pace = Pace::kRealTime;
    settings.silence_s = 5.0;
    settings.exit_on_fault = exit_on_fault;
    const std::atomic<bool> stop{false};
    loop_.publish_to(ring_.get());
    return run_controller(loop_, robot, settings, stop);
  }

  static LoopSettings settings() {
    LoopSettings settings;
    settings.bumpless_start = true;
    return settings;
  }

  std::unique_ptr<SampleRing> ring_ = std::make_unique<SampleRing>();
  ControlLoop loop_{artifact(), trajectory(), settings()};
};

TEST_F(HardwareDriver, is_paced_on_the_grid_and_gets_one_command_per_reading) {
  constexpr std::int64_t kSamples = 300;
  DriveRobot robot = robot_at_the_start(kSamples);
  const std::int64_t start_ns = monotonic_ns();
  const ControllerRunReport report = run(robot, false);
  EXPECT_GE(monotonic_ns() - start_ns, (kSamples - 1) * to_nanoseconds(kSamplePeriod));
  EXPECT_EQ(report.end, ControllerRunEnd::kPlantEnded);
  EXPECT_EQ(report.commands + robot.skipped_ticks(), loop_.last_seq() + 1);
  EXPECT_LE(loop_.predicted_steps(), robot.skipped_ticks());
  TelemetrySample sample;
  while (ring_->pop(sample)) {
    for (std::size_t j = 0; j < kJoints; ++j) {
      ASSERT_TRUE(std::isfinite(sample.applied_torque_nm[j]));
    }
    if ((sample.flags & kMeasurementInvalid) == 0) {
      ASSERT_EQ(sample.gears.available, kAllGearSensors);
      const double wound = sample.gears.motor_angle_rad[1] - sample.gears.link_angle_rad[1];
      ASSERT_NEAR(wound, sample.gears.joint_torque_nm[1] / BenchDrive::kStiffnessNmPerRad, 1e-4);
    }
  }
}

TEST_F(HardwareDriver, when_an_encoder_is_unplugged_expect_a_fault_and_no_current) {
  DriveRobot robot = robot_at_the_start(100'000);
  robot.drives()[1].unplug_encoder_after(100);
  EXPECT_EQ(run(robot, true).end, ControllerRunEnd::kFault);
  EXPECT_EQ(loop_.cause(), FaultCause::kMeasurementLost);
  EXPECT_NE(loop_.post_mortem()[0].applied_torque_nm[0], 0.0);
  EXPECT_EQ(loop_.command().torque_nm, JointArray{});
}

}  // namespace
}  // namespace quasilpv
