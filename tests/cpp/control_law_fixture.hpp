// One sample of each law, written out from the formulas with dynamic matrices and explicit inverses: the independent
// implementation that tests compare the library with.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>

#include "artifact_fixture.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv::testing {

/// Measurement and reference of one sample.
struct Sample {
  Eigen::VectorXd angle, speed, reference, reference_speed, reference_acceleration;

  StepInput input(std::int64_t seq) const {
    StepInput input;
    input.seq = seq;
    input.angle = to_joint_array(angle);
    input.speed = to_joint_array(speed);
    input.reference = {to_joint_array(reference), to_joint_array(reference_speed),
                       to_joint_array(reference_acceleration)};
    return input;
  }

  static Sample at_rest(const Eigen::VectorXd& angle) {
    const Eigen::VectorXd zero = Eigen::VectorXd::Zero(angle.size());
    return {angle, zero, angle, zero, zero};
  }
};

/// Saturation, then slew, as the formulas have it; the first torque has no predecessor.
struct OutputStage {
  double torque_limit;
  double max_change;
  Eigen::VectorXd last = {};

  Eigen::VectorXd apply(const Eigen::VectorXd& torque) {
    Eigen::VectorXd limited = torque.cwiseMax(-torque_limit).cwiseMin(torque_limit);
    if (last.size() > 0) {
      limited = limited.cwiseMax((last.array() - max_change).matrix()).cwiseMin((last.array() + max_change).matrix());
    }
    last = limited;
    return limited;
  }
};

struct WrittenOutLaw {
  virtual ~WrittenOutLaw() = default;
  /// Returns the commanded torque; the applied one is output.last.
  virtual Eigen::VectorXd step(const Sample& s) = 0;

  TestArm arm;
  OutputStage output;
  Eigen::VectorXd integral, disturbance;
  bool started = false;

  WrittenOutLaw(TestArm test_arm, OutputStage stage) : arm(test_arm), output(std::move(stage)) {
    integral = disturbance = Eigen::VectorXd::Zero(arm.joints);
  }
};

/// compensation: the share of the filtered disturbance that is taken back.
struct WrittenOutDobAcceleration : WrittenOutLaw {
  using WrittenOutLaw::WrittenOutLaw;
  Eigen::VectorXd th, w, a_d, j_d, d_f;
  double compensation = 1.0;

  Eigen::VectorXd step(const Sample& s) override;
};

/// The law of a kind; `computed-torque` for every kind that is no other's.
std::unique_ptr<WrittenOutLaw> written_out(const std::string& kind, const TestArm& arm, const OutputStage& output);

}  // namespace quasilpv::testing
