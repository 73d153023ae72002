// Scheduled state feedback: parallel distributed compensation.
#include "laws/common/law_table.hpp"
#include "laws/common/stabilising_law.hpp"

namespace quasilpv {
namespace {

/// u = K(z) x with x = (y - r, w - r').
struct StateFeedbackParameters final : StabilisingParameters {
  BlockPolytope gain;  ///< K, n x 2n: N m/rad, N m s/rad

  std::unique_ptr<ControlLaw> make_law(const LawSettings& settings) const override;
};

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

std::unique_ptr<ControlLaw> StateFeedbackParameters::make_law(const LawSettings& settings) const {
  return make_law_of_size<StateFeedbackLaw>(*this, settings);
}

}  // namespace

namespace laws {

LawKind state_feedback() {
  using P = StateFeedbackParameters;
  LawTable<P> law("state-feedback");
  law.polytope("gain", &P::gain, 1, 2);
  law.non_negative("velocity_filter_time_constant_s", &P::velocity_filter_time_constant_s);
  law.schedule(&P::schedule, &P::gain);
  return law.kind();
}

}  // namespace laws
}  // namespace quasilpv
