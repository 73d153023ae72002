// H-infinity PI tracking with a gain that is rational in the premises: the law of Theorem III.10.
#include "laws/common/descriptor_gain.hpp"
#include "laws/common/law_table.hpp"
#include "laws/common/velocity_law.hpp"

namespace quasilpv {
namespace {

/// The gain Y(z) E(z)^-T P^-1 with E = diag(I, M_n, I), acting on (y - r, w - r', int (y - r)).
struct HinfTrackingParameters final : VelocityParameters {
  BlockPolytope numerator;   ///< Y, n x 3n
  Eigen::MatrixXd lyapunov;  ///< P, 3n x 3n, symmetric positive definite

  std::unique_ptr<ControlLaw> make_law(const LawSettings& settings) const override;
};

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
      : VelocityLaw<N>(parameters, settings), numerator_(parameters.numerator), gain_(parameters.lyapunov) {}

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

std::unique_ptr<ControlLaw> HinfTrackingParameters::make_law(const LawSettings& settings) const {
  return make_law_of_size<HinfTrackingLaw>(*this, settings);
}

}  // namespace

namespace laws {

LawKind hinf_tracking() {
  using P = HinfTrackingParameters;
  LawTable<P> law("hinf-tracking");
  law.gains("numerator", &P::numerator, 1, 3);
  law.lyapunov("lyapunov", &P::lyapunov, 3);
  law.non_negative("velocity_filter_time_constant_s", &P::velocity_filter_time_constant_s);
  return law.kind();
}

}  // namespace laws
}  // namespace quasilpv
