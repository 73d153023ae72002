#include "state_feedback_law.hpp"

namespace quasilpv {

std::unique_ptr<ControlLaw> make_law(const StateFeedbackParameters& parameters, const LawSettings& settings) {
  return make_law_of_size<StateFeedbackLaw>(parameters, settings);
}

}  // namespace quasilpv
