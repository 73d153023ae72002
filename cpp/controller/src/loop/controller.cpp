#include "quasilpv/controller.hpp"

#include <algorithm>
#include <cmath>

#include "quasilpv/control_law.hpp"

namespace quasilpv {

GearReading without_failed_sensors(const GearReading& gears, int joints) noexcept {
  const auto failed = [joints](const JointArray& values) {
    return !std::all_of(values.begin(), values.begin() + joints, [](double value) { return std::isfinite(value); });
  };
  GearReading working = gears;
  working.available &= ~(failed(gears.motor_angle_rad) ? kMotorAngle : kNoGearSensor);
  working.available &= ~(failed(gears.link_angle_rad) ? kLinkAngle : kNoGearSensor);
  working.available &= ~(failed(gears.joint_torque_nm) ? kJointTorque : kNoGearSensor);
  return working;
}

Controller::Controller(const Artifact& artifact)
    : law_(artifact.law().make_law({artifact.sample_period_s(), artifact.joints(), artifact.limits()})),
      sample_period_s_(artifact.sample_period_s()),
      joints_(artifact.joints()),
      side_(artifact.law().controlled_side()) {}

Controller::~Controller() = default;
Controller::Controller(Controller&&) noexcept = default;
Controller& Controller::operator=(Controller&&) noexcept = default;

void Controller::choose_angle(StepInput& input) const noexcept {
  const JointArray* const angle = controlled_angle(side_, input.angle, input.gears);
  if (angle == nullptr) {
    input.valid = false;
  } else {
    input.angle = *angle;
  }
  input.gears = without_failed_sensors(input.gears, joints_);
}

StepReport Controller::step(const StepInput& input) noexcept { return law_->step(input); }

void Controller::reset() noexcept { law_->reset(); }

void Controller::take_over(const JointArray& in_force, const JointArray& speed) noexcept {
  law_->take_over(in_force, speed);
}

int Controller::joints() const noexcept { return joints_; }

double Controller::sample_period_s() const noexcept { return sample_period_s_; }

}  // namespace quasilpv
