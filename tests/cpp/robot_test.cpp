// The hardware seam: every implementation gives the same run, and what goes over it besides torques.
#include "quasilpv/robot.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <memory>

#include "loop_fixture.hpp"
#include "quasilpv/in_process_link.hpp"
#include "quasilpv/link_robot.hpp"
#include "quasilpv/plant_robot.hpp"
#include "quasilpv/run_controller.hpp"

namespace quasilpv::testing {
namespace {

constexpr std::int64_t kSecond = kNanosecondsPerSecond;

TEST(PlantRobot, gives_under_run_controller_the_samples_of_the_in_process_run_bit_for_bit) {
  constexpr std::int64_t kSamples = 300;
  const Artifact law = artifact();
  const Scenario experiment = scenario(kSamples);
  const RunRecord in_process = run_in_process(law, experiment);

  PlantSession session(experiment, kSamplePeriod);
  PlantRobot robot(session);
  ControlLoop loop(law, trajectory(), {});
  auto ring = std::make_unique<SampleRing>();
  loop.publish_to(ring.get());
  const std::atomic<bool> stop{false};
  const ControllerRunReport report = run_controller(loop, robot, {}, stop);

  EXPECT_EQ(report.end, ControllerRunEnd::kPlantEnded);
  EXPECT_EQ(robot.failure(), "");
  const std::vector<double>& torque = in_process.samples["torque_applied_nm"].values;
  ASSERT_EQ(torque.size(), static_cast<std::size_t>(kSamples * law.joints()));
  TelemetrySample sample;
  for (std::size_t i = 0; i < torque.size(); i += 3) {
    ASSERT_TRUE(ring->pop(sample));
    for (std::size_t j = 0; j < 3; ++j) {
      ASSERT_EQ(sample.applied_torque_nm[j], torque[i + j]) << "sample " << sample.seq;
    }
  }
}

TEST(PlantRobot, F17_when_the_plant_cannot_be_integrated_expect_the_run_ended_with_the_flag_by_name_and_the_time) {
  Scenario experiment = scenario(50);
  experiment.external_torque = {{0, 1e300, 50.0, 0.0}};
  PlantSession session(experiment, kSamplePeriod);
  PlantRobot robot(session);
  ControlLoop loop(artifact(), trajectory(), {});
  const std::atomic<bool> stop{false};
  EXPECT_EQ(run_controller(loop, robot, {}, stop).end, ControllerRunEnd::kPlantEnded);
  EXPECT_NE(robot.failure().find("IDA"), std::string::npos) << robot.failure();
  EXPECT_NE(robot.failure().find("t = "), std::string::npos) << robot.failure();
  RobotReading reading;
  EXPECT_FALSE(robot.read(reading, 0)) << "the last state would be repeated";
}

class OverALink : public ::testing::Test {
 protected:
  /// An event of `session`, from a person, about the fault at `seq` of the controller named `receiver`.
  void ask_for_reset(std::int64_t session, std::int64_t receiver, std::int64_t seq) {
    event_v2 event{};
    event.session = session;
    event.receiver = receiver;
    event.seq = seq;
    event.artifact_hash = law_.hash_prefix();
    event.source = static_cast<std::int32_t>(Side::kOperator);
    event.code = static_cast<std::int32_t>(EventCode::kReset);
    Packet packet;
    encode(event, packet);
    ends_.first->inject(Channel::kEvent, packet.bytes.data(), static_cast<std::size_t>(packet.size));
    RobotReading reading;
    robot_.read(reading, 0);
  }

  Artifact law_ = artifact();
  std::pair<std::unique_ptr<InProcessLink>, std::unique_ptr<InProcessLink>> ends_ =
      InProcessLink::create_pair(identity_of(law_));
  InProcessLink& plant_ = *ends_.second;
  LinkRobot robot_{*ends_.first};
};

TEST_F(OverALink, a_reading_and_a_command_keep_their_numbers) {
  measurement_v3 sent = measurement(4, {0.1, 0.2, 0.3});
  sent.speed_rad_s[2] = -5.0;
  plant_.send(sent);
  RobotReading reading;
  ASSERT_TRUE(robot_.read(reading, kSecond));
  EXPECT_EQ(reading.seq, 4);
  EXPECT_EQ(reading.angle_rad, (JointArray{0.1, 0.2, 0.3}));
  EXPECT_EQ(reading.speed_rad_s[2], -5.0);
  EXPECT_LE(reading.taken_ns, monotonic_ns());

  robot_.write({4, {1.0, 2.0, 3.0}, ControllerState::kDegraded, kSlewLimited});
  command_v2 command{};
  ASSERT_TRUE(plant_.receive(kSecond));
  ASSERT_TRUE(plant_.take(command));
  EXPECT_EQ(command.seq, 4);
  EXPECT_EQ(command.torque_nm[2], 3.0);
  EXPECT_EQ(command.state, static_cast<std::int32_t>(ControllerState::kDegraded));
  EXPECT_EQ(command.flags, static_cast<std::int32_t>(kSlewLimited));
}

TEST_F(OverALink, a_reset_is_heard_with_the_right_session_and_controller_and_fault_only) {
  const std::int64_t session = identity_of(law_).session;
  const std::int64_t controller = ends_.first->sender();
  robot_.write({19, {}, ControllerState::kRunning, kStepHealthy});
  ask_for_reset(session, controller, 19);
  EXPECT_EQ(robot_.take_request(), RobotRequest::kNone) << "there is no fault";
  for (std::int64_t seq = 20; seq < 30; ++seq) {
    robot_.write({seq, {}, ControllerState::kFault, kStepHealthy});
  }
  ask_for_reset(session + 1, controller, 25);
  ask_for_reset(session, controller + 1, 25);
  ask_for_reset(session, 0, 25);
  ask_for_reset(session, controller, 19);
  ask_for_reset(session, controller, 30);
  EXPECT_EQ(robot_.take_request(), RobotRequest::kNone);
  EXPECT_EQ(ends_.first->counters().unfit_events, 5);
  ask_for_reset(session, controller, 25);
  EXPECT_EQ(robot_.take_request(), RobotRequest::kResetFault);
}

TEST_F(OverALink, an_end_is_heard_from_the_plant_although_another_event_came_after_it) {
  plant_.send(measurement(6));
  plant_.send(EventCode::kEnded, 7);
  plant_.send(EventCode::kStarted, 0);
  RobotReading reading;
  robot_.read(reading, kSecond);
  EXPECT_EQ(robot_.take_request(), RobotRequest::kEnd);
}

}  // namespace
}  // namespace quasilpv::testing
