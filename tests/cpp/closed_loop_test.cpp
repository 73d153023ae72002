// Laws in the loop with plants whose samples are exact: double integrators behind the design model.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <vector>

#include "control_law_fixture.hpp"
#include "decompositions.hpp"
#include "quasilpv/controller.hpp"

namespace quasilpv {
namespace {

using ::quasilpv::testing::artifact_table;
using ::quasilpv::testing::has_schedule;
using ::quasilpv::testing::inverse;
using ::quasilpv::testing::json_twin;
using ::quasilpv::testing::kSamplePeriod;
using ::quasilpv::testing::Sample;
using ::quasilpv::testing::TestArm;
using ::quasilpv::testing::to_joint_array;
using ::quasilpv::testing::to_vector;

constexpr double T = kSamplePeriod;

Controller controller_of(const Json& table) { return Controller(Artifact::parse(json_twin(table), "test")); }

// th'' = M(y_k)^-1 (Gamma - N w - G)(y_k, w_k) + a, all held over the sample period: for this plant the design model is
// exact.
struct SampledPlant {
  TestArm arm;
  Eigen::VectorXd angle, speed, disturbance;
  bool has_coriolis = false;

  explicit SampledPlant(int joints) : arm{joints} { angle = speed = disturbance = Eigen::VectorXd::Zero(joints); }

  void advance(const JointArray& torque) {
    Eigen::VectorXd bias = arm.gravity(angle);
    if (has_coriolis) {
      bias += arm.coriolis(angle, speed, speed);
    }
    const Eigen::VectorXd acceleration =
        inverse(arm.inertia(angle)) * (to_vector(torque, arm.joints) - bias) + disturbance;
    angle += T * speed + T * T / 2.0 * acceleration;
    speed += T * acceleration;
  }

