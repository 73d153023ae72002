// H-infinity PI tracking with a gain that is rational in the premises: the law of Theorem III.10.
#pragma once

#include "velocity_law.hpp"

namespace quasilpv {

/// With xi = (y - r, w - r', int (y - r)), w the filtered measured speed:
///
///     K(z)  = Y(z) E(z)^-T P^-1,  E(z) = diag(I, M_n(z), I);   Gamma = K(z) xi, limited;   (int (y - r))' = y - r
///
/// Nothing is fed forward, not even gravity: what the reference and gravity ask for is part of the disturbance whose
/// effect on the error the gain bounds. Anti-windup: see integrate_error(). Source: Dehak 2022, (III.39) and (III.43).
template <int N>
class HinfTrackingLaw final : public VelocityLaw<N> {
 public:
  HinfTrackingLaw(const HinfTrackingParameters& parameters, const LawSettings& settings)
      : VelocityLaw<N>(parameters.model, settings, parameters.velocity_filter_time_constant_s),
        numerator_(parameters.numerator) {
    const State lyapunov = parameters.lyapunov;
    for (int j = 0; j < 3 * N; ++j) {
      inverse_lyapunov_.col(j) = solve_positive_definite<3 * N>(lyapunov, State::Identity().col(j));
    }
  }

 private:
  using typename VelocityLaw<N>::Sample;
  using State = Eigen::Matrix<double, 3 * N, 3 * N>;

  Command<N> control(const Sample& sample, const ModelSample<N>& model, StepReport& report) noexcept override {
    const TrackingGain<N> gain = gain_at(model, report);
    TrackingError<N> error;
    error << sample.angle - sample.reference.angle, sample.speed - sample.reference.speed, -sample.integral;
    return {gain * error, -gain.template rightCols<N>().diagonal()};
  }

  // Row by row: the middle block of y E^-T is the solution x of M x = y.
  TrackingGain<N> gain_at(const ModelSample<N>& model, StepReport& report) const noexcept {
    TrackingGain<N> numerator;
    numerator_.evaluate(report.premise.data(), numerator);
    for (int j = 0; j < N; ++j) {
      const JointVector<N> row = numerator.template block<1, N>(j, N).transpose();
      numerator.template block<1, N>(j, N) = model.acceleration(row).transpose();
    }
    const TrackingGain<N> gain = numerator * inverse_lyapunov_;
    if (!gain.allFinite()) {
      report.flags |= kModelInvalid;
    }
    return gain;
  }

  BlockPolytope numerator_;
  State inverse_lyapunov_;
};

}  // namespace quasilpv
