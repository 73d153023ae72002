// PID with feedforward: the baseline of industry.
#pragma once

#include "law_support.hpp"

namespace quasilpv {

/// With e = r - y, w the filtered measured speed:
///
///     Gamma = kp e + kd (r' - w) + ki e_I + M(z) r'' + N(y, w) r' + G(y), limited;   e_I += T e
///
/// Anti-windup: see integrate_error(). Without a valid measurement the last one is held and e_I is frozen.
/// Source: Dehak 2022, (III.54), with the sign of e that makes the printed gains stabilising.
template <int N>
class PidLaw final : public ControlLaw {
 public:
  PidLaw(const PidParameters& parameters, const LawSettings& settings)
      : parameters_(parameters),
        kp_(from_array<N>(parameters.kp)),
        kd_(from_array<N>(parameters.kd)),
        ki_(from_array<N>(parameters.ki)),
        sample_period_s_(settings.sample_period_s),
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
      reference_.reset(measurement_.angle());
      integral_.setZero();
    }
    const ReferenceVectors<N> reference = reference_.accept(input.reference, report);
    const JointVector<N>& y = measurement_.angle();
    const JointVector<N>& w = measurement_.speed();
    to_array<N>(y, report.estimated_angle);
    to_array<N>(w, report.estimated_speed);
    to_array<N>(integral_, report.integral_error);

    const ModelSample<N> model = sample_model<N>(parameters_.model, y, report);
    JointVector<N> coriolis;
    parameters_.coriolis_reference.evaluate({y.data(), w.data(), reference.speed.data()}, coriolis.data());

    const JointVector<N> error = reference.angle - y;
    const JointVector<N> feedback =
        kp_.cwiseProduct(error) + kd_.cwiseProduct(reference.speed - w) + ki_.cwiseProduct(integral_);
    to_array<N>(feedback + model.inertia * reference.acceleration + coriolis + model.gravity, report.torque_commanded);
    report.flags |= limiter_.apply(report.torque_commanded, report.torque_applied);
    if (valid) {
      integrate_error<N>(error, ki_, report, sample_period_s_, integral_);
    }
    return report;
  }

  void reset() noexcept override {
    measurement_.reset();
    limiter_.reset();
  }

 private:
  PidParameters parameters_;
  JointVector<N> kp_;
  JointVector<N> kd_;
  JointVector<N> ki_;
  double sample_period_s_;
  Limiter limiter_;
  MeasurementFilter<N> measurement_;
  ReferenceGuard<N> reference_;
  JointVector<N> integral_ = JointVector<N>::Zero();
};

}  // namespace quasilpv
