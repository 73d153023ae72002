#include "delayed_feedback_law.hpp"

namespace quasilpv {

std::unique_ptr<ControlLaw> make_law(const DelayedFeedbackParameters& parameters, const LawSettings& settings) {
  return make_law_of_size<DelayedFeedbackLaw>(parameters, settings);
}

}  // namespace quasilpv
