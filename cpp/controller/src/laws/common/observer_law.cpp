#include "laws/common/observer_law.hpp"

#include <algorithm>
#include <cmath>

namespace quasilpv {

template <int N>
StepReport ObserverLaw<N>::step(const StepInput& input) noexcept {
  StepReport report;
  report.seq = input.seq;
  const JointVector<N> measured = from_array<N>(input.angle);
  const bool valid = input.valid && measured.allFinite();
  report.flags = valid ? kStepHealthy : kMeasurementInvalid;
  const bool starting = !started_;
  if (starting) {
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
  lost_sight_ = lost_sight_ || (input.overruled && !valid);
  if (!lost_sight_ && valid) {
    first_disturbance_ = state_.disturbance;
  }
  const JointMask<N> follow = compensated(y, reference);  // counts samples: asked in every one
  if (starting) {
    state_.filtered_disturbance = share_at_once(model, reference, report) * state_.disturbance;
  } else {
    state_.filter(filter_pole_, follow);
  }
  state_.write_to(report);
  const Command<N> command = control(state_, model, reference, report);
  to_array<N>(command.torque, report.torque_commanded);
  report.flags |= limit(limiter_, input, report);
  if (valid) {
    integrate_error<N>(y - reference.angle, command.integral_gain, report, sample_period_s_, state_.integral_error);
  }
  const Motion motion = predict(state_, model, reference, report);
  state_.advance(sample_period_s_, motion.acceleration, motion.jerk);
  started_ = state_.is_finite();
  if (!started_) {
    first_disturbance_.setZero();
  }
  return report;
}

template <int N>
double ObserverLaw<N>::share_at_once(const ModelSample<N>& model, const ReferenceVectors<N>& reference,
                                     StepReport& report) noexcept {
  if (state_.disturbance.isZero(0.0)) {
    return 0.0;
  }
  const JointVector<N> in_force = from_array<N>(limiter_.last_applied());
  const JointVector<N> own = control(state_, model, reference, report).torque;
  ObserverState<N> compensating = state_;
  compensating.filtered_disturbance = state_.disturbance;
  const JointVector<N> change = control(compensating, model, reference, report).torque - own;
  double share = 1.0;
  for (int j = 0; j < N; ++j) {  // |own + share change - in force| <= |own - in force| + step
    const double ahead = change[j] > 0.0 ? in_force[j] - own[j] : own[j] - in_force[j];
    share = std::min(share, (ahead + std::abs(ahead) + free_step_[j]) / std::abs(change[j]));
  }
  return share;
}

QUASILPV_OF_EVERY_SIZE(template class, ObserverLaw)

}  // namespace quasilpv
