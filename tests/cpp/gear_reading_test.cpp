// Sensors on both sides of gears that give: which angle a law controls, and their way from the plant to the law.
#include "quasilpv/gear_reading.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>

#include "loop_fixture.hpp"
#include "not_finite.hpp"
#include "quasilpv/in_process_link.hpp"
#include "quasilpv/link_robot.hpp"
#include "quasilpv/plant_robot.hpp"
#include "quasilpv/run_controller.hpp"

namespace quasilpv::testing {
namespace {

const JointArray kEncoder{0.1, 0.2, 0.3};
const JointArray kMotor{0.11, 0.22, 0.33};
const JointArray kLink{0.09, 0.19, 0.29};

GearReading gears(std::uint32_t available) { return {available, kMotor, kLink, {1.0, 2.0, 3.0}}; }

TEST(GearReading, a_robot_that_says_nothing_of_sides_has_one_encoder_for_every_law) {
  for (const AngleSide side : {AngleSide::kJoint, AngleSide::kMotor, AngleSide::kLink}) {
    for (const std::uint32_t available : {std::uint32_t{kNoGearSensor}, std::uint32_t{kJointTorque}}) {
      const GearReading reading = gears(available);
      EXPECT_EQ(controlled_angle(side, kEncoder, reading), &kEncoder);
    }
  }
}

TEST(GearReading, a_law_with_a_side_gets_that_side_or_nothing) {
  const GearReading both = gears(kMotorAngle | kLinkAngle);
  EXPECT_EQ(controlled_angle(AngleSide::kJoint, kEncoder, both), &kEncoder);
  EXPECT_EQ(controlled_angle(AngleSide::kMotor, kEncoder, both), &both.motor_angle_rad);
  EXPECT_EQ(controlled_angle(AngleSide::kLink, kEncoder, both), &both.link_angle_rad);
  const GearReading motor = gears(kMotorAngle);
  const GearReading link = gears(kLinkAngle);
  EXPECT_EQ(controlled_angle(AngleSide::kLink, kEncoder, motor), nullptr);
  EXPECT_EQ(controlled_angle(AngleSide::kMotor, kEncoder, link), nullptr);
}

TEST(GearReading, a_sensor_of_which_one_joint_failed_is_not_there_and_entries_past_the_joints_are_not_looked_at) {
  for (const double bad : {kNaN, kInfinity}) {
    GearReading reading = gears(kAllGearSensors);
    reading.link_angle_rad[1] = bad;
    reading.joint_torque_nm[3] = bad;
    EXPECT_EQ(without_failed_sensors(reading, 3).available, kMotorAngle | kJointTorque);
    EXPECT_EQ(without_failed_sensors(reading, 4).available, kMotorAngle);
    EXPECT_EQ(without_failed_sensors(reading, 1).available, kAllGearSensors);
  }
}

Artifact motor_artifact() {
  return Artifact::parse(json_twin(with_chain(artifact_table("motor-pid", kJoints))), "test");
}

/// The encoders say nonsense: only the motors' angles can be what is controlled.
RobotReading motor_reading(std::int64_t seq, const JointArray& motor) {
  RobotReading result = reading(seq, {kNaN, kNaN, kNaN});
  result.gears.available = kMotorAngle | kJointTorque;
  result.gears.motor_angle_rad = motor;
  result.gears.joint_torque_nm = {4.0, 5.0, 6.0};
  return result;
}

TEST(GearReading, the_loop_controls_the_angles_of_the_laws_side_and_publishes_all) {
  const Artifact law = motor_artifact();
  ControlLoop loop(law, trajectory(), {});
  ControlLoop with_one_encoder(law, trajectory(), {});
  auto ring = std::make_unique<SampleRing>();
  loop.publish_to(ring.get());
  for (std::int64_t k = 0; k < 5; ++k) {
    loop.handle(motor_reading(k, kStart), at(k));
    with_one_encoder.handle(reading(k), at(k));
    EXPECT_EQ(loop.command().torque_nm, with_one_encoder.command().torque_nm);
    EXPECT_EQ(loop.command().flags, with_one_encoder.command().flags);
    TelemetrySample sample;
    ASSERT_TRUE(ring->pop(sample));
    EXPECT_EQ(sample.measured_angle_rad, kStart);
    EXPECT_EQ(sample.gears.available, kMotorAngle | kJointTorque);
    EXPECT_EQ(sample.gears.motor_angle_rad, kStart);
    EXPECT_EQ(sample.gears.joint_torque_nm, (JointArray{4.0, 5.0, 6.0}));
  }
  EXPECT_NE(loop.command().torque_nm, JointArray{});
  EXPECT_EQ(loop.state(), ControllerState::kRunning);
}

TEST(GearReading, F19_a_motor_outside_the_domain_is_refused_by_name_whatever_the_encoders_say) {
  ControlLoop loop(motor_artifact(), trajectory(), {});
  RobotReading first = motor_reading(0, {kStart[0], 7.5, kStart[2]});
  first.angle_rad = kStart;
  loop.handle(first, at(0));
  ASSERT_TRUE(loop.refusal().has_value());
  EXPECT_EQ(loop.refusal()->joint, 1);
  EXPECT_EQ(loop.refusal()->angle_rad, 7.5);
}

TEST(GearReading, F20_a_jump_of_the_controlled_side_is_predicted_and_one_of_the_other_side_is_not) {
  ControlLoop loop(motor_artifact(), trajectory(), {});
  loop.handle(motor_reading(0, kStart), at(0));
  RobotReading other = motor_reading(1, kStart);
  other.gears.available |= kLinkAngle;
  other.gears.link_angle_rad = {50.0, 50.0, 50.0};
  loop.handle(other, at(1));
  EXPECT_EQ(loop.command().flags & kMeasurementImplausible, 0u);
  loop.handle(motor_reading(2, {kStart[0] + 6.28, kStart[1], kStart[2]}), at(2));
  EXPECT_NE(loop.command().flags & kMeasurementImplausible, 0u);
  EXPECT_EQ(loop.predicted_steps(), 1);
}

TEST(GearReading, F2_when_encoders_sit_on_the_other_side_only_expect_no_torque_and_a_fault) {
  ControlLoop loop(motor_artifact(), trajectory(), {});
  for (std::int64_t k = 0; k < 25; ++k) {
    RobotReading wrong = reading(k);
    wrong.gears.available = kLinkAngle;
    wrong.gears.link_angle_rad = kStart;
    loop.handle(wrong, at(k));
    EXPECT_EQ(loop.command().torque_nm, JointArray{});
  }
  EXPECT_EQ(loop.state(), ControllerState::kFault);
  EXPECT_EQ(loop.cause(), FaultCause::kMeasurementLost);
}

TEST(GearReading, F1_when_an_encoder_of_the_controlled_side_fails_expect_prediction_and_not_the_other_encoder) {
  ControlLoop loop(motor_artifact(), trajectory(), {});
  loop.handle(motor_reading(0, kStart), at(0));
  RobotReading failed = motor_reading(1, {kStart[0], kNaN, kStart[2]});
  failed.angle_rad = kStart;
  loop.handle(failed, at(1));
  EXPECT_EQ(loop.command().flags, kMeasurementInvalid);
  EXPECT_EQ(loop.predicted_steps(), 1);
}

TEST(GearReading, keeps_its_numbers_over_a_link) {
  const Artifact law = motor_artifact();
  auto ends = InProcessLink::create_pair(identity_of(law));
  measurement_v3 sent = measurement(4, kEncoder);
  const GearReading expected = gears(kMotorAngle | kJointTorque);
  set_gears(expected, sent);
  ends.second->send(sent);
  LinkRobot robot(*ends.first);
  RobotReading received;
  ASSERT_TRUE(robot.read(received, kNanosecondsPerSecond));
  EXPECT_EQ(received.angle_rad, kEncoder);
  EXPECT_EQ(received.gears.available, expected.available);
  EXPECT_EQ(received.gears.motor_angle_rad, expected.motor_angle_rad);
  EXPECT_EQ(received.gears.link_angle_rad, expected.link_angle_rad);
  EXPECT_EQ(received.gears.joint_torque_nm, expected.joint_torque_nm);
}

}  // namespace
}  // namespace quasilpv::testing
