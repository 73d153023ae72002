// How a loop starts, and which measurements it believes: motion and torques of every law, on a plant that is the design
// model with held accelerations.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <string>

#include "decompositions.hpp"
#include "loop_fixture.hpp"
#include "not_finite.hpp"

namespace quasilpv::testing {
namespace {

constexpr double T = kSamplePeriod;
constexpr double kTurn = 6.283185307179586;
constexpr double kTorqueLimit = 1500.0;
constexpr double kDomainSpeed = 2.0;
constexpr std::int64_t kSamples = 2500;

/// th'' = M(th)^-1 (Gamma - G(th) + push), held over a sample.
struct DesignPlant {
  TestArm arm{kJoints};
  Eigen::VectorXd push = Eigen::VectorXd::Zero(kJoints);
  Eigen::VectorXd angle = Eigen::VectorXd::Zero(kJoints);
  Eigen::VectorXd speed = Eigen::VectorXd::Zero(kJoints);

  static DesignPlant on(const Reference& reference) {
    DesignPlant plant;
    plant.angle = to_vector(reference.angle, kJoints);
    plant.speed = to_vector(reference.speed, kJoints);
    return plant;
  }

  RobotReading reading(std::int64_t seq) const {
    RobotReading result;
    result.seq = seq;
    result.angle_rad = to_joint_array(angle);
    result.speed_rad_s = to_joint_array(speed);
    return result;
  }

  void advance(const JointArray& torque) {
    const Eigen::VectorXd acceleration =
        inverse(arm.inertia(angle)) * (to_vector(torque, kJoints) - arm.gravity(angle) + push);
    angle += T * speed + T * T / 2.0 * acceleration;
    speed += T * acceleration;
  }
};

Reference path(std::int64_t seq) { return trajectory().evaluate(static_cast<double>(seq) * T); }

/// Largest speed of any joint while the loop controls the plant.
double follow(ControlLoop& loop, DesignPlant& plant, std::int64_t first, std::int64_t end) {
  double largest = plant.speed.cwiseAbs().maxCoeff();
  for (std::int64_t seq = first; seq < end; ++seq) {
    loop.handle(plant.reading(seq), at(seq));
    plant.advance(loop.command().torque_nm);
    largest = std::max(largest, plant.speed.cwiseAbs().maxCoeff());
  }
  return largest;
}

/// The first torque of the law without an error: at rest where the arm is, with the acceleration of the reference.
Eigen::VectorXd own_torque(const std::string& kind, const DesignPlant& plant, std::int64_t seq) {
  Controller law(artifact(kind, kDomainSpeed));
  StepInput input;
  input.angle = to_joint_array(plant.angle);
  input.reference.angle = input.angle;
  input.reference.acceleration = path(seq).acceleration;
  return to_vector(law.step(input).torque_applied, kJoints);
}

LoopSettings bumpless() {
  LoopSettings settings;
  settings.bumpless_start = true;
  return settings;
}

class Start : public ::testing::TestWithParam<const char*> {
 protected:
  double undisturbed() const {
    ControlLoop loop(artifact(GetParam(), kDomainSpeed), trajectory(), {});
    DesignPlant plant = DesignPlant::on(path(0));
    return follow(loop, plant, 0, kSamples);
  }

