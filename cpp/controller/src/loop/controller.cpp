#include "quasilpv/controller.hpp"

#include "quasilpv/control_law.hpp"

namespace quasilpv {

Controller::Controller(const Artifact& artifact)
    : law_(artifact.law().make_law({artifact.sample_period_s(), artifact.joints(), artifact.limits()})),
      sample_period_s_(artifact.sample_period_s()),
      joints_(artifact.joints()) {}

Controller::~Controller() = default;
Controller::Controller(Controller&&) noexcept = default;
Controller& Controller::operator=(Controller&&) noexcept = default;

StepReport Controller::step(const StepInput& input) noexcept { return law_->step(input); }

void Controller::reset() noexcept { law_->reset(); }

void Controller::take_over(const JointArray& in_force, const JointArray& speed) noexcept {
  law_->take_over(in_force, speed);
}

int Controller::joints() const noexcept { return joints_; }

double Controller::sample_period_s() const noexcept { return sample_period_s_; }

}  // namespace quasilpv
