// Scheduled state feedback: parallel distributed compensation.
#pragma once

#include "stabilising_law.hpp"

namespace quasilpv {

/// Gamma = K(z) x, limited, with x = (y - r, w - r') and K given by vertices. Source: Dehak 2022, Theorem I.2; with a
/// schedule of the known premises only, the robust law (III.25).
template <int N>
class StateFeedbackLaw final : public StabilisingLaw<N> {
 public:
  StateFeedbackLaw(const StateFeedbackParameters& parameters, const LawSettings& settings)
      : StabilisingLaw<N>(parameters, settings), gain_(parameters.gain) {}

 private:
  JointVector<N> feedback(const StateError<N>& state, std::array<double, kMaxPremises>& premise,
                          const ModelSample<N>& /*model*/, StepReport& report) noexcept override {
    StateGain<N> gain;
    if (gain_.evaluate(premise.data(), gain)) {
      report.flags |= kPremiseOutsideBox;
    }
    return gain * state;
  }

  BlockPolytope gain_;
};

}  // namespace quasilpv