  /// Motion and torque of a start at `first`: largest speed 1.5 times the undisturbed one plus the joining motion, a
  /// quarter of the domain's speed and the speed that the arm has too much.
  void expect_gentle(DesignPlant plant, std::int64_t first) const {
    const double surplus = (plant.speed - to_vector(path(first).speed, kJoints)).cwiseAbs().maxCoeff();
    const Eigen::VectorXd own = own_torque(GetParam(), plant, first);
    ControlLoop loop(artifact(GetParam(), kDomainSpeed), trajectory(), bumpless());
    loop.handle(plant.reading(first), at(first));
    const Eigen::VectorXd torque = to_vector(loop.command().torque_nm, kJoints);
    EXPECT_LE((torque - own).cwiseAbs().maxCoeff(), 0.05 * kTorqueLimit);
    plant.advance(loop.command().torque_nm);
    EXPECT_LE(follow(loop, plant, first + 1, kSamples), 1.5 * undisturbed() + 0.25 * kDomainSpeed + surplus);
    EXPECT_EQ(loop.state(), ControllerState::kRunning);
  }
};

TEST_P(Start, F11_on_the_reference_is_gentle_in_torque_and_motion) { expect_gentle(DesignPlant::on(path(0)), 0); }

TEST_P(Start, F11_a_tenth_of_a_radian_beside_the_reference_is_gentle_in_torque_and_motion) {
  for (const double side : {-0.1, 0.1}) {
    DesignPlant plant = DesignPlant::on(path(0));
    plant.angle.array() += side;
    expect_gentle(plant, 0);
  }
}

TEST_P(Start, F11_while_the_arm_moves_with_and_against_the_reference_is_gentle_in_torque_and_motion) {
  for (const double speed : {-1.0, -0.3, 0.0, 0.3, 1.0}) {
    DesignPlant plant = DesignPlant::on(path(500));
    plant.angle.array() += 0.05;
    plant.speed.array() += speed;
    expect_gentle(plant, 500);
  }
}

TEST_P(Start, F11_without_a_measurement_waits_and_then_begins_where_the_arm_is) {
  ControlLoop loop(artifact(GetParam(), kDomainSpeed), trajectory(), bumpless());
  DesignPlant plant = DesignPlant::on(path(0));
  plant.angle.array() += 0.1;
  loop.handle(reading(0, {kNaN, kNaN, kNaN}), at(0));
  EXPECT_EQ(loop.command().torque_nm, JointArray{});
  loop.handle(plant.reading(1), at(1));
  const Eigen::VectorXd torque = to_vector(loop.command().torque_nm, kJoints);
  EXPECT_LT((torque - own_torque(GetParam(), plant, 1)).cwiseAbs().maxCoeff(), 1e-9);
}

TEST_P(Start, F11_out_of_a_fault_without_a_push_begins_at_the_torque_of_the_law_without_an_error) {
  ControlLoop loop(artifact(GetParam(), kDomainSpeed), trajectory(), {});
  DesignPlant plant = DesignPlant::on(path(0));
  follow(loop, plant, 0, 300);
  for (std::int64_t seq = 300; seq < 320; ++seq) {
    loop.handle(reading(seq, {kNaN, kNaN, kNaN}), at(seq));
    plant.advance(loop.command().torque_nm);
  }
  ASSERT_EQ(loop.state(), ControllerState::kFault);
  follow(loop, plant, 320, 380);
  ASSERT_TRUE(loop.reset_fault());
  loop.handle(plant.reading(380), at(380));
  const Eigen::VectorXd torque = to_vector(loop.command().torque_nm, kJoints);
  EXPECT_LT((torque - own_torque(GetParam(), plant, 380)).cwiseAbs().maxCoeff(), 1e-6);  // sees rounding
  plant.advance(loop.command().torque_nm);
  const double surplus = (plant.speed - to_vector(path(381).speed, kJoints)).cwiseAbs().maxCoeff();
  EXPECT_LE(follow(loop, plant, 381, kSamples), 1.5 * undisturbed() + 0.25 * kDomainSpeed + surplus);
}

// Who does not watch during the fault takes what the law would have asked for beside the torque in force for a push,
// and who forgets the push lets the arm go until it has learnt it again: to twice the speed that is allowed here.
TEST_P(Start, F11_out_of_a_fault_a_push_from_outside_is_not_learnt_anew) {
  for (const double size : {1.0, 3.0}) {
    for (const std::int64_t watched : {1, 10, 200}) {
      ControlLoop loop(artifact(GetParam(), kDomainSpeed), trajectory(), {});
      DesignPlant plant = DesignPlant::on(path(0));
      plant.push << 40.0 * size, -30.0 * size, 15.0 * size;
      follow(loop, plant, 0, 300);
      SampleConditions foreign = at(300);
      foreign.consecutive_foreign = 1000;
      loop.handle(plant.reading(300), foreign);
      ASSERT_EQ(loop.cause(), FaultCause::kForeignMessages);
      plant.advance(loop.command().torque_nm);
      const std::int64_t reset = 301 + watched;
      follow(loop, plant, 301, reset);
      ASSERT_TRUE(loop.reset_fault());
      const Eigen::VectorXd in_force = to_vector(loop.command().torque_nm, kJoints);
      loop.handle(plant.reading(reset), at(reset));
      const Eigen::VectorXd step = to_vector(loop.command().torque_nm, kJoints) - in_force;
      const Eigen::VectorXd own = own_torque(GetParam(), plant, reset) - in_force;
      EXPECT_LE((step.cwiseAbs() - own.cwiseAbs()).maxCoeff(), 0.05 * kTorqueLimit + 1e-9);
      plant.advance(loop.command().torque_nm);
      double surplus = 0.0;
      for (std::int64_t seq = reset + 1; seq <= reset + 50; ++seq) {
        follow(loop, plant, seq, seq + 1);
        const Eigen::VectorXd beside = plant.speed - to_vector(path(seq + 1).speed, kJoints);
        surplus = std::max(surplus, beside.cwiseAbs().maxCoeff());
      }
      if (std::string(GetParam()).rfind("dob-", 0) == 0 && watched <= 10) {  // the safe torque has not let go yet
        EXPECT_LT(surplus, 0.008 * size) << size << ", watched " << watched;
      }
    }
  }
}

TEST_P(Start, F19_an_angle_outside_the_domain_is_refused_by_name_before_any_torque) {
  for (std::size_t joint = 0; joint < kJoints; ++joint) {
    for (const double beside : {-3 * kTurn, -kTurn, kTurn, 2 * kTurn, 2.5, -2.5}) {
      for (const bool bumpless_start : {false, true}) {
        LoopSettings settings;
        settings.bumpless_start = bumpless_start;
        ControlLoop loop(artifact(GetParam(), kDomainSpeed), trajectory(), settings);
        RobotReading first = reading(0);
        first.angle_rad[joint] += beside;
        loop.handle(first, at(0));
        ASSERT_TRUE(loop.refusal());
        EXPECT_EQ(loop.refusal()->joint, static_cast<int>(joint));
        EXPECT_EQ(loop.refusal()->angle_rad, first.angle_rad[joint]);
        EXPECT_EQ(loop.refusal()->expected.low, -2.0);
        EXPECT_EQ(loop.refusal()->expected.high, 2.0);
        EXPECT_EQ(loop.state(), ControllerState::kFault);
        EXPECT_EQ(loop.cause(), FaultCause::kStartRefused);
        EXPECT_EQ(loop.command().torque_nm, JointArray{});
      }
    }
  }
}

// The twin is told that the measurement is not there: what follows must be the same, bit for bit.
TEST_P(Start, F20_one_measurement_turns_away_is_predicted_like_a_lost_one_and_counted) {
  for (std::size_t joint = 0; joint < kJoints; ++joint) {
    for (const double jump : {-2 * kTurn, -kTurn, kTurn, 0.5, -0.1, 0.02}) {
      ControlLoop loop(artifact(GetParam(), kDomainSpeed), trajectory(), {});
      ControlLoop twin(artifact(GetParam(), kDomainSpeed), trajectory(), {});
      DesignPlant plant = DesignPlant::on(path(0));
      for (std::int64_t seq = 0; seq < 260; ++seq) {
        RobotReading told = plant.reading(seq);
        RobotReading lost = told;
        told.angle_rad[joint] += seq == 200 ? jump : 0.0;
        lost.angle_rad[joint] = seq == 200 ? kNaN : lost.angle_rad[joint];
        loop.handle(told, at(seq));
        twin.handle(lost, at(seq));
        ASSERT_EQ(loop.command().torque_nm, twin.command().torque_nm) << seq;
        ASSERT_EQ((loop.command().flags & kMeasurementImplausible) != 0, seq == 200) << jump << " at " << seq;
        plant.advance(loop.command().torque_nm);
      }
      EXPECT_EQ(loop.predicted_steps(), 1);
      EXPECT_EQ(loop.state(), ControllerState::kRunning);
    }
  }
}

TEST_P(Start, F20_measurements_that_stay_turns_away_are_a_fault_at_the_20th_and_no_reset_leaves_it) {
  for (std::size_t joint = 0; joint < kJoints; ++joint) {
    for (const double jump : {-kTurn, kTurn, 3 * kTurn, 0.3}) {
      ControlLoop loop(artifact(GetParam(), kDomainSpeed), trajectory(), {});
      DesignPlant plant = DesignPlant::on(path(0));
      follow(loop, plant, 0, 200);
      for (std::int64_t seq = 200; seq < 300; ++seq) {
        RobotReading told = plant.reading(seq);
        told.angle_rad[joint] += jump;
        loop.handle(told, at(seq));
        ASSERT_EQ(loop.state() == ControllerState::kFault, seq >= 219) << seq;
        plant.advance(loop.command().torque_nm);
      }
      EXPECT_EQ(loop.cause(), FaultCause::kMeasurementImplausible);
      EXPECT_EQ(loop.command().torque_nm, JointArray{});
      if (std::abs(jump) >= kTurn) {
        EXPECT_FALSE(loop.reset_fault());
      }
    }
  }
}

TEST_P(Start, F20_before_the_arm_moves_a_jump_is_not_taken_for_speed) {
  for (const double jump : {-kTurn, kTurn, 0.3}) {
    ControlLoop loop(artifact(GetParam(), kDomainSpeed), trajectory(), bumpless());
    loop.handle(reading(0), at(0));
    for (std::int64_t seq = 1; seq <= 20; ++seq) {
      loop.handle(reading(seq, {kStart[0], kStart[1] + jump, kStart[2]}), at(seq));
      ASSERT_NE(loop.command().flags & kMeasurementImplausible, 0u);
    }
    EXPECT_EQ(loop.cause(), FaultCause::kMeasurementImplausible);
  }
}

// 5 rad/s, the domain's being 2: every step is possible, the speed is not.
TEST_P(Start, F21_a_speed_beyond_twice_the_domains_is_a_fault) {
  ControlLoop loop(artifact(GetParam(), kDomainSpeed), trajectory(), {});
  std::int64_t seq = 0;
  for (; seq < 300 && loop.state() != ControllerState::kFault; ++seq) {
    RobotReading told = reading(seq, {kStart[0], kStart[1], kStart[2] - 5.0 * T * static_cast<double>(seq)});
    told.speed_rad_s = {0.0, 0.0, seq > 0 ? -5.0 : 0.0};
    loop.handle(told, at(seq));
  }
  EXPECT_LT(seq, 60);
  const bool estimated =
      loop.cause() == FaultCause::kSpeedBeyondDomain;  // laws that read speeds refuse the measurement
  EXPECT_TRUE(estimated || loop.cause() == FaultCause::kMeasurementImplausible) << to_string(loop.cause());
}

TEST_P(Start, F21_the_largest_speed_of_the_domain_is_none) {
  ControlLoop loop(artifact(GetParam(), kDomainSpeed), trajectory(), {});
  for (std::int64_t seq = 0; seq < 300; ++seq) {
    RobotReading told = reading(seq, {kStart[0], kStart[1], kStart[2] - 2.0 * T * static_cast<double>(seq)});
    told.speed_rad_s = {0.0, 0.0, -2.0};
    loop.handle(told, at(seq));
    ASSERT_EQ(loop.predicted_steps(), 0) << seq;
  }
  EXPECT_EQ(loop.state(), ControllerState::kRunning);
}

TEST(Start, F11_what_a_law_remembers_of_a_push_is_what_it_measured_last_and_not_what_it_predicted) {
  for (const char* kind : {"dob-acceleration", "dob-torque"}) {
    Controller law(artifact(kind));
    StepInput input;
    input.overruled = true;
    input.in_force = {3.0, -2.0, 1.0};
    StepReport seen;
    for (; input.seq < 50; ++input.seq) {
      input.angle = {kStart[0] + 1e-5 * static_cast<double>(input.seq), kStart[1], kStart[2]};
      seen = law.step(input);
    }
    ASSERT_NE(seen.estimated_disturbance, JointArray{});
    input.valid = false;
    input.in_force = {1e3, -1e3, 1e3};
    for (int sample = 0; sample < 100; ++sample) {
      law.step(input);
    }
    input.valid = true;  // where the prediction is not
    law.step(input);
    law.take_over(input.in_force, {});
    input.overruled = false;
    EXPECT_EQ(law.step(input).estimated_disturbance, seen.estimated_disturbance) << kind;
    law.reset();
    EXPECT_EQ(law.step(input).estimated_disturbance, JointArray{}) << kind;
  }
}

INSTANTIATE_TEST_SUITE_P(Faults, Start, ::testing::ValuesIn(kLawKinds), [](const auto& kind) {
  std::string name = kind.param;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

TEST(Start, F19_a_joint_of_a_whole_turn_starts_within_one_radian_of_its_reference) {
  Json table = artifact_table("dob-acceleration", kJoints);
  table["domain"]["angle_rad"][1] = {-4.0, 4.0};
  const Artifact wide = Artifact::parse(json_twin(table), "test");
  for (const double beside : {-0.99, 0.0, 0.99, -1.01, 1.01, kTurn}) {
    ControlLoop loop(wide, trajectory(), {});
    loop.handle(reading(0, {kStart[0], kStart[1] + beside, kStart[2]}), at(0));
    EXPECT_EQ(loop.refusal().has_value(), std::abs(beside) > 1.0) << beside;
  }
}

}  // namespace
}  // namespace quasilpv::testing