  Sample sample() const {
    const Eigen::VectorXd zero = Eigen::VectorXd::Zero(arm.joints);
    return {angle, speed, zero, zero, zero};
  }
};

// Coefficients, constant first, of p(x) prod (x - root).
std::vector<double> times_factors(std::vector<double> p, const std::vector<double>& roots) {
  for (const double root : roots) {
    p.insert(p.begin(), 0.0);
    for (std::size_t i = 0; i + 1 < p.size(); ++i) {
      p[i] -= root * p[i + 1];
    }
  }
  return p;
}

// Gains of the current estimator of the sampled quadruple integrator with all four poles at `pole` (Ackermann).
std::vector<double> observer_gains(double pole) {
  Eigen::Matrix4d A;
  A << 1, T, T * T / 2, T * T * T / 6, 0, 1, T, T * T / 2, 0, 0, 1, T, 0, 0, 0, 1;
  Eigen::Matrix4d observability;
  Eigen::RowVector4d row = Eigen::RowVector4d::UnitX();
  for (int i = 0; i < 4; ++i) {
    observability.row(i) = row;
    row = row * A;
  }
  const Eigen::Matrix4d shifted = A - pole * Eigen::Matrix4d::Identity();
  const Eigen::Vector4d predictor = shifted * shifted * shifted * shifted * inverse(observability).col(3);
  const Eigen::Vector4d current = inverse(A) * predictor;
  return {current(0), current(1), current(2), current(3)};
}

constexpr double kFeedbackBandwidth = 60.0;
constexpr double kObserverPole = 0.3;

Json design_table(int joints) {
  const double w = kFeedbackBandwidth;
  Json table = artifact_table("dob-acceleration", joints);
  table["law"]["feedback"] = {{"kp", -3 * w * w}, {"kd", -3 * w}, {"ki", -w * w * w}};
  table["law"]["observer"] = observer_gains(kObserverPole);
  table["limits"]["torque_nm"] = std::vector<double>(static_cast<std::size_t>(joints), 1e6);
  table["limits"]["slew_nm_per_s"] = std::vector<double>(static_cast<std::size_t>(joints), 1e12);
  return table;
}

// The sampled feedback loop (th, w, e_I) with e_I += T th and the acceleration held.
Eigen::Matrix3d feedback_loop() {
  const double w = kFeedbackBandwidth;
  const Eigen::RowVector3d gains(-3 * w * w, -3 * w, -w * w * w);
  Eigen::Matrix3d loop;
  loop << 1, T, 0, 0, 1, 0, T, 0, 1;
  return loop + Eigen::Vector3d(T * T / 2, T, 0) * gains;
}

// Coefficients of det(x I - A), constant first.
std::vector<double> characteristic_polynomial(const Eigen::Matrix3d& A) {
  const double minors = A(0, 0) * A(1, 1) - A(0, 1) * A(1, 0) + A(0, 0) * A(2, 2) - A(0, 2) * A(2, 0) +
                        A(1, 1) * A(2, 2) - A(1, 2) * A(2, 1);
  return {-A.determinant(), minors, -A.trace(), 1.0};
}

// The closed-form gains put all poles at -w; in delta form the characteristic polynomial is (d + w)^3 up to O(w T).
TEST(DobAccelerationLoop, has_the_triple_pole_of_the_closed_form_gains_up_to_sampling) {
  const double w = kFeedbackBandwidth;
  const Eigen::Matrix3d D = (feedback_loop() - Eigen::Matrix3d::Identity()) / T;
  const std::vector<double> p = characteristic_polynomial(D);
  EXPECT_NEAR(p[2] / (3 * w), 1.0, 2 * w * T);
  EXPECT_NEAR(p[1] / (3 * w * w), 1.0, 2 * w * T);
  EXPECT_NEAR(p[0] / (w * w * w), 1.0, 2 * w * T);
}

// On the nominal plant the loop is linear, and its poles are those of the feedback, the observer and the filter: y
// obeys the recurrence whose characteristic polynomial has these roots, and 1 for the constant disturbance.
TEST(DobAccelerationLoop, has_the_poles_of_feedback_observer_and_filter_on_the_nominal_plant) {
  for (const int joints : {1, 3}) {
    Controller controller = controller_of(design_table(joints));
    SampledPlant plant(joints);
    plant.angle.setConstant(0.01);
    plant.speed.setConstant(0.5);
    plant.disturbance.setConstant(3.0);
    std::vector<Eigen::VectorXd> y;
    for (int k = 0; k < 40; ++k) {
      y.push_back(plant.angle);
      plant.advance(controller.step(plant.sample().input(k)).torque_applied);
    }
    const std::vector<double> feedback = characteristic_polynomial(feedback_loop());
    std::vector<double> roots = {kObserverPole, kObserverPole, kObserverPole, kObserverPole, std::exp(-T / 1e-3), 1.0};
    const std::vector<double> p = times_factors(feedback, roots);
    for (std::size_t k = 1; k + p.size() <= y.size(); ++k) {
      Eigen::VectorXd residual = Eigen::VectorXd::Zero(joints);
      for (std::size_t i = 0; i < p.size(); ++i) {
        residual += p[i] * y[k + i];
      }
      EXPECT_LT(residual.cwiseAbs().maxCoeff(), 1e-13) << "sample " << k;
    }
    // One wrong root (an observer pole off by 0.01) does leave a residual.
    roots[0] += 0.01;
    const std::vector<double> wrong = times_factors(feedback, roots);
    double residual = 0.0;
    for (std::size_t i = 0; i < wrong.size(); ++i) {
      residual += wrong[i] * y[1 + i](0);
    }
    EXPECT_GT(std::abs(residual), 1e-9);
  }
}

TEST(DobAccelerationLoop, finds_a_constant_disturbance_and_rejects_it) {
  Controller controller = controller_of(design_table(3));
  SampledPlant plant(3);
  plant.disturbance << 3.0, -2.0, 8.0;
  StepReport report;
  for (int k = 0; k < 1000; ++k) {
    report = controller.step(plant.sample().input(k));
    plant.advance(report.torque_applied);
  }
  EXPECT_LT((to_vector(report.estimated_disturbance, 3) - plant.disturbance).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_LT((to_vector(report.filtered_disturbance, 3) - plant.disturbance).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_LT(plant.angle.cwiseAbs().maxCoeff(), 1e-9);
}

// The prediction is exact on the nominal plant, so nothing is lost with 19 measurements.
TEST(DobAccelerationLoop, F3_when_19_measurements_are_missing_on_the_nominal_plant_expect_the_same_motion) {
  Controller controller = controller_of(design_table(2));
  SampledPlant plant(2);
  const auto moving = [&plant](int k) {  // r = 0.1 t^2
    Sample s = plant.sample();
    s.reference.setConstant(0.1 * std::pow(k * T, 2));
    s.reference_speed.setConstant(0.2 * k * T);
    s.reference_acceleration.setConstant(0.2);
    return s;
  };
  for (int k = 0; k < 200; ++k) {
    const Sample s = moving(k);
    StepInput input = s.input(k);
    input.valid = k < 100 || k >= 119;
    const StepReport report = controller.step(input);
    EXPECT_EQ((report.flags & kMeasurementInvalid) != 0, !input.valid);
    ASSERT_LT((plant.angle - s.reference).cwiseAbs().maxCoeff(), 1e-10) << "sample " << k;
    plant.advance(report.torque_applied);
  }
}

// A disturbance acceleration a that begins with a loss of n samples is unknown until the first measurement after it. Up
// to then the arm drifts as a free mass does, a t^2 / 2. From there on the loop of bandwidth w has that distance and
// the speed a n T to take back, and a itself to learn: a n T / w and a / w^2 in its own units of length.
TEST(DobAccelerationLoop, F3_when_1_to_19_measurements_are_missing_expect_the_error_within_its_bound) {
  constexpr double kDisturbance = 10.0;
  constexpr int kFirst = 50;
  for (int missing = 1; missing < 20; ++missing) {
    for (const bool commanded : {true, false}) {  // a bad encoder; a lost message, during which the torque is held
      Controller controller = controller_of(design_table(2));
      SampledPlant plant(2);
      double worst = 0.0;
      for (int k = 0; k < 1500; ++k) {
        plant.disturbance.setConstant(k < kFirst ? 0.0 : kDisturbance);
        StepInput input = plant.sample().input(k);
        input.valid = k < kFirst || k >= kFirst + missing;
        input.commanded = input.valid || commanded;
        const StepReport report = controller.step(input);
        const double lost_s = T * (k - kFirst);
        if (!input.valid) {
          const double drift = kDisturbance * lost_s * lost_s / 2.0;
          ASSERT_NEAR(plant.angle(0), drift, 1e-3 * drift) << missing << " at " << k;  // gravity changes on the way
        }
        worst = std::max(worst, plant.angle.cwiseAbs().maxCoeff());
        plant.advance(report.torque_applied);
      }
      const double lost_s = missing * T;
      const double w = kFeedbackBandwidth;
      EXPECT_GE(worst, (1.0 - 1e-3) * kDisturbance * lost_s * lost_s / 2.0);
      EXPECT_LE(worst, kDisturbance * (lost_s * lost_s / 2.0 + lost_s / w + 1.0 / (w * w))) << missing;
      EXPECT_LT(plant.angle.cwiseAbs().maxCoeff(), 1e-6);
    }
  }
}

// What the limits took away is not a disturbance: the observer is fed with the torque that acted. The overshoot after
// seconds of saturation stays below the distance the arm came from.
TEST(DobAccelerationLoop, F10_when_saturated_expect_no_disturbance_estimate_no_windup_and_recovery) {
  Json table = design_table(2);
  table["limits"]["torque_nm"] = {60.0, 60.0};
  Controller controller = controller_of(table);
  SampledPlant plant(2);
  plant.angle.setConstant(0.5);
  int saturated = 0;
  double overshoot = 0.0;
  for (int k = 0; k < 12000; ++k) {
    const StepReport report = controller.step(plant.sample().input(k));
    saturated += (report.flags & kTorqueSaturated) != 0 ? 1 : 0;
    ASSERT_LT(to_vector(report.estimated_disturbance, 2).cwiseAbs().maxCoeff(), 1e-8) << "sample " << k;
    plant.advance(report.torque_applied);
    overshoot = std::max(overshoot, -plant.angle.minCoeff());
  }
  EXPECT_GT(saturated, 1000);
  EXPECT_LT(overshoot, 0.5);
  EXPECT_LT(plant.angle.cwiseAbs().maxCoeff(), 1e-9);
}

// The sampled observer follows a constant disturbance acceleration with exactly the pole e^(-cT), also while
// accelerating.
TEST(ComputedTorqueLoop, estimates_a_constant_disturbance_with_the_pole_of_its_bandwidth) {
  Json table = artifact_table("ctc-dob", 2);
  table["law"]["velocity_filter_time_constant_s"] = 0.0;
  Controller controller = controller_of(table);
  SampledPlant plant(2);
  plant.has_coriolis = true;
  plant.disturbance << 2.0, -4.0;
  for (int k = 0; k < 400; ++k) {
    const Eigen::MatrixXd inertia = plant.arm.inertia(plant.angle);
    const StepReport report = controller.step(plant.sample().input(k));
    const Eigen::VectorXd estimate = inverse(inertia) * to_vector(report.estimated_disturbance, 2);
    const Eigen::VectorXd expected = (1.0 - std::exp(-50.0 * k * T)) * plant.disturbance;
    ASSERT_LT((estimate - expected).cwiseAbs().maxCoeff(), 1e-9) << "sample " << k;
    plant.advance(report.torque_applied);
  }
}

TEST(ComputedTorqueLoop, without_observer_reports_no_disturbance) {
  Controller controller = controller_of(artifact_table("ctc", 2));
  SampledPlant plant(2);
  plant.disturbance << 2.0, -4.0;
  for (int k = 0; k < 50; ++k) {
    const StepReport report = controller.step(plant.sample().input(k));
    ASSERT_EQ(report.estimated_disturbance, JointArray{});
    plant.advance(report.torque_applied);
  }
}

class EveryLoop : public ::testing::TestWithParam<const char*> {};

TEST_P(EveryLoop, brings_a_disturbed_arm_to_its_reference) {
  Controller controller = controller_of(artifact_table(GetParam(), 3));
  SampledPlant plant(3);
  plant.has_coriolis = true;
  plant.angle << 0.1, -0.1, 0.05;
  if (!has_schedule(GetParam())) {  // laws without integral: they stabilise, and leave an offset otherwise
    plant.disturbance.setConstant(1.0);
  }
  for (int k = 0; k < 8000; ++k) {
    plant.advance(controller.step(plant.sample().input(k)).torque_applied);
  }
  EXPECT_LT(plant.angle.cwiseAbs().maxCoeff(), 1e-6);
}

INSTANTIATE_TEST_SUITE_P(ClosedLoop, EveryLoop, ::testing::ValuesIn(::quasilpv::testing::kLawKinds),
                         [](const auto& kind) {
                           std::string name = kind.param;
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

}  // namespace
}  // namespace quasilpv
