// The controller's side of a run: losses, faults and stops must end in the safe torque.
#include "quasilpv/loop.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <thread>
#include <utility>

#include "loop_fixture.hpp"
#include "not_finite.hpp"
#include "quasilpv/errors.hpp"
#include "quasilpv/in_process_link.hpp"
#include "quasilpv/link_robot.hpp"
#include "quasilpv/realtime.hpp"
#include "quasilpv/run_controller.hpp"

namespace quasilpv::testing {
namespace {

JointArray torque_of(const ControlLoop& loop) { return loop.command().torque_nm; }

TEST(ControlLoop, when_artifact_and_trajectory_differ_in_joints_expect_refusal) {
  const Artifact two = Artifact::parse(json_twin(artifact_table("pid", 2)), "test");
  EXPECT_THROW(ControlLoop(two, trajectory(), {}), InputError);
}

TEST(ControlLoop, F3_when_samples_are_missing_expect_the_steps_of_a_controller_without_measurement) {
  ControlLoop loop(artifact(), trajectory(), {});
  Controller controller(artifact());
  const Trajectory reference = trajectory();
  StepReport expected;
  for (const std::int64_t seq : {0, 1, 2, 3, 4, 5}) {
    StepInput input;
    input.seq = seq;
    input.valid = seq == 0 || seq == 1 || seq == 5;
    input.commanded = input.valid;
    input.angle = input.valid ? kStart : JointArray{};
    input.reference = reference.evaluate(static_cast<double>(seq) * kSamplePeriod);
    expected = controller.step(input);
    if (input.valid) {
      loop.handle(reading(seq), at(seq));
    }
  }
  EXPECT_EQ(torque_of(loop), expected.torque_applied);
  EXPECT_EQ(loop.predicted_steps(), 3);
  EXPECT_EQ(loop.steps(), 6);
  EXPECT_EQ(loop.state(), ControllerState::kRunning);
}

TEST(ControlLoop, F2_when_20_samples_are_missing_expect_a_latched_fault_and_a_bounded_number_of_steps) {
  for (const std::int64_t next : {21LL, 22LL, 1'000'000'000LL}) {
    ControlLoop loop(artifact(), trajectory(), {});
    loop.handle(reading(0), at(0));
    loop.handle(reading(next), at(next));
    EXPECT_EQ(loop.state(), ControllerState::kFault) << next;
    EXPECT_EQ(loop.cause(), FaultCause::kMeasurementLost);
    EXPECT_EQ(loop.steps(), 22);
  }
}

TEST(ControlLoop, F3_when_19_samples_are_missing_expect_no_fault) {
  ControlLoop loop(artifact(), trajectory(), {});
  loop.handle(reading(0), at(0));
  loop.handle(reading(20), at(20));
  EXPECT_EQ(loop.predicted_steps(), 19);
  EXPECT_EQ(loop.state(), ControllerState::kRunning);
}

TEST(ControlLoop, F1_when_one_measurement_is_nan_expect_prediction_flag_and_a_normal_next_sample) {
  ControlLoop loop(artifact(), trajectory(), {});
  loop.handle(reading(0), at(0));
  loop.handle(reading(1, {kStart[0], kNaN, kStart[2]}), at(1));
  EXPECT_EQ(loop.state(), ControllerState::kDegraded);
  EXPECT_EQ(loop.command().flags & kMeasurementInvalid, kMeasurementInvalid);
  for (const double torque : torque_of(loop)) {
    EXPECT_TRUE(std::isfinite(torque));
  }
  loop.handle(reading(2), at(2));
  EXPECT_EQ(loop.state(), ControllerState::kRunning);
  EXPECT_EQ(loop.command().flags & kMeasurementInvalid, 0u);
  EXPECT_EQ(loop.predicted_steps(), 1);
}

class AfterAFault : public ::testing::TestWithParam<SafeAction> {};

TEST_P(AfterAFault, F2_reaches_the_safe_torque_within_50_ms_without_a_jump_and_stays_there) {
  LoopSettings settings;
  settings.safe_action = GetParam();
  ControlLoop loop(artifact(), trajectory(), settings);
  loop.handle(reading(0), at(0));
  std::int64_t seq = 1;
  JointArray before{};
  for (; loop.state() != ControllerState::kFault; ++seq) {
    ASSERT_LE(seq, 20);
    before = torque_of(loop);
    loop.handle(reading(seq, {kNaN, kNaN, kNaN}), at(seq));
  }
  const JointArray at_fault = torque_of(loop);
  EXPECT_EQ(at_fault, before);
  EXPECT_NE(at_fault, JointArray{});
  JointArray safe{};
  for (std::size_t j = 0; j < kJoints && GetParam() == SafeAction::kGravity; ++j) {
    safe[j] = 9.81 * static_cast<double>(j + 1) * std::sin(kStart[j]);
  }
  constexpr double kRampSamples = 40.0;
  for (std::int64_t sample = 0; sample < 200; ++sample, ++seq) {
    const JointArray previous = torque_of(loop);
    loop.handle(reading(seq), at(seq));
    for (std::size_t j = 0; j < kJoints; ++j) {
      const double torque = torque_of(loop)[j];
      ASSERT_LE(std::abs(torque - previous[j]), std::abs(at_fault[j] - safe[j]) / kRampSamples + 1e-9);
      ASSERT_LE(std::abs(torque - safe[j]), std::abs(at_fault[j] - safe[j]) + 1e-9);
      if (sample >= 50) {
        ASSERT_DOUBLE_EQ(torque, safe[j]);
      }
    }
  }
  EXPECT_EQ(loop.state(), ControllerState::kFault);
  EXPECT_TRUE(loop.is_safe(seq * kMillisecond));
}

INSTANTIATE_TEST_SUITE_P(ControlLoop, AfterAFault, ::testing::Values(SafeAction::kZero, SafeAction::kGravity),
                         [](const auto& action) { return action.param == SafeAction::kZero ? "zero" : "gravity"; });

/// A loop that latched a fault: 60 good samples, then 20 without angles. The next sample is 80.
class LatchedFault : public ::testing::Test {
 protected:
  void SetUp() override {
    for (std::int64_t seq = 0; seq < 80; ++seq) {
      loop_.handle(reading(seq, seq < 60 ? kStart : JointArray{kNaN, kNaN, kNaN}), at(seq));
    }
    ASSERT_EQ(loop_.state(), ControllerState::kFault);
  }

  ControlLoop loop_{artifact(), trajectory(), {}};
};

TEST_F(LatchedFault, keeps_the_50_samples_before_it_and_itself_as_the_last_one) {
  loop_.handle(reading(80), at(80));  // what comes after does not push them out
  const PostMortem& samples = loop_.post_mortem();
  ASSERT_EQ(samples.size(), 50u);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    EXPECT_EQ(samples[i].seq, 30 + static_cast<std::int64_t>(i));
  }
  EXPECT_EQ(samples[48].state, ControllerState::kDegraded);
  EXPECT_EQ(samples[49].state, ControllerState::kFault);
}

TEST_F(LatchedFault, shows_no_torque_in_telemetry_but_the_safe_one) {
  auto ring = std::make_unique<SampleRing>();
  loop_.publish_to(ring.get());
  for (std::int64_t seq = 80; seq < 180; ++seq) {  // an arm that falls: the law would answer with all it has
    loop_.handle(reading(seq, {kStart[0] + 0.1 * static_cast<double>(seq - 80), kStart[1], kStart[2]}), at(seq));
    TelemetrySample sample;
    ASSERT_TRUE(ring->pop(sample));
    for (std::size_t j = 0; j < kJoints; ++j) {
      ASSERT_EQ(sample.commanded_torque_nm[j], torque_of(loop_)[j]);
      ASSERT_EQ(sample.applied_torque_nm[j], torque_of(loop_)[j]);
    }
  }
}

TEST_F(LatchedFault, is_not_left_while_angles_are_missing) {
  EXPECT_FALSE(loop_.reset_fault());
  EXPECT_EQ(loop_.state(), ControllerState::kFault);
}

// The arm was moved while nobody controlled it; the start after the reset is that of start_test.cpp.
TEST_F(LatchedFault, is_left_by_a_reset_wherever_the_arm_is_in_its_domain) {
  const JointArray away{kStart[0] + 0.4, kStart[1], kStart[2]};
  for (std::int64_t seq = 80; seq < 150; ++seq) {
    loop_.handle(reading(seq, away), at(seq));
  }
  EXPECT_EQ(torque_of(loop_), JointArray{});
  ASSERT_TRUE(loop_.reset_fault());
  EXPECT_EQ(loop_.state(), ControllerState::kReady);
  for (std::int64_t seq = 150; seq < 250; ++seq) {
    loop_.handle(reading(seq, away), at(seq));
    ASSERT_EQ(loop_.state(), ControllerState::kRunning);
  }
  EXPECT_NE(torque_of(loop_), JointArray{});
  EXPECT_EQ(loop_.faults(), 1);
  EXPECT_FALSE(loop_.reset_fault()) << "there is no fault to leave";
}

TEST_F(LatchedFault, is_not_left_outside_the_domain) {
  for (std::int64_t seq = 80; seq < 150; ++seq) {
    loop_.handle(reading(seq, {kStart[0] + 6.283185307179586, kStart[1], kStart[2]}), at(seq));
  }
  EXPECT_FALSE(loop_.reset_fault());
}

TEST(ControlLoop, when_samples_are_missing_expect_a_telemetry_sample_for_each_prediction) {
  ControlLoop loop(artifact(), trajectory(), {});
  auto ring = std::make_unique<SampleRing>();
  loop.publish_to(ring.get());
  loop.handle(reading(0), at(0));
  loop.handle(reading(4), at(4));
  TelemetrySample sample;
  for (std::int64_t seq = 0; seq <= 4; ++seq) {
    ASSERT_TRUE(ring->pop(sample));
    EXPECT_EQ(sample.seq, seq);
    EXPECT_EQ((sample.flags & kMeasurementInvalid) != 0, seq % 4 != 0);
  }
  EXPECT_FALSE(ring->pop(sample));
}

/// A controller on a thread of its own; the test plays the plant.
class RunningController : public ::testing::Test {
 protected:
  void start(const ControllerRunSettings& settings) {
    thread_ = std::thread([this, settings] {
      report_ = run_controller(loop_, robot_, settings, stop_);
      finished_ = true;
    });
  }

