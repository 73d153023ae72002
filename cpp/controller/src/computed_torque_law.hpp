// Computed torque, with or without a disturbance observer: the baseline of the literature.
#pragma once

#include <cmath>

#include "law_support.hpp"

namespace quasilpv {

/// With e = r - y, w the filtered measured speed, a_hat the estimated disturbance acceleration (zero without observer):
///
///     Gamma = M (r'' + gp e + gd (r' - w) + gi e_I - a_hat) + N(y, w) w + G(y), limited;   e_I += T e
///
/// The observer is a_hat = zeta + c w, zeta' = -c zeta - c (f + c w) with f = M^-1 (Gamma_applied - N w - G), so that
/// a_hat' = c (a - a_hat) on the plant w' = f + a. Sampled exactly for f and a held over a period, that is
///
///     a_hat = zeta + kappa w,   zeta+ = q zeta - (1 - q) (f + kappa w),   q = exp(-c T),   kappa = (1 - q) / T
///
/// which gives a_hat+ = q a_hat + (1 - q) a whatever the speed does (holding w as well, kappa = c, would leave the
/// error (c T / (1 - q) - 1) w' in steady acceleration). It starts at a_hat = 0. Anti-windup: see integrate_error().
/// Without a valid measurement the last one is held and e_I is frozen. Source: Dehak 2022, (III.56), with the sign of
/// the estimate corrected; Mohammadi, Tavakoli, Marquez and Hashemzadeh 2013 for the observer, here in acceleration
/// coordinates with one bandwidth.
template <int N>
class ComputedTorqueLaw final : public ControlLaw {
 public:
  ComputedTorqueLaw(const ComputedTorqueParameters& parameters, const LawSettings& settings)
      : parameters_(parameters),
        gp_(from_array<N>(parameters.gp)),
        gd_(from_array<N>(parameters.gd)),
        gi_(from_array<N>(parameters.gi)),
        sample_period_s_(settings.sample_period_s),
        observer_pole_(std::exp(-parameters.disturbance_observer_bandwidth_rad_s * settings.sample_period_s)),
        observer_gain_((1.0 - observer_pole_) / settings.sample_period_s),
        limiter_(settings.limits, settings.sample_period_s, N),
        measurement_(settings.sample_period_s, parameters.velocity_filter_time_constant_s) {}

  StepReport step(const StepInput& input) noexcept override {
    StepReport report;
    report.seq = input.seq;
    const bool starting = !measurement_.started();
    const bool valid = measurement_.accept(input, report);
    if (!measurement_.started()) {
      report.torque_applied = limiter_.last_applied();
      return report;
    }
    if (starting) {
      start();
    }
    const ReferenceVectors<N> reference = reference_.accept(input.reference, report);
    const JointVector<N>& y = measurement_.angle();
    const JointVector<N>& w = measurement_.speed();
    const ModelSample<N> model = sample_model<N>(parameters_.model, y, report);
    JointVector<N> bias;  // N(y, w) w + G(y)
    parameters_.coriolis.evaluate({y.data(), w.data(), nullptr}, bias.data());
    bias += model.gravity;

    const JointVector<N> disturbance = observer_state_ + observer_gain_ * w;
    report_state(model, disturbance, report);
    const JointVector<N> error = reference.angle - y;
    const JointVector<N> acceleration = reference.acceleration + gp_.cwiseProduct(error) +
                                        gd_.cwiseProduct(reference.speed - w) + gi_.cwiseProduct(integral_) -
                                        disturbance;
    to_array<N>(model.inertia * acceleration + bias, report.torque_commanded);
    report.flags |= limiter_.apply(report.torque_commanded, report.torque_applied);
    if (valid) {
      integrate_error<N>(error, gi_, report, sample_period_s_, integral_);
    }
    observe(model, bias, report);
    return report;
  }

  void reset() noexcept override {
    measurement_.reset();
    limiter_.reset();
  }

 private:
  void start() noexcept {
    reference_.reset(measurement_.angle());
    integral_.setZero();
    observer_state_ = -observer_gain_ * measurement_.speed();
  }

  // With bandwidth 0 the pole is 1 and the gain 0: the estimate stays zero. If the model has no finite answer, the
  // estimate is held.
  void observe(const ModelSample<N>& model, const JointVector<N>& bias, StepReport& report) noexcept {
    const JointVector<N> known = model.acceleration(from_array<N>(report.torque_applied) - bias);
    if (!known.allFinite()) {
      report.flags |= kModelInvalid;
      return;
    }
    observer_state_ =
        observer_pole_ * observer_state_ - (1.0 - observer_pole_) * (known + observer_gain_ * measurement_.speed());
  }

  void report_state(const ModelSample<N>& model, const JointVector<N>& disturbance, StepReport& report) const noexcept {
    to_array<N>(measurement_.angle(), report.estimated_angle);
    to_array<N>(measurement_.speed(), report.estimated_speed);
    to_array<N>(integral_, report.integral_error);
    to_array<N>(model.inertia * disturbance, report.estimated_disturbance);
    report.filtered_disturbance = report.estimated_disturbance;
  }

  ComputedTorqueParameters parameters_;
  JointVector<N> gp_;
  JointVector<N> gd_;
  JointVector<N> gi_;
  double sample_period_s_;
  double observer_pole_;
  double observer_gain_;
  Limiter limiter_;
  MeasurementFilter<N> measurement_;
  ReferenceGuard<N> reference_;
  JointVector<N> integral_ = JointVector<N>::Zero();
  JointVector<N> observer_state_ = JointVector<N>::Zero();
};

}  // namespace quasilpv
