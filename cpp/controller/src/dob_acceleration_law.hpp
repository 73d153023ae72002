// The default law: feedback, disturbance observer and prediction in acceleration coordinates.
#pragma once

#include <cmath>

#include "observer_state.hpp"

namespace quasilpv {

/// Per sample, with x_hat = [th, w, a_d, j_d] (angle, speed, disturbance acceleration and its rate):
///
///     M, G   = M_n(z(y)), G(y)
///     x_hat += [l1, l2, l3, l4] (y - th)                                          current estimator
///     d_f    = q d_f + (1 - q) a_d,  q = exp(-T/T_f)                              exact filter
///     a_cmd  = r'' - d_f + kp (th - r) + kd (w - r') + ki e_I
///     Gamma  = M a_cmd + G, limited
///     e_I   += T (y - r)                                                          anti-windup: see integrate_error()
///     a_app  = M^-1 (Gamma_applied - G) + a_d
///     th    += T w + T^2/2 a_app + T^3/6 j_d;  w += T a_app + T^2/2 j_d;  a_d += T j_d     exact zero-order hold
///
/// Starts at x_hat = (y, 0, 0, 0), d_f = e_I = 0. Without a valid measurement the innovation is zero, the prediction
/// stands in for y, and e_I is frozen. Coriolis torque is part of the disturbance.
/// Source: Dehak 2022, section IV.3, carried over to accelerations and discrete time.
template <int N>
class DobAccelerationLaw final : public ControlLaw {
 public:
  DobAccelerationLaw(const DobAccelerationParameters& parameters, const LawSettings& settings)
      : parameters_(parameters),
        sample_period_s_(settings.sample_period_s),
        filter_pole_(std::exp(-settings.sample_period_s / parameters.filter_time_constant_s)),
        limiter_(settings.limits, settings.sample_period_s, N) {}

  StepReport step(const StepInput& input) noexcept override {
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
    const ReferenceVectors<N> reference = reference_.accept(input.reference, report);

    if (valid) {
      correct(measured);
    }
    const JointVector<N> y = valid ? measured : state_.angle;
    const ModelSample<N> model = sample_model<N>(parameters_.model, y, report);
    state_.filter(filter_pole_);
    state_.write_to(report);

    const JointVector<N> acceleration = commanded_acceleration(reference);
    to_array<N>(model.inertia * acceleration + model.gravity, report.torque_commanded);
    report.flags |= limiter_.apply(report.torque_commanded, report.torque_applied);

    if (valid) {
      integrate_error<N>(y - reference.angle, JointVector<N>::Constant(parameters_.ki), report, sample_period_s_,
                         state_.integral_error);
    }
    predict(model, acceleration, report);
    return report;
  }

  void reset() noexcept override {
    started_ = false;
    limiter_.reset();
  }

 private:
  void start(const JointVector<N>& measured) noexcept {
    state_ = ObserverState<N>::at_rest(measured);
    reference_.reset(measured);
    started_ = true;
  }

  void correct(const JointVector<N>& measured) noexcept {
    const JointVector<N> innovation = measured - state_.angle;
    state_.angle += parameters_.observer[0] * innovation;
    state_.speed += parameters_.observer[1] * innovation;
    state_.disturbance += parameters_.observer[2] * innovation;
    state_.disturbance_rate += parameters_.observer[3] * innovation;
  }

  JointVector<N> commanded_acceleration(const ReferenceVectors<N>& reference) const noexcept {
    const JointVector<N> feedback = parameters_.kp * (state_.angle - reference.angle) +
                                    parameters_.kd * (state_.speed - reference.speed) +
                                    parameters_.ki * state_.integral_error;
    if (!parameters_.disturbance_compensation) {
      return reference.acceleration + feedback;
    }
    return reference.acceleration - state_.filtered_disturbance + feedback;
  }

  // With the torque that acts on the plant, so that limits do not disturb the observer. If the model has no finite
  // answer (gravity not finite, inertia not positive definite), the commanded acceleration is predicted. A state that
  // overflowed all the same is dropped: the observer starts again at the next valid measurement.
  void predict(const ModelSample<N>& model, const JointVector<N>& commanded, StepReport& report) noexcept {
    JointVector<N> applied = model.acceleration(from_array<N>(report.torque_applied) - model.gravity);
    if (!applied.allFinite()) {
      applied = commanded;
      report.flags |= kModelInvalid;
    }
    applied += state_.disturbance;
    state_.advance(sample_period_s_, applied, state_.disturbance_rate);
    started_ = state_.is_finite();
  }

  DobAccelerationParameters parameters_;
  double sample_period_s_;
  double filter_pole_;
  Limiter limiter_;
  ReferenceGuard<N> reference_;
  ObserverState<N> state_;
  bool started_ = false;
};

}  // namespace quasilpv
