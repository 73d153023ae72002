// Faults of docs/reference/faults.md at the loop and at the seam to the robot; each name carries its number.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "loop_fixture.hpp"
#include "not_finite.hpp"
#include "quasilpv/in_process_link.hpp"
#include "quasilpv/link_robot.hpp"
#include "quasilpv/run_controller.hpp"
#include "scripted_robot.hpp"

namespace quasilpv::testing {
namespace {

std::vector<RobotReading> readings(std::int64_t count) {
  std::vector<RobotReading> result;
  for (std::int64_t seq = 0; seq < count; ++seq) {
    result.push_back(reading(seq));
  }
  return result;
}

ControllerRunReport run(ControlLoop& loop, Robot& robot, Pace pace) {
  ControllerRunSettings settings;
  settings.pace = pace;
  settings.silence_s = 60.0;
  const std::atomic<bool> stop{false};
  return run_controller(loop, robot, settings, stop);
}

/// All limits 1500 N m; 3 N m per sample.
Artifact slow_actuators() {
  Json table = artifact_table("dob-acceleration", kJoints);
  table["limits"]["slew_nm_per_s"] = {3000.0, 3000.0, 3000.0};
  return Artifact::parse(json_twin(table), "test");
}

TEST(Faults, F1_when_one_angle_is_not_a_number_expect_one_flag_and_a_torque_within_limit_and_slew) {
  for (const double bad : {kNaN, kInfinity, -kInfinity}) {
    ControlLoop loop(slow_actuators(), trajectory(), {});
    for (std::int64_t seq = 0; seq < 100; ++seq) {
      const JointArray before = loop.command().torque_nm;
      loop.handle(reading(seq, {kStart[0] + 1e-4 * static_cast<double>(seq), seq == 50 ? bad : kStart[1], kStart[2]}),
                  at(seq));
      for (std::size_t j = 0; j < kJoints; ++j) {
        ASSERT_LE(std::abs(loop.command().torque_nm[j]), 1500.0);
        ASSERT_TRUE(seq == 0 || std::abs(loop.command().torque_nm[j] - before[j]) <= 3.0 + 1e-9);
      }
      EXPECT_EQ((loop.command().flags & kMeasurementInvalid) != 0, seq == 50);
    }
    EXPECT_EQ(loop.predicted_steps(), 1);
    EXPECT_EQ(loop.state(), ControllerState::kRunning);
  }
}

TEST(Faults, F4_when_an_older_reading_comes_later_expect_no_command_for_it) {
  ScriptedRobot robot({reading(0), reading(2), reading(1), reading(2), reading(3)});
  ControlLoop loop(artifact(), trajectory(), {});
  run(loop, robot, Pace::kRealTime);
  ASSERT_EQ(robot.commands().size(), 3u);
  EXPECT_EQ(robot.commands()[1].seq, 2);
  EXPECT_EQ(robot.commands()[2].seq, 3);
}

TEST(Faults, F5_when_100_foreign_messages_come_in_a_row_expect_a_latched_fault_and_at_99_none) {
  for (const std::int64_t messages : {99, 100}) {
    ScriptedRobot robot(readings(2));
    robot.set_foreign_run(messages);
    ControlLoop loop(artifact(), trajectory(), {});
    run(loop, robot, Pace::kLockStep);
    EXPECT_EQ(loop.cause(), messages == 100 ? FaultCause::kForeignMessages : FaultCause::kNone);
    EXPECT_EQ(loop.state(), messages == 100 ? ControllerState::kFault : ControllerState::kRunning);
  }
}

// The arm moves out of the box at 2 rad/s, cos(2.1) < -0.5, and stands there.
TEST(Faults, F9_when_outside_the_premise_box_expect_clamped_premises_then_degraded_then_fault) {
  ControlLoop loop(artifact(), trajectory(), {});
  auto ring = std::make_unique<SampleRing>();
  loop.publish_to(ring.get());
  std::int64_t left = -1;
  for (std::int64_t seq = 0; seq <= 1200; ++seq) {
    const double angle = std::min(1.95 + 2e-3 * static_cast<double>(seq), 2.2);
    loop.handle(reading(seq, {angle, -0.2, 0.4}), at(seq));
    TelemetrySample sample;
    ASSERT_TRUE(ring->pop(sample));
    ASSERT_EQ((loop.command().flags & kPremiseOutsideBox) != 0, std::cos(angle) < -0.5);
    left = left < 0 && std::cos(angle) < -0.5 ? seq : left;
    const std::int64_t outside = left < 0 ? 0 : seq - left;
    const ControllerState expected = outside <= 20     ? ControllerState::kRunning
                                     : outside <= 1000 ? ControllerState::kDegraded
                                                       : ControllerState::kFault;
    ASSERT_EQ(loop.state(), expected) << seq;
    ASSERT_GE(sample.premise[0], -0.5);
  }
  EXPECT_EQ(loop.cause(), FaultCause::kPremiseOutsideBox);
}

class Overrun : public ::testing::TestWithParam<double> {};

TEST_P(Overrun, F12_is_counted_and_no_reading_is_answered_twice) {
  constexpr std::int64_t kReadings = 10;
  ScriptedRobot robot(readings(kReadings));
  robot.slow_down(to_nanoseconds(GetParam() * kSamplePeriod));
  ControlLoop loop(artifact(), trajectory(), {});
  const ControllerRunReport report = run(loop, robot, Pace::kRealTime);
  EXPECT_EQ(report.deadline_overruns, kReadings);
  ASSERT_EQ(robot.commands().size(), static_cast<std::size_t>(kReadings));
  for (std::int64_t seq = 0; seq < kReadings; ++seq) {
    EXPECT_EQ(robot.commands()[static_cast<std::size_t>(seq)].seq, seq);
  }
  EXPECT_EQ(loop.state(), ControllerState::kDegraded);
}

INSTANTIATE_TEST_SUITE_P(Faults, Overrun, ::testing::Values(1.5, 2.5, 10.0), [](const auto& periods) {
  return std::to_string(std::lround(10 * periods.param)) + "_tenths";
});

TEST(Faults, F12_when_more_than_20_deadlines_are_missed_in_a_row_expect_a_latched_fault) {
  ScriptedRobot robot(readings(22));
  robot.slow_down(3 * kMillisecond / 2);
  ControlLoop loop(artifact(), trajectory(), {});
  run(loop, robot, Pace::kRealTime);
  EXPECT_EQ(robot.commands()[20].state, ControllerState::kDegraded);  // 20 overruns before it
  EXPECT_EQ(robot.commands()[21].state, ControllerState::kFault);
  EXPECT_EQ(loop.cause(), FaultCause::kDeadlineOverrun);
}

TEST(Faults, F15_when_nobody_empties_the_telemetry_ring_expect_the_same_commands_and_every_drop_counted) {
  constexpr std::int64_t kSamples = static_cast<std::int64_t>(SampleRing::capacity()) + 1000;
  auto ring = std::make_unique<SampleRing>();
  ControlLoop watched(artifact(), trajectory(), {});
  watched.publish_to(ring.get());
  ControlLoop alone(artifact(), trajectory(), {});
  for (std::int64_t seq = 0; seq < kSamples; ++seq) {
    watched.handle(reading(seq), at(seq));
    alone.handle(reading(seq), at(seq));
    ASSERT_EQ(watched.command().torque_nm, alone.command().torque_nm);
  }
  EXPECT_EQ(ring->drops(), 1000);
}

// Simulated time is the sample index; no clock of the machine takes part in the commands.
TEST(Faults, F18_the_commands_of_a_lock_step_run_do_not_depend_on_when_they_are_computed) {
  ControlLoop first(artifact(), trajectory(), {});
  ControlLoop second(artifact(), trajectory(), {});
  for (std::int64_t seq = 0; seq < 100; ++seq) {
    first.handle(reading(seq), at(seq));
  }
  sleep_until(monotonic_ns() + 5 * kMillisecond);
  for (std::int64_t seq = 0; seq < 100; ++seq) {
    second.handle(reading(seq), at(seq));
  }
  EXPECT_EQ(first.command().torque_nm, second.command().torque_nm);
}

}  // namespace
}  // namespace quasilpv::testing
