// H-infinity PI tracking with a gain that is rational in the premises: the law of Theorem III.10.
#pragma once

#include "descriptor_gain.hpp"
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
        numerator_(parameters.numerator),
        gain_(parameters.lyapunov) {}

 private:
  using typename VelocityLaw<N>::Sample;

  bool feeds_forward() const noexcept override { return false; }

  Command<N> control(const Sample& sample, const ModelSample<N>& model, StepReport& report) noexcept override {
    TrackingGain<N> numerator;
    numerator_.evaluate(report.premise.data(), numerator);
    const TrackingGain<N> gain = gain_.at(model, numerator, report);
    TrackingError<N> error;
    error << sample.angle - sample.reference.angle, sample.speed - sample.reference.speed, -sample.integral;
    return {gain * error, -gain.template rightCols<N>().diagonal()};
  }

  BlockPolytope numerator_;
  DescriptorGain<N, 3 * N> gain_;
};

}  // namespace quasilpv
