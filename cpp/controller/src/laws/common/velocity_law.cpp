#include "laws/common/velocity_law.hpp"

namespace quasilpv {

template <int N>
StepReport VelocityLaw<N>::step(const StepInput& input) noexcept {
  StepReport report;
  report.seq = input.seq;
  const bool starting = !measurement_.started();
  const bool valid = measurement_.accept(input, report);
  if (!measurement_.started()) {
    report.torque_applied = limiter_.last_applied();
    return report;
  }
  if (starting) {
    reference_.reset(measurement_.angle());
    integral_.setZero();
  }
  const ReferenceVectors<N> reference = reference_.accept(input.reference, report);
  const Sample sample{reference, measurement_.angle(), measurement_.speed(), integral_};
  to_array<N>(sample.angle, report.estimated_angle);
  to_array<N>(sample.speed, report.estimated_speed);
  to_array<N>(sample.integral, report.integral_error);
  const ModelSample<N> model = sample_model<N>(model_, sample.angle, report);
  if (starting) {
    start(sample, model, from_array<N>(limiter_.last_applied()));
  }
  Command<N> command = control(sample, model, report);
  if (input.joining && !feeds_forward()) {
    command.torque += holding_torque(input.offset, sample.angle, model);
  }
  to_array<N>(command.torque, report.torque_commanded);
  report.flags |= limit(limiter_, input, report);
  if (valid) {
    const JointVector<N> error = reference.angle - sample.angle;
    const JointVector<N> gain =
        moving_or_outside<N>(dead_zone_, error, reference.speed).select(command.integral_gain, 0.0);
    integrate_error<N>(error, gain, report, sample_period_s_, integral_);
  }
  applied(sample, model, report);
  return report;
}

QUASILPV_OF_EVERY_SIZE(template class, VelocityLaw)

}  // namespace quasilpv
