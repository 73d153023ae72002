#include "quasilpv/failsafe.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <ostream>
#include <string>

#include "artifact_fixture.hpp"
#include "quasilpv/safe_torque.hpp"

namespace quasilpv {
namespace {

using ::quasilpv::testing::artifact_table;
using ::quasilpv::testing::json_twin;

constexpr std::int64_t kMillisecond = 1'000'000;

/// Drives the policy with a synthetic clock, one sample per millisecond.
class Clockwork {
 public:
  explicit Clockwork(const FailsafeSettings& settings = {}) : settings_(settings) {}

  FailsafeState sample(const FailsafeFlags& flags) {
    now_ns_ += kMillisecond;
    state_ = next_state(settings_, state_, flags, now_ns_);
    return state_;
  }

  FailsafeAction action_after(std::int64_t ns) const { return action_of(settings_, state_, now_ns_ + ns); }

 private:
  FailsafeSettings settings_;
  FailsafeState state_;
  std::int64_t now_ns_ = 0;
};

FailsafeFlags invalid(std::int64_t count) {
  FailsafeFlags flags;
  flags.consecutive_invalid = count;
  return flags;
}

TEST(Failsafe, when_the_first_sample_is_healthy_expect_running) {
  EXPECT_EQ(Clockwork().sample({}).state, ControllerState::kRunning);
}

TEST(Failsafe, F22_when_the_robots_side_gives_a_reason_expect_a_fault_with_it_that_a_reset_leaves_once_it_is_gone) {
  for (const FaultCause cause : {FaultCause::kSecondPlant, FaultCause::kSecondController, FaultCause::kPlantFailed}) {
    FailsafeFlags told;
    told.demanded = cause;
    const FailsafeState fault = Clockwork().sample(told);
    EXPECT_EQ(fault.state, ControllerState::kFault);
    EXPECT_EQ(fault.cause, cause);
    EXPECT_EQ(after_reset({}, fault, told).state, ControllerState::kFault);
    EXPECT_EQ(after_reset({}, fault, {}).state, ControllerState::kReady);
  }
}

TEST(Failsafe, F3_when_1_to_19_measurements_are_missing_expect_degraded_then_running_again) {
  Clockwork policy;
  for (int count = 1; count < 20; ++count) {
    ASSERT_EQ(policy.sample(invalid(count)).state, ControllerState::kDegraded) << count;
    ASSERT_FALSE(policy.action_after(0).use_safe_torque);
  }
  EXPECT_EQ(policy.sample({}).state, ControllerState::kRunning);
}

struct Limit {
  const char* name;
  std::function<FailsafeFlags(std::int64_t)> flags;
  std::int64_t first_fault;
  FaultCause cause;
};

void PrintTo(const Limit& limit, std::ostream* out) { *out << limit.name; }

class EveryLimit : public ::testing::TestWithParam<Limit> {};

TEST_P(EveryLimit, faults_exactly_there_and_stays_in_fault) {
  Clockwork policy;
  for (std::int64_t count = 0; count < GetParam().first_fault; ++count) {
    ASSERT_NE(policy.sample(GetParam().flags(count)).state, ControllerState::kFault) << count;
  }
  const FailsafeState fault = policy.sample(GetParam().flags(GetParam().first_fault));
  EXPECT_EQ(fault.state, ControllerState::kFault);
  EXPECT_EQ(fault.cause, GetParam().cause);
  for (int healthy = 0; healthy < 1000; ++healthy) {
    ASSERT_EQ(policy.sample({}).state, ControllerState::kFault);
  }
  EXPECT_EQ(policy.sample({}).cause, GetParam().cause);
}

FailsafeFlags overruns(std::int64_t count) {
  FailsafeFlags flags;
  flags.consecutive_overruns = count;
  return flags;
}

FailsafeFlags foreign(std::int64_t count) {
  FailsafeFlags flags;
  flags.consecutive_foreign = count;
  return flags;
}

FailsafeFlags implausible(std::int64_t count) {
  FailsafeFlags flags = invalid(count);
  flags.measurement_implausible = true;
  return flags;
}

FailsafeFlags speeds(std::int64_t count) {
  FailsafeFlags flags;
  flags.consecutive_speeds = count;
  return flags;
}

FailsafeFlags refused(std::int64_t count) {
  FailsafeFlags flags;
  flags.start_refused = count > 0;
  return flags;
}

FailsafeFlags outside_proof(std::int64_t count) {
  FailsafeFlags flags;
  flags.consecutive_outside = count;
  return flags;
}

// The sample that leaves the box is the first of the time outside, and one sample is one millisecond.
FailsafeFlags outside_from_the_first_sample(std::int64_t /*count*/) {
  FailsafeFlags flags;
  flags.premise_outside_box = true;
  return flags;
}

INSTANTIATE_TEST_SUITE_P(Failsafe, EveryLimit,
                         ::testing::Values(Limit{"measurements", invalid, 20, FaultCause::kMeasurementLost},
                                           Limit{"overruns", overruns, 21, FaultCause::kDeadlineOverrun},
                                           Limit{"foreign", foreign, 100, FaultCause::kForeignMessages},
                                           Limit{"implausible", implausible, 20, FaultCause::kMeasurementImplausible},
                                           Limit{"speeds", speeds, 20, FaultCause::kSpeedBeyondDomain},
                                           Limit{"outside", outside_proof, 20, FaultCause::kOutsideProof},
                                           Limit{"start", refused, 1, FaultCause::kStartRefused},
                                           Limit{"premise", outside_from_the_first_sample, 1001,
                                                 FaultCause::kPremiseOutsideBox}),
                         [](const auto& limit) { return std::string(limit.param.name); });

TEST(Failsafe, F9_when_a_premise_leaves_its_box_briefly_expect_no_more_than_running) {
  Clockwork policy;
  for (int i = 0; i < 5000; ++i) {
    FailsafeFlags flags;
    flags.premise_outside_box = i % 20 != 0;
    ASSERT_EQ(policy.sample(flags).state, ControllerState::kRunning);
  }
}

TEST(Failsafe, F9_when_the_premise_fault_is_switched_off_expect_degraded_for_ever) {
  FailsafeSettings settings;
  settings.premise_fault_ns = 0;
  Clockwork policy(settings);
  FailsafeState state;
  for (int i = 0; i < 5000; ++i) {
    state = policy.sample(outside_from_the_first_sample(0));
  }
  EXPECT_EQ(state.state, ControllerState::kDegraded);
}

TEST(Failsafe, F2_when_a_fault_is_latched_expect_a_ramp_to_the_safe_torque_within_50_ms) {
  Clockwork policy;
  policy.sample(invalid(20));
  double previous = -1.0;
  for (std::int64_t ns = 0; ns < 50 * kMillisecond; ns += kMillisecond) {
    const FailsafeAction action = policy.action_after(ns);
    ASSERT_TRUE(action.use_safe_torque);
    ASSERT_GE(action.safe_share, previous);
    ASSERT_LE(action.safe_share, 1.0);
    previous = action.safe_share;
  }
  EXPECT_EQ(policy.action_after(0).safe_share, 0.0);
  EXPECT_EQ(policy.action_after(50 * kMillisecond).safe_share, 1.0);
}

FailsafeState fault_of(const FailsafeFlags& flags) { return Clockwork().sample(flags); }

TEST(Failsafe, when_reset_with_its_cause_gone_expect_ready_and_no_memory_of_the_fault) {
  const FailsafeState state = after_reset({}, fault_of(invalid(20)), {});
  EXPECT_EQ(state.state, ControllerState::kReady);
  EXPECT_EQ(state.cause, FaultCause::kNone);
  EXPECT_EQ(next_state({}, state, {}, kMillisecond).state, ControllerState::kRunning);
}

TEST(Failsafe, when_reset_while_a_cause_or_an_invalid_measurement_is_there_expect_still_fault) {
  FailsafeFlags stop;
  stop.stop_requested = true;
  FailsafeFlags silent;
  silent.plant_silent = true;
  for (const FailsafeFlags& flags :
       {invalid(1), invalid(20), implausible(1), speeds(20), overruns(21), foreign(100), stop, silent}) {
    EXPECT_EQ(after_reset({}, fault_of(invalid(20)), flags).state, ControllerState::kFault);
  }
}

TEST(Failsafe, when_reset_outside_a_fault_expect_the_state_untouched) {
  EXPECT_EQ(after_reset({}, fault_of(invalid(3)), {}).state, ControllerState::kDegraded);
}

TEST(Failsafe, when_reset_outside_the_premise_box_expect_the_whole_time_again_before_the_next_fault) {
  Clockwork policy;
  FailsafeState state;
  const FailsafeFlags outside = outside_from_the_first_sample(0);
  while (state.state != ControllerState::kFault) {
    state = policy.sample(outside);
  }
  state = after_reset({}, state, outside);
  std::int64_t now_ns = 5000 * kMillisecond;
  int samples = 0;
  for (; state.state != ControllerState::kFault; now_ns += kMillisecond, ++samples) {
    state = next_state({}, state, outside, now_ns);
  }
  EXPECT_EQ(samples, 1002);  // at 0, 1, ..., 1001 ms
}

TEST(Failsafe, when_a_stop_is_requested_expect_the_safe_torque_and_that_cause_before_any_other) {
  Clockwork policy;
  FailsafeFlags flags = invalid(20);
  flags.stop_requested = true;
  EXPECT_EQ(policy.sample(flags).cause, FaultCause::kStopRequested);
}

/// Two joints, torque limit 1500 N m, slew 1 N m per sample, domain +-2 rad/s; gravity 9.81 (j + 1) sin(y_j).
Artifact two_joints() {
  Json table = artifact_table("pid", 2);
  table["limits"]["slew_nm_per_s"] = {1000.0, 1000.0};
  return Artifact::parse(json_twin(table), "test");
}

const JointArray kAngle{0.4, -0.9};
const JointArray kSpeed{0.5, -0.25};

TEST(SafeTorque, when_the_ramp_is_over_expect_zero_torque_or_gravity_minus_damping) {
  const JointArray zero =
      SafeTorque(two_joints(), SafeAction::kZero).apply(1.0, {300, 300}, {0.5, -0.5}, kAngle, kSpeed);
  EXPECT_EQ(zero, JointArray{});
  const JointArray near{9.81 * std::sin(0.4) - 37.0, 2 * 9.81 * std::sin(-0.9) + 19.0};
  const JointArray torque = SafeTorque(two_joints(), SafeAction::kGravity).apply(1.0, {300, 300}, near, kAngle, kSpeed);
  // A tenth of the torque limit at the fastest speed: 0.1 * 1500 / 2 = 75 N m s/rad.
  EXPECT_DOUBLE_EQ(torque[0], 9.81 * std::sin(0.4) - 75.0 * 0.5);
  EXPECT_DOUBLE_EQ(torque[1], 2 * 9.81 * std::sin(-0.9) + 75.0 * 0.25);
}

TEST(SafeTorque, when_halfway_expect_the_mean_of_old_and_safe_torque) {
  const JointArray torque = SafeTorque(two_joints(), SafeAction::kZero).apply(0.5, {10, -20}, {5, -10}, kAngle, kSpeed);
  EXPECT_EQ(torque, (JointArray{5, -10}));
}

TEST(SafeTorque, when_far_away_expect_a_step_of_the_slew_limit_only) {
  const SafeTorque safe(two_joints(), SafeAction::kZero);
  JointArray torque{300, -200};
  for (int sample = 1; sample <= 400; ++sample) {
    torque = safe.apply(1.0, {300, -200}, torque, kAngle, kSpeed);
    ASSERT_NEAR(torque[0], std::max(300.0 - sample, 0.0), 1e-9);
    ASSERT_NEAR(torque[1], std::min(-200.0 + sample, 0.0), 1e-9);
  }
}

TEST(SafeTorque, when_angle_or_speed_are_not_numbers_expect_a_finite_torque) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  const JointArray torque =
      SafeTorque(two_joints(), SafeAction::kGravity).apply(1.0, {10, 10}, {}, {kNaN, 0.1}, {kNaN, kNaN});
  EXPECT_EQ(torque[0], 0.0);
  EXPECT_DOUBLE_EQ(torque[1], 2 * 9.81 * std::sin(0.1) > 1.0 ? 1.0 : 2 * 9.81 * std::sin(0.1));
}

}  // namespace
}  // namespace quasilpv
