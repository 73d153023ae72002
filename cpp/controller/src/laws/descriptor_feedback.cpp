// State feedback with a gain that is rational in the premises: the law of Theorem II.6.
#include "laws/common/descriptor_gain.hpp"
#include "laws/common/law_table.hpp"
#include "laws/common/stabilising_law.hpp"

namespace quasilpv {
namespace {

/// u = F(z) E(z)^-T P^-1 x with E = diag(I, M_n) and x = (y - r, w - r').
struct DescriptorFeedbackParameters final : StabilisingParameters {
  BlockPolytope numerator;   ///< F, n x 2n
  Eigen::MatrixXd lyapunov;  ///< P, 2n x 2n, symmetric positive definite

  std::unique_ptr<ControlLaw> make_law(const LawSettings& settings) const override;
};

/// Gamma = F(z) E(z)^-T P^-1 x, limited, with x = (y - r, w - r') and E = diag(I, M_n). Source: Dehak 2022, (II.38).
template <int N>
class DescriptorFeedbackLaw final : public StabilisingLaw<N> {
 public:
  DescriptorFeedbackLaw(const DescriptorFeedbackParameters& parameters, const LawSettings& settings)
      : StabilisingLaw<N>(parameters, settings), numerator_(parameters.numerator), gain_(parameters.lyapunov) {}

 private:
  JointVector<N> feedback(const StateError<N>& state, std::array<double, kMaxPremises>& premise,
                          const ModelSample<N>& model, StepReport& report) noexcept override {
    StateGain<N> numerator;
    if (numerator_.evaluate(premise.data(), numerator)) {
      report.flags |= kPremiseOutsideBox;
    }
    return gain_.at(model, numerator, report) * state;
  }

  BlockPolytope numerator_;
  DescriptorGain<N, 2 * N> gain_;
};

std::unique_ptr<ControlLaw> DescriptorFeedbackParameters::make_law(const LawSettings& settings) const {
  return make_law_of_size<DescriptorFeedbackLaw>(*this, settings);
}

}  // namespace

namespace laws {

LawKind descriptor_feedback() {
  using P = DescriptorFeedbackParameters;
  LawTable<P> law("descriptor-feedback");
  law.polytope("numerator", &P::numerator, 1, 2);
  law.lyapunov("lyapunov", &P::lyapunov, 2);
  law.non_negative("velocity_filter_time_constant_s", &P::velocity_filter_time_constant_s);
  law.schedule(&P::schedule, &P::numerator);
  return law.kind();
}

}  // namespace laws
}  // namespace quasilpv
