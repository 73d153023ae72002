#include "dob_acceleration_law.hpp"

namespace quasilpv {

std::unique_ptr<ControlLaw> make_law(const DobAccelerationParameters& parameters, const LawSettings& settings) {
  return make_law_of_size<DobAccelerationLaw>(parameters, settings);
}

}  // namespace quasilpv
