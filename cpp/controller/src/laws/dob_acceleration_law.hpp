// The default law: feedback, disturbance observer and prediction in acceleration coordinates.
#pragma once

#include "observer_law.hpp"

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
/// Start and samples without a measurement: see ObserverLaw. Coriolis torque is part of the disturbance.
/// Source: Dehak 2022, section IV.3, carried over to accelerations and discrete time.
template <int N>
class DobAccelerationLaw final : public ObserverLaw<N> {
 public:
  DobAccelerationLaw(const DobAccelerationParameters& parameters, const LawSettings& settings)
      : ObserverLaw<N>(parameters.model, settings, parameters.filter_time_constant_s), parameters_(parameters) {}

 private:
  using typename ObserverLaw<N>::Motion;

  void correct(const JointVector<N>& measured, StepReport& /*report*/, ObserverState<N>& state) noexcept override {
    const JointVector<N> innovation = measured - state.angle;
    state.angle += parameters_.observer[0] * innovation;
    state.speed += parameters_.observer[1] * innovation;
    state.disturbance += parameters_.observer[2] * innovation;
    state.disturbance_rate += parameters_.observer[3] * innovation;
  }

  Command<N> control(const ObserverState<N>& state, const ModelSample<N>& model, const ReferenceVectors<N>& reference,
                     StepReport& /*report*/) noexcept override {
    const JointVector<N> feedback = parameters_.kp * (state.angle - reference.angle) +
                                    parameters_.kd * (state.speed - reference.speed) +
                                    parameters_.ki * state.integral_error;
    if (parameters_.disturbance_compensation) {
      acceleration_ = reference.acceleration - state.filtered_disturbance + feedback;
    } else {
      acceleration_ = reference.acceleration + feedback;
    }
    return {model.inertia * acceleration_ + model.gravity, JointVector<N>::Constant(parameters_.ki)};
  }

  // If the model has no finite answer, the commanded acceleration is predicted.
  Motion predict(const ObserverState<N>& state, const ModelSample<N>& model, const ReferenceVectors<N>& /*reference*/,
                 StepReport& report) noexcept override {
    JointVector<N> applied = model.acceleration(from_array<N>(report.torque_applied) - model.gravity);
    if (!applied.allFinite()) {
      applied = acceleration_;
      report.flags |= kModelInvalid;
    }
    applied += state.disturbance;
    return {applied, state.disturbance_rate};
  }

  DobAccelerationParameters parameters_;
  JointVector<N> acceleration_ = JointVector<N>::Zero();  // commanded in this sample
};

}  // namespace quasilpv
