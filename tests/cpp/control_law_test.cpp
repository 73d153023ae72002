// Every law against its formulas written out a second time, and what happens at limits and with bad input.
#include "quasilpv/control_law.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <random>

#include "control_law_fixture.hpp"
#include "not_finite.hpp"
#include "quasilpv/controller.hpp"

namespace quasilpv {
namespace {

using ::quasilpv::testing::artifact_table;
using ::quasilpv::testing::has_schedule;
using ::quasilpv::testing::json_twin;
using ::quasilpv::testing::kInfinity;
using ::quasilpv::testing::kNaN;
using ::quasilpv::testing::kSamplePeriod;
using ::quasilpv::testing::OutputStage;
using ::quasilpv::testing::Sample;
using ::quasilpv::testing::TestArm;
using ::quasilpv::testing::to_joint_array;
using ::quasilpv::testing::to_vector;
using ::quasilpv::testing::written_out;
using ::quasilpv::testing::WrittenOutDobAcceleration;
using ::quasilpv::testing::WrittenOutLaw;

struct Case {
  std::string kind;
  int joints;
};

Json limited_table(const Case& c, double torque_nm, double slew_nm_per_s) {
  Json table = artifact_table(c.kind, c.joints);
  table["limits"]["torque_nm"] = std::vector<double>(static_cast<std::size_t>(c.joints), torque_nm);
  table["limits"]["slew_nm_per_s"] = std::vector<double>(static_cast<std::size_t>(c.joints), slew_nm_per_s);
  return table;
}

Controller controller_of(const Json& table) { return Controller(Artifact::parse(json_twin(table), "test")); }

// A random walk near a random walk: some premises leave their box, and torques reach small limits.
class RandomSamples {
 public:
  RandomSamples(int joints, unsigned seed) : joints_(joints), random_(seed), centre_(uniform(1.5)) {}

  Sample next() {
    centre_ += uniform(0.002);
    return {centre_ + uniform(1e-4), uniform(2.0), centre_ + uniform(1e-3), uniform(2.0), uniform(5.0)};
  }

 private:
  Eigen::VectorXd uniform(double size) {
    std::uniform_real_distribution<double> distribution(-size, size);
    return Eigen::VectorXd::NullaryExpr(joints_, [&] { return distribution(random_); });
  }

