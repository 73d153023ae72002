#include "hinf_tracking_law.hpp"

namespace quasilpv {

std::unique_ptr<ControlLaw> make_law(const HinfTrackingParameters& parameters, const LawSettings& settings) {
  return make_law_of_size<HinfTrackingLaw>(parameters, settings);
}

}  // namespace quasilpv
