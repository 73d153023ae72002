#include "descriptor_feedback_law.hpp"

namespace quasilpv {

std::unique_ptr<ControlLaw> make_law(const DescriptorFeedbackParameters& parameters, const LawSettings& settings) {
  return make_law_of_size<DescriptorFeedbackLaw>(parameters, settings);
}

}  // namespace quasilpv