  int joints_;
  std::mt19937_64 random_;
  Eigen::VectorXd centre_;
};

double largest_difference(const JointArray& actual, const Eigen::VectorXd& expected) {
  return (to_vector(actual, static_cast<int>(expected.size())) - expected).cwiseAbs().maxCoeff();
}

class EveryLaw : public ::testing::TestWithParam<Case> {
 protected:
  int joints() const { return GetParam().joints; }
  Sample sample() { return samples_.next(); }
  /// The torque where the reference is met: gravity and feedforward, of which some laws have none.
  Eigen::VectorXd torque_on_the_reference(const Sample& s) const {
    const TestArm arm{joints()};
    const bool feedback_only = GetParam().kind == "hinf-tracking" || has_schedule(GetParam().kind);
    const double fed_forward = feedback_only ? 0.0 : 1.0;
    return fed_forward * (arm.gravity(s.angle) + arm.inertia(s.angle) * s.reference_acceleration);
  }
  RandomSamples samples_{GetParam().joints, 59};
};

TEST_P(EveryLaw, equals_its_formulas_on_random_input_with_and_without_limits) {
  for (const auto& [torque, slew] : {std::pair{1e9, 1e15}, std::pair{120.0, 60000.0}}) {
    Controller controller = controller_of(limited_table(GetParam(), torque, slew));
    const auto law = written_out(GetParam().kind, {GetParam().joints}, {torque, slew * kSamplePeriod});
    int limited = 0;
    for (int k = 0; k < 500; ++k) {
      const Sample s = sample();
      const Eigen::VectorXd integral = law->integral;
      const Eigen::VectorXd commanded = law->step(s);
      const StepReport report = controller.step(s.input(k));
      const double scale = commanded.cwiseAbs().maxCoeff() + law->disturbance.cwiseAbs().maxCoeff() + 1.0;
      ASSERT_LT(largest_difference(report.torque_commanded, commanded), 1e-9 * scale) << "sample " << k;
      ASSERT_LT(largest_difference(report.torque_applied, law->output.last), 1e-9 * scale);
      ASSERT_LT(largest_difference(report.estimated_disturbance, law->disturbance), 1e-9 * scale);
      ASSERT_LT(largest_difference(report.integral_error, integral), 1e-12);
      ASSERT_EQ(report.seq, k);
      limited += (report.flags & (kTorqueSaturated | kSlewLimited)) != 0 ? 1 : 0;
    }
    EXPECT_EQ(limited > 0, torque < 1000.0);
  }
}

TEST_P(EveryLaw, reports_premises_after_clamping_and_flags_those_outside) {
  Controller controller = controller_of(artifact_table(GetParam().kind, joints()));
  Sample s = Sample::at_rest(Eigen::VectorXd::Constant(joints(), 0.4));
  StepReport report = controller.step(s.input(0));
  EXPECT_EQ(report.flags & kPremiseOutsideBox, 0u);
  EXPECT_EQ(report.premise[0], std::cos(0.4));
  s.angle(0) = 3.0;  // cos 3 < -0.5
  report = controller.step(s.input(1));
  EXPECT_NE(report.flags & kPremiseOutsideBox, 0u);
  EXPECT_EQ(report.premise[0], TestArm::kLower);
}

TEST_P(EveryLaw, starts_without_a_bump_with_the_gravity_and_feedforward_it_has) {
  Controller controller = controller_of(limited_table(GetParam(), 1500.0, 1.0));
  Sample s = Sample::at_rest(Eigen::VectorXd::Constant(joints(), 0.7));
  s.reference_acceleration.setConstant(3.0);
  const StepReport report = controller.step(s.input(0));
  EXPECT_LT(largest_difference(report.torque_applied, torque_on_the_reference(s)), 1e-11);
  EXPECT_EQ(report.flags, kStepHealthy) << "the first torque has no slew limit";
}

TEST_P(EveryLaw, when_measurement_is_not_finite_expect_finite_torque_and_flag_and_a_normal_next_cycle) {
  for (const double bad : {kNaN, kInfinity, -kInfinity}) {
    Controller controller = controller_of(artifact_table(GetParam().kind, joints()));
    const Sample rest = Sample::at_rest(Eigen::VectorXd::Constant(joints(), 0.4));
    const StepReport before = controller.step(rest.input(0));
    StepInput input = rest.input(1);
    input.angle[0] = bad;
    const StepReport during = controller.step(input);
    EXPECT_EQ(during.flags, kMeasurementInvalid);
    EXPECT_LT(largest_difference(during.torque_applied, to_vector(before.torque_applied, joints())), 1e-9);
    const StepReport after = controller.step(rest.input(2));
    EXPECT_EQ(after.flags, kStepHealthy);
    EXPECT_LT(largest_difference(after.torque_applied, to_vector(before.torque_applied, joints())), 1e-9);
  }
}

TEST_P(EveryLaw, when_input_is_marked_invalid_expect_its_numbers_ignored_and_the_integral_frozen) {
  Controller controller = controller_of(artifact_table(GetParam().kind, joints()));
  Sample s = Sample::at_rest(Eigen::VectorXd::Constant(joints(), 0.4));
  s.reference(0) += 0.001;
  controller.step(s.input(0));
  const StepReport before = controller.step(s.input(1));
  StepInput garbage = s.input(2);
  garbage.valid = false;
  garbage.angle.fill(1e6);
  garbage.speed.fill(-1e6);
  const StepReport during = controller.step(garbage);
  EXPECT_EQ(during.flags, kMeasurementInvalid);
  EXPECT_NEAR(during.estimated_angle[0], before.estimated_angle[0], 1e-3);
  garbage.seq = 3;
  EXPECT_EQ(controller.step(garbage).integral_error, during.integral_error);
}

TEST_P(EveryLaw, before_the_first_valid_measurement_expects_no_torque) {
  Controller controller = controller_of(artifact_table(GetParam().kind, joints()));
  const Sample rest = Sample::at_rest(Eigen::VectorXd::Constant(joints(), 0.4));
  StepInput input = rest.input(0);
  input.valid = false;
  const StepReport report = controller.step(input);
  EXPECT_EQ(report.flags, kMeasurementInvalid);
  EXPECT_EQ(report.torque_applied, JointArray{});
  EXPECT_LT(largest_difference(controller.step(rest.input(1)).torque_applied, torque_on_the_reference(rest)), 1e-11);
}

TEST_P(EveryLaw, when_reference_is_not_finite_expect_the_last_one_at_rest) {
  Controller controller = controller_of(artifact_table(GetParam().kind, joints()));
  Controller twin = controller_of(artifact_table(GetParam().kind, joints()));
  const Sample first = sample();
  controller.step(first.input(0));
  twin.step(first.input(0));
  Sample second = sample();
  Sample at_rest = second;
  second.reference_speed(0) = kNaN;
  at_rest.reference = first.reference;
  at_rest.reference_speed.setZero();
  at_rest.reference_acceleration.setZero();
  const StepReport report = controller.step(second.input(1));
  const StepReport expected = twin.step(at_rest.input(1));
  EXPECT_EQ(report.flags, expected.flags | kReferenceInvalid);
  EXPECT_EQ(report.torque_applied, expected.torque_applied);
}

TEST_P(EveryLaw, after_a_reset_repeats_itself_bit_for_bit) {
  Controller controller = controller_of(artifact_table(GetParam().kind, joints()));
  std::vector<Sample> run;
  std::vector<JointArray> torques;
  for (int k = 0; k < 50; ++k) {
    run.push_back(sample());
    torques.push_back(controller.step(run.back().input(k)).torque_applied);
  }
  controller.reset();
  for (int k = 0; k < 50; ++k) {
    ASSERT_EQ(controller.step(run[static_cast<std::size_t>(k)].input(k)).torque_applied,
              torques[static_cast<std::size_t>(k)]);
  }
}

TEST_P(EveryLaw, keeps_torque_finite_and_within_limits_for_any_input_and_recovers) {
  Controller controller = controller_of(limited_table(GetParam(), 1500.0, 1e6));
  std::mt19937_64 random(61);
  const std::vector<double> nasty = {kNaN, kInfinity, -kInfinity, 1e308, -1e308, 1e154, 1e-308, 0.0, -0.0};
  const auto corrupt = [&](JointArray& values) {
    values[random() % static_cast<unsigned>(joints())] = nasty[random() % nasty.size()];
  };
  for (int k = 0; k < 5000; ++k) {
    StepInput input = sample().input(k);
    corrupt(k % 2 == 0 ? input.angle : input.speed);
    corrupt(k % 3 == 0 ? input.reference.angle : input.reference.acceleration);
    const StepReport report = controller.step(input);
    for (const double torque : report.torque_applied) {
      ASSERT_TRUE(std::isfinite(torque));
      ASSERT_LE(std::abs(torque), 1500.0);
    }
  }
  controller.reset();
  EXPECT_EQ(controller.step(Sample::at_rest(Eigen::VectorXd::Zero(joints())).input(0)).flags, kStepHealthy);
}

TEST_P(EveryLaw, when_saturated_expect_the_integral_frozen_only_in_that_direction) {
  Controller controller = controller_of(limited_table(GetParam(), 0.5, 1e6));
  Sample s = Sample::at_rest(Eigen::VectorXd::Zero(joints()));
  s.reference.setConstant(0.1);  // needs more than 0.5 N m
  controller.step(s.input(0));
  const StepReport pushed = controller.step(s.input(1));
  EXPECT_NE(pushed.flags & kTorqueSaturated, 0u);
  EXPECT_EQ(pushed.integral_error, JointArray{});
  if (has_schedule(GetParam().kind)) {
    return;  // no integral to freeze
  }
  s.reference.setConstant(-0.1);
  s.reference_speed.setConstant(1e4);  // still cut off above, but the error now pulls away from the limit
  controller.step(s.input(2));
  const StepReport pulled = controller.step(s.input(3));
  EXPECT_NE(pulled.flags & kTorqueSaturated, 0u);
  EXPECT_NE(pulled.integral_error[0], 0.0);
}

std::vector<Case> every_case() {
  std::vector<Case> cases;
  for (const char* kind : ::quasilpv::testing::kLawKinds) {
    for (const int joints : {1, 3, 7}) {
      cases.push_back({kind, joints});
    }
  }
  return cases;
}

INSTANTIATE_TEST_SUITE_P(ControlLaw, EveryLaw, ::testing::ValuesIn(every_case()), [](const auto& c) {
  std::string name = c.param.kind + "_" + std::to_string(c.param.joints);
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

TEST(DobAccelerationLaw, without_compensation_observes_the_same_way_and_leaves_out_only_the_disturbance) {
  Json table = artifact_table("dob-acceleration", 3);
  table["law"]["disturbance_compensation"] = false;
  Controller controller = controller_of(table);
  WrittenOutDobAcceleration law({3}, {1500.0, 1e6 * kSamplePeriod});
  law.compensation = 0.0;
  RandomSamples samples(3, 67);
  for (int k = 0; k < 200; ++k) {
    const Sample s = samples.next();
    const Eigen::VectorXd commanded = law.step(s);
    const StepReport report = controller.step(s.input(k));
    const double scale = commanded.cwiseAbs().maxCoeff() + law.d_f.cwiseAbs().maxCoeff();
    ASSERT_LT(largest_difference(report.torque_commanded, commanded), 1e-9 * scale);
    ASSERT_LT(largest_difference(report.filtered_disturbance, law.d_f), 1e-9 * scale);
  }
}

TEST(DobAccelerationLaw, when_the_model_has_no_finite_answer_expect_a_flag_and_the_last_torque) {
  Json table = artifact_table("dob-acceleration", 1);
  // Gravity that is not defined beyond one radian.
  table["programs"]["gravity"] = {{"outputs", 1}, {"code", Json::parse(R"([["angle",0],["asin"]])")}};
  Controller controller = controller_of(table);
  Sample s = Sample::at_rest(Eigen::VectorXd::Constant(1, 0.9));
  const StepReport before = controller.step(s.input(0));
  s.angle(0) = 1.1;
  const StepReport during = controller.step(s.input(1));
  EXPECT_EQ(during.flags & (kTorqueNotFinite | kModelInvalid), kTorqueNotFinite | kModelInvalid);
  EXPECT_EQ(during.torque_applied, before.torque_applied);
  s.angle(0) = 0.9;
  const StepReport after = controller.step(s.input(2));
  EXPECT_EQ(after.flags & (kTorqueNotFinite | kModelInvalid), 0u);
  EXPECT_TRUE(std::isfinite(after.torque_commanded[0]));
}

TEST(DobAccelerationLaw, when_the_design_inertia_is_indefinite_expect_a_flag_and_a_finite_state) {
  Json table = artifact_table("dob-acceleration", 1);
  table["law"]["inertia"]["blocks"][0]["vertices"] = Json::parse("[[[-5.0]],[[8.0]]]");  // definite at the centre
  Controller controller = controller_of(table);
  const Sample s = Sample::at_rest(Eigen::VectorXd::Constant(1, 2.0));  // cos 2 < -0.4
  for (int k = 0; k < 3; ++k) {
    const StepReport report = controller.step(s.input(k));
    EXPECT_NE(report.flags & kModelInvalid, 0u);
    EXPECT_TRUE(std::isfinite(report.torque_applied[0]));
    EXPECT_TRUE(std::isfinite(report.estimated_speed[0]));
  }
}

}  // namespace
}  // namespace quasilpv
