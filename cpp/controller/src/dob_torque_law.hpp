// Gain-scheduled tracking with a disturbance observer in torque coordinates: the law of Theorem IV.11.
#pragma once

#include "observer_law.hpp"

namespace quasilpv {

/// Per sample, with x_hat = [th, w, d, dd] (angle, speed, disturbance torque and its rate), the gains
/// K = [Kp Kd KI] and L = [L1; L2; L3; L4] being evaluated at the same premises as M:
///
///     M, G, K, L = M_n(z(y)), G(y), K(z(y)), L(z(y))
///     innov  = (I + T L1)^-1 (y - th);  x_hat += T L innov                  implicit correction
///     d_f    = q d_f + (1 - q) d,  q = exp(-T/T_f)                          exact filter
///     Gamma  = M r'' - d_f + Kp (th - r) + Kd (w - r') + KI e_I + G, limited
///     e_I   += T (y - r)                                                    anti-windup: see integrate_error()
///     a, j   = M^-1 (Gamma_applied - G + d), M^-1 dd
///     th    += T w + T^2/2 a + T^3/6 j;  w += T a + T^2/2 j;  d += T dd     exact zero-order hold
///
/// The correction solves x = x_hat + T L (y - C x) for the x after it: unlike x_hat += T L (y - th) it stays stable
/// when T times the observer's bandwidth is not small. Start and samples without a measurement: see ObserverLaw.
/// Coriolis torque is part of the disturbance. Source: Dehak 2022, Theorem IV.11, in the reduced form with a constant
/// observer matrix.
template <int N>
class DobTorqueLaw final : public ObserverLaw<N> {
 public:
  DobTorqueLaw(const DobTorqueParameters& parameters, const LawSettings& settings)
      : ObserverLaw<N>(parameters.model, settings, parameters.filter_time_constant_s),
        feedback_(parameters.feedback),
        observer_(parameters.observer),
        sample_period_s_(settings.sample_period_s) {}

 private:
  using typename ObserverLaw<N>::Motion;

  void correct(const JointVector<N>& measured, StepReport& report, ObserverState<N>& state) noexcept override {
    Eigen::Matrix<double, 4 * N, N> gain;
    observer_.evaluate(report.premise.data(), gain);
    gain *= sample_period_s_;
    const JointMatrix<N> implicit = JointMatrix<N>::Identity() + gain.template topRows<N>();
    const JointVector<N> innovation = solve_general<N>(implicit, measured - state.angle);
    const Eigen::Matrix<double, 4 * N, 1> correction = gain * innovation;
    state.angle += correction.template segment<N>(0);
    state.speed += correction.template segment<N>(N);
    state.disturbance += correction.template segment<N>(2 * N);
    state.disturbance_rate += correction.template segment<N>(3 * N);
  }

  Command<N> control(const ObserverState<N>& state, const ModelSample<N>& model, const ReferenceVectors<N>& reference,
                     StepReport& report) noexcept override {
    TrackingGain<N> gain;
    feedback_.evaluate(report.premise.data(), gain);
    TrackingError<N> error;
    error << state.angle - reference.angle, state.speed - reference.speed, state.integral_error;
    return {model.inertia * reference.acceleration - state.filtered_disturbance + gain * error + model.gravity,
            gain.template rightCols<N>().diagonal()};
  }

  // If the model has no finite answer, the reference acceleration is predicted.
  Motion predict(const ObserverState<N>& state, const ModelSample<N>& model, const ReferenceVectors<N>& reference,
                 StepReport& report) noexcept override {
    const JointVector<N> torque = from_array<N>(report.torque_applied) - model.gravity + state.disturbance;
    Motion motion{model.acceleration(torque), model.acceleration(state.disturbance_rate)};
    if (!motion.acceleration.allFinite() || !motion.jerk.allFinite()) {
      motion = {reference.acceleration, JointVector<N>::Zero()};
      report.flags |= kModelInvalid;
    }
    return motion;
  }

  BlockPolytope feedback_;
  BlockPolytope observer_;
  double sample_period_s_;
};

}  // namespace quasilpv
