// Gain-scheduled tracking with a disturbance observer in torque coordinates: the law of Theorem IV.11.
#pragma once

#include <cmath>

#include "observer_state.hpp"

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
/// when T times the observer's bandwidth is not small. Starts at x_hat = (y, 0, 0, 0), d_f = e_I = 0. Without a valid
/// measurement the innovation is zero, the prediction stands in for y, and e_I is frozen. Coriolis torque is part of
/// the disturbance. Source: Dehak 2022, Theorem IV.11, in the reduced form with a constant observer matrix.
template <int N>
class DobTorqueLaw final : public ControlLaw {
 public:
  DobTorqueLaw(const DobTorqueParameters& parameters, const LawSettings& settings)
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
    const JointVector<N> y = valid ? measured : state_.angle;
    const ModelSample<N> model = sample_model<N>(parameters_.model, y, report);
    if (valid) {
      correct(measured, report);
    }
    state_.filter(filter_pole_);
    state_.write_to(report);

    FeedbackGain feedback;
    parameters_.feedback.evaluate(report.premise.data(), feedback);
    to_array<N>(commanded_torque(model, feedback, reference), report.torque_commanded);
    report.flags |= limiter_.apply(report.torque_commanded, report.torque_applied);
    if (valid) {
      const JointVector<N> integral_gain = feedback.template rightCols<N>().diagonal();
      integrate_error<N>(y - reference.angle, integral_gain, report, sample_period_s_, state_.integral_error);
    }
    predict(model, reference, report);
    return report;
  }

  void reset() noexcept override {
    started_ = false;
    limiter_.reset();
  }

 private:
  using FeedbackGain = Eigen::Matrix<double, N, 3 * N>;
  using ObserverGain = Eigen::Matrix<double, 4 * N, N>;

  void start(const JointVector<N>& measured) noexcept {
    state_ = ObserverState<N>::at_rest(measured);
    reference_.reset(measured);
    started_ = true;
  }

  void correct(const JointVector<N>& measured, StepReport& report) noexcept {
    ObserverGain gain;
    parameters_.observer.evaluate(report.premise.data(), gain);
    gain *= sample_period_s_;
    const JointMatrix<N> implicit = JointMatrix<N>::Identity() + gain.template topRows<N>();
    const JointVector<N> innovation = solve_general<N>(implicit, measured - state_.angle);
    const Eigen::Matrix<double, 4 * N, 1> correction = gain * innovation;
    state_.angle += correction.template segment<N>(0);
    state_.speed += correction.template segment<N>(N);
    state_.disturbance += correction.template segment<N>(2 * N);
    state_.disturbance_rate += correction.template segment<N>(3 * N);
  }

  JointVector<N> commanded_torque(const ModelSample<N>& model, const FeedbackGain& feedback,
                                  const ReferenceVectors<N>& reference) const noexcept {
    Eigen::Matrix<double, 3 * N, 1> error;
    error << state_.angle - reference.angle, state_.speed - reference.speed, state_.integral_error;
    return model.inertia * reference.acceleration - state_.filtered_disturbance + feedback * error + model.gravity;
  }

  // With the torque that acts on the plant, so that limits do not disturb the observer. If the model has no finite
  // answer (gravity not finite, inertia not positive definite), the reference acceleration is predicted. A state that
  // overflowed all the same is dropped: the observer starts again at the next valid measurement.
  void predict(const ModelSample<N>& model, const ReferenceVectors<N>& reference, StepReport& report) noexcept {
    const JointVector<N> torque = from_array<N>(report.torque_applied) - model.gravity + state_.disturbance;
    JointVector<N> acceleration = model.acceleration(torque);
    JointVector<N> jerk = model.acceleration(state_.disturbance_rate);
    if (!acceleration.allFinite() || !jerk.allFinite()) {
      acceleration = reference.acceleration;
      jerk.setZero();
      report.flags |= kModelInvalid;
    }
    state_.advance(sample_period_s_, acceleration, jerk);
    started_ = state_.is_finite();
  }

  DobTorqueParameters parameters_;
  double sample_period_s_;
  double filter_pole_;
  Limiter limiter_;
  ReferenceGuard<N> reference_;
  ObserverState<N> state_;
  bool started_ = false;
};

}  // namespace quasilpv