  ControllerRunReport finish() {
    thread_.join();
    return report_;
  }

  void TearDown() override {
    if (thread_.joinable()) {
      stop_ = true;
      thread_.join();
    }
  }

  /// The next command of at least `seq`.
  command_v2 await_command(std::int64_t seq) {
    command_v2 command{};
    const std::int64_t end_ns = monotonic_ns() + kPatience;
    while (monotonic_ns() < end_ns) {
      plant_.receive(10 * kMillisecond);
      if (plant_.take(command) && command.seq >= seq) {
        return command;
      }
    }
    ADD_FAILURE() << "no command " << seq;
    return command;
  }

  Artifact law_ = artifact();
  std::pair<std::unique_ptr<InProcessLink>, std::unique_ptr<InProcessLink>> ends_ =
      InProcessLink::create_pair(identity_of(law_));
  InProcessLink& plant_ = *ends_.second;
  LinkRobot robot_{*ends_.first};
  ControlLoop loop_{law_, trajectory(), {}};
  std::atomic<bool> stop_{false};
  std::atomic<bool> finished_{false};
  ControllerRunReport report_;
  std::thread thread_;
};

TEST_F(RunningController, when_a_measurement_is_repeated_in_lock_step_expect_the_same_command_and_one_step) {
  start({});
  plant_.send(measurement(0));
  const command_v2 first = await_command(0);
  plant_.send(measurement(0));
  const command_v2 again = await_command(0);
  EXPECT_EQ(again.seq, first.seq);
  for (int j = 0; j < kJoints; ++j) {
    EXPECT_EQ(again.torque_nm[j], first.torque_nm[j]);
  }
  plant_.send(EventCode::kEnded, 1);
  const ControllerRunReport report = finish();
  EXPECT_EQ(report.end, ControllerRunEnd::kPlantEnded);
  EXPECT_EQ(report.commands, 2);
  EXPECT_EQ(report.repeated, 1);
  EXPECT_EQ(loop_.steps(), 1);
}

TEST_F(RunningController, F4_when_a_measurement_is_repeated_in_real_time_expect_one_command) {
  ControllerRunSettings settings;
  settings.pace = Pace::kRealTime;
  settings.silence_s = 5.0;
  start(settings);
  for (int copy = 0; copy < 3; ++copy) {
    plant_.send(measurement(0));
  }
  await_command(0);
  plant_.send(measurement(0));
  plant_.send(EventCode::kEnded, 1);
  EXPECT_EQ(finish().commands, 1);
}

TEST_F(RunningController, F16_when_the_plant_falls_silent_expect_a_fault_and_safe_torque_without_being_asked) {
  ControllerRunSettings settings;
  settings.pace = Pace::kRealTime;
  settings.timeout_s = 0.5;
  start(settings);
  plant_.send(measurement(0, {0.5, 0.0, 0.0}));
  await_command(0);
  command_v2 command = await_command(1);
  EXPECT_EQ(command.state, static_cast<std::int32_t>(ControllerState::kFault));
  const std::int64_t end_ns = monotonic_ns() + kPatience;
  const auto is_zero = [&command] {
    return std::all_of(std::begin(command.torque_nm), std::end(command.torque_nm), [](double t) { return t == 0.0; });
  };
  while (!is_zero() && monotonic_ns() < end_ns) {
    command = await_command(command.seq + 1);
  }
  EXPECT_TRUE(is_zero());
  event_v2 event{};
  ASSERT_TRUE(plant_.take(event));
  EXPECT_EQ(finish().end, ControllerRunEnd::kPlantSilent);
  EXPECT_EQ(loop_.cause(), FaultCause::kPlantSilent);
}

TEST_F(RunningController, when_a_fault_is_to_end_the_run_expect_an_end_after_the_safe_torque) {
  ControllerRunSettings settings;
  settings.exit_on_fault = true;
  start(settings);
  plant_.send(measurement(0));
  await_command(0);
  for (std::int64_t seq = 100; seq < 200; ++seq) {
    plant_.send(measurement(seq));
    if (await_command(seq).seq < seq || loop_.is_safe(seq * kMillisecond)) {
      break;
    }
  }
  EXPECT_EQ(finish().end, ControllerRunEnd::kFault);
  EXPECT_EQ(loop_.command().torque_nm[0], 0.0);
}

TEST_F(RunningController, F16_when_asked_to_stop_expect_the_safe_torque_before_the_end) {
  start({});
  plant_.send(measurement(0, {0.5, 0.0, 0.0}));
  EXPECT_NE(await_command(0).torque_nm[0], 0.0);
  stop_ = true;
  for (std::int64_t seq = 1; seq < 100 && !finished_; ++seq) {
    plant_.send(measurement(seq));
    plant_.receive(20 * kMillisecond);
  }
  EXPECT_EQ(finish().end, ControllerRunEnd::kStopped);
  EXPECT_EQ(loop_.cause(), FaultCause::kStopRequested);
  EXPECT_EQ(loop_.command().torque_nm[0], 0.0);
}

TEST_F(RunningController, when_no_plant_is_there_expect_an_end_after_the_timeout) {
  ControllerRunSettings settings;
  settings.timeout_s = 0.05;
  start(settings);
  EXPECT_EQ(finish().end, ControllerRunEnd::kPlantNeverHeard);
}

}  // namespace
}  // namespace quasilpv::testing
