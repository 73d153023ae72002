#include "laws/common/observer_law.hpp"

namespace quasilpv {

template <int N>
StepReport ObserverLaw<N>::step(const StepInput& input) noexcept {
  StepReport report;
  report.seq = input.seq;
  const JointVector<N> measured = from_array<N>(input.angle);
  const bool valid = input.valid && measured.allFinite();
  report.flags = valid ? kStepHealthy : kMeasurementInvalid;
  if (!started_) {
    if (!valid) {
      report.torque_applied = limiter_.last_applied();
      return report;
    }
    start(measured);
  }
  sense(input);
  const ReferenceVectors<N> reference = shape(reference_.accept(input.reference, report));
  const JointVector<N> y = valid ? measured : state_.angle;
  const ModelSample<N> model = sample_model<N>(model_, y, report);
  if (valid) {
    correct(measured, report, state_);
  }
  state_.filter(filter_pole_, compensated(y, reference));
  state_.write_to(report);
  const Command<N> command = control(state_, model, reference, report);
  to_array<N>(command.torque, report.torque_commanded);
  report.flags |= limiter_.apply(report.torque_commanded, input.commanded, report.torque_applied);
  if (valid) {
    integrate_error<N>(y - reference.angle, command.integral_gain, report, sample_period_s_, state_.integral_error);
  }
  const Motion motion = predict(state_, model, reference, report);
  state_.advance(sample_period_s_, motion.acceleration, motion.jerk);
  started_ = state_.is_finite();
  return report;
}

QUASILPV_OF_EVERY_SIZE(template class, ObserverLaw)

}  // namespace quasilpv
