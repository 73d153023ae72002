// State feedback with a gain that is rational in the premises: the law of Theorem II.6.
#pragma once

#include "descriptor_gain.hpp"
#include "stabilising_law.hpp"

namespace quasilpv {

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

}  // namespace quasilpv
