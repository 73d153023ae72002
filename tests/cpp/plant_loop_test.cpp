// The plant's side of a run: over a link it must be the in-process run, and silence must end in the brake.
#include "quasilpv/plant_loop.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "loop_fixture.hpp"
#include "quasilpv/in_process_link.hpp"
#include "quasilpv/link_robot.hpp"
#include "quasilpv/run_controller.hpp"

namespace quasilpv::testing {
namespace {

void expect_equal_columns(const Record& record, const Record& expected, const std::string& name,
                          const std::string& expected_name) {
  const std::vector<double>& values = record[name].values;
  const std::vector<double>& others = expected[expected_name].values;
  ASSERT_EQ(values.size(), others.size()) << name;
  for (std::size_t i = 0; i < values.size(); ++i) {
    ASSERT_EQ(values[i], others[i]) << name << " value " << i;
  }
}

void expect_plant_record(const Record& record, const Record& in_process) {
  for (const char* name : {"time_s", "angle_rad", "speed_rad_s", "acceleration_rad_s2", "external_torque_nm"}) {
    expect_equal_columns(record, in_process, name, name);
  }
  expect_equal_columns(record, in_process, "torque_nm", "torque_applied_nm");
}

class EveryLaw : public ::testing::TestWithParam<const char*> {};

TEST_P(EveryLaw, gives_over_a_link_in_lock_step_the_samples_of_the_in_process_run_bit_for_bit) {
  constexpr std::int64_t kSamples = 400;
  const Artifact law = artifact(GetParam());
  const Scenario experiment = scenario(kSamples);
  const RunRecord in_process = run_in_process(law, experiment);

  auto [controller_end, plant_end] = InProcessLink::create_pair(identity_of(law));
  ControlLoop loop(law, trajectory(), {});
  auto ring = std::make_unique<SampleRing>();
  loop.publish_to(ring.get());
  LinkRobot robot(*controller_end);
  const std::atomic<bool> stop{false};
  ControllerRunReport controller_report;
  std::thread thread([&] { controller_report = run_controller(loop, robot, {}, stop); });
  PlantSession session(experiment, kSamplePeriod);
  Record record;
  const PlantRunReport plant_report = run_plant(session, *plant_end, {}, &record, stop);
  thread.join();

  EXPECT_EQ(plant_report.end, PlantRunEnd::kCompleted);
  EXPECT_EQ(plant_report.samples, kSamples);
  EXPECT_EQ(controller_report.end, ControllerRunEnd::kPlantEnded);
  EXPECT_EQ(loop.steps(), kSamples);
  expect_plant_record(record, in_process.samples);

  TelemetrySample sample;
  std::size_t k = 0;
  for (; ring->pop(sample); ++k) {
    for (std::size_t j = 0; j < kJoints; ++j) {
      ASSERT_EQ(sample.seq, static_cast<std::int64_t>(k));
      ASSERT_EQ(sample.estimated_speed_rad_s[j], in_process.samples["estimated_speed_rad_s"].values[k * kJoints + j]);
      ASSERT_EQ(sample.measured_speed_rad_s[j], in_process.samples["measured_speed_rad_s"].values[k * kJoints + j]);
      ASSERT_EQ(sample.applied_torque_nm[j], in_process.samples["torque_applied_nm"].values[k * kJoints + j]);
    }
  }
  EXPECT_EQ(k, static_cast<std::size_t>(kSamples));
}

INSTANTIATE_TEST_SUITE_P(Loop, EveryLaw, ::testing::ValuesIn(kLawKinds), [](const auto& kind) {
  std::string name = kind.param;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

TEST(PlantLoop, when_the_first_copy_of_every_measurement_is_lost_expect_the_same_samples) {
  constexpr std::int64_t kSamples = 5;
  const Artifact law = artifact();
  const Scenario experiment = scenario(kSamples);
  const RunRecord in_process = run_in_process(law, experiment);

  auto [controller_end, plant_end] = InProcessLink::create_pair(identity_of(law));
  std::thread thread([&, link = controller_end.get()] {
    ControlLoop loop(law, trajectory(), {});
    measurement_v3 received{};
    std::int64_t lost = -1;
    for (std::int64_t answered = 0; answered < kSamples && link->receive(kPatience);) {
      if (!link->take(received)) {
        continue;
      }
      if (received.seq > lost) {
        lost = received.seq;
        continue;
      }
      loop.handle(to_reading(received), at(received.seq));
      link->send(to_message(loop.command()));
      ++answered;
    }
  });
  PlantSession session(experiment, kSamplePeriod);
  Record record;
  const std::atomic<bool> stop{false};
  const PlantRunReport report = run_plant(session, *plant_end, {}, &record, stop);
  thread.join();
  EXPECT_EQ(report.end, PlantRunEnd::kCompleted);
  EXPECT_EQ(report.repeated, kSamples);
  expect_plant_record(record, in_process.samples);
}

TEST(PlantLoop, when_no_controller_answers_expect_an_end_after_the_timeout) {
  auto [controller_end, plant_end] = InProcessLink::create_pair(identity_of(artifact()));
  PlantSession session(scenario(10), kSamplePeriod);
  PlantRunSettings settings;
  settings.timeout_s = 0.1;
  const std::atomic<bool> stop{false};
  EXPECT_EQ(run_plant(session, *plant_end, settings, nullptr, stop).end, PlantRunEnd::kControllerNeverHeard);
  EXPECT_EQ(session.seq(), 0);
}

TEST(PlantLoop, F7_when_commands_stop_in_real_time_expect_the_torque_held_for_20_ms_and_then_the_brake) {
  constexpr std::int64_t kAnswered = 10;
  constexpr std::int64_t kSamples = 60;
  const Scenario experiment = scenario(kSamples);
  auto [controller_end, plant_end] = InProcessLink::create_pair(identity_of(artifact()));
  std::thread thread([link = controller_end.get()] {
    measurement_v3 received{};
    for (std::int64_t newest = 0; newest < kAnswered && link->receive(kPatience);) {
      if (link->take(received)) {
        newest = received.seq;
        command_v2 command{};
        command.seq = received.seq;
        command.torque_nm[0] = 5.0;
        link->send(command);
      }
    }
  });
  PlantSession session(experiment, kSamplePeriod);
  PlantRunSettings settings;
  settings.pace = Pace::kRealTime;
  settings.brake_nm_s = viscous_brake(experiment, 0.05);
  Record record;
  const std::atomic<bool> stop{false};
  const PlantRunReport report = run_plant(session, *plant_end, settings, &record, stop);
  thread.join();

  ASSERT_EQ(report.samples, kSamples);
  EXPECT_TRUE(report.watchdog_at_end);
  const std::vector<double>& delay = record["command_delay_s"].values;
  std::size_t last = kSamples - 1;
  while (delay[last] < 0.0) {
    --last;
  }
  const auto torque = [&record](std::size_t k, std::size_t j) { return record["torque_nm"].values[k * kJoints + j]; };
  const double held_until = static_cast<double>(last) * kSamplePeriod + delay[last] + 0.02;
  std::int64_t braked = 0;
  for (std::size_t k = last + 1; k < kSamples; ++k) {
    const bool held = static_cast<double>(k + 1) * kSamplePeriod <= held_until + 1e-12;
    braked += held ? 0 : 1;
    for (std::size_t j = 0; j < kJoints; ++j) {
      const double speed = record["speed_rad_s"].values[k * kJoints + j];
      ASSERT_EQ(torque(k, j), held ? torque(last, j) : -settings.brake_nm_s[j] * speed) << "sample " << k;
    }
  }
  EXPECT_EQ(report.watchdog_samples, braked);
  EXPECT_GT(braked, 0);
}

/// A controller that answers `bad_from` and all later measurements with the torque `bad`, those before with 5 N m.
void answer_with(Link& link, std::int64_t bad_from, double bad, const std::atomic<bool>& over) {
  measurement_v3 received{};
  while (!over) {
    link.receive(kMillisecond);
    if (link.take(received)) {
      command_v2 command{};
      command.seq = received.seq;
      command.torque_nm[1] = received.seq < bad_from ? 5.0 : bad;
      link.send(command);
    }
  }
}

class BadTorque : public ::testing::TestWithParam<double> {};

TEST_P(BadTorque, F25_in_lock_step_is_refused_and_counted_and_never_integrated) {
  constexpr std::int64_t kGood = 5;
  auto [controller_end, plant_end] = InProcessLink::create_pair(identity_of(artifact()));
  std::atomic<bool> over{false};
  std::thread thread([&, link = controller_end.get()] { answer_with(*link, kGood, GetParam(), over); });
  PlantSession session(scenario(50), kSamplePeriod);
  PlantRunSettings settings;
  settings.timeout_s = 0.15;
  settings.torque_limit_nm = artifact().limits().torque_nm;
  Record record;
  const std::atomic<bool> stop{false};
  const PlantRunReport report = run_plant(session, *plant_end, settings, &record, stop);
  over = true;
  thread.join();

  EXPECT_EQ(report.end, PlantRunEnd::kCommandsRefused);
  EXPECT_EQ(report.samples, kGood);
  EXPECT_GT(report.refused_commands, 0);
  EXPECT_NE(report.refusal.find("torque_nm[1] of sample 5 is "), std::string::npos) << report.refusal;
  EXPECT_EQ(record["seq"].values.size(), static_cast<std::size_t>(kGood));
}

TEST_P(BadTorque, F25_in_real_time_is_held_off_then_braked_by_the_watchdog) {
  constexpr std::int64_t kGood = 5;
  constexpr std::int64_t kSamples = 60;
  auto [controller_end, plant_end] = InProcessLink::create_pair(identity_of(artifact()));
  std::atomic<bool> over{false};
  std::thread thread([&, link = controller_end.get()] { answer_with(*link, kGood, GetParam(), over); });
  const Scenario experiment = scenario(kSamples);
  PlantSession session(experiment, kSamplePeriod);
  PlantRunSettings settings;
  settings.pace = Pace::kRealTime;
  settings.brake_nm_s = viscous_brake(experiment, 0.05);
  settings.torque_limit_nm = artifact().limits().torque_nm;
  Record record;
  const std::atomic<bool> stop{false};
  const PlantRunReport report = run_plant(session, *plant_end, settings, &record, stop);
  over = true;
  thread.join();

  EXPECT_EQ(report.samples, kSamples);
  EXPECT_GT(report.refused_commands, 0);
  EXPECT_TRUE(report.watchdog_at_end);
  for (std::size_t k = 0; k < static_cast<std::size_t>(kSamples); ++k) {
    const double torque = record["torque_nm"].values[k * kJoints + 1];
    const double speed = record["speed_rad_s"].values[k * kJoints + 1];
    ASSERT_TRUE(torque == 5.0 || torque == -settings.brake_nm_s[1] * speed || (k == 0 && torque == 0.0)) << k;
  }
}

INSTANTIATE_TEST_SUITE_P(PlantLoop, BadTorque,
                         ::testing::Values(std::numeric_limits<double>::quiet_NaN(),
                                           -std::numeric_limits<double>::infinity(), 1e300, -1e300,
                                           artifact().limits().torque_nm[1] * (1.0 + 1e-15)));

TEST(PlantLoop, F22_when_a_second_controller_answers_in_lock_step_expect_the_run_ended_and_both_told) {
  auto [controller_end, plant_end] = InProcessLink::create_pair(identity_of(artifact()));
  std::atomic<bool> over{false};
  FaultCause told = FaultCause::kNone;
  std::thread thread([&, link = controller_end.get()] {
    LinkRobot robot(*link);
    RobotReading reading;
    while (!over) {
      if (robot.read(reading, kMillisecond)) {
        robot.write({reading.seq, {}, ControllerState::kRunning, kStepHealthy});
      }
      if (robot.take_request() == RobotRequest::kEnd) {
        told = robot.take_fault();
      }
    }
  });
  command_v2 other{};
  const WireIdentity identity = plant_end->identity();
  other.session = identity.session;
  other.artifact_hash = identity.artifact_hash;
  other.joints = identity.joints;
  other.sender = 99;
  Packet packet;
  PlantSession session(scenario(100'000), kSamplePeriod);
  const std::atomic<bool> stop{false};
  std::thread second([&, link = plant_end.get()] {
    for (; !over; sleep_until(monotonic_ns() + kMillisecond)) {
      encode(other, packet);
      link->inject(Channel::kCommand, packet.bytes.data(), static_cast<std::size_t>(packet.size));
    }
  });
  const PlantRunReport report = run_plant(session, *plant_end, {}, nullptr, stop);
  sleep_until(monotonic_ns() + 20 * kMillisecond);
  over = true;
  thread.join();
  second.join();
  EXPECT_EQ(report.end, PlantRunEnd::kSecondController);
  EXPECT_LT(report.samples, 100'000);
  EXPECT_EQ(told, FaultCause::kSecondController);
}

TEST(PlantLoop, brakes_each_joint_with_the_time_constant_asked_for) {
  // A point mass m at distance l: inertia m l^2, so b = m l^2 / tau.
  Scenario pendulum = scenario(10);
  pendulum.plant = [] { return std::make_unique<SerialArm>(point_pendulum(0.7)); };
  pendulum.external_torque.clear();
  EXPECT_NEAR(viscous_brake(pendulum, 0.05)[0], 0.49 / 0.05, 1e-9);
}

}  // namespace
}  // namespace quasilpv::testing
