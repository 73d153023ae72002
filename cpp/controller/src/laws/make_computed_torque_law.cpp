#include "computed_torque_law.hpp"

namespace quasilpv {

std::unique_ptr<ControlLaw> make_law(const ComputedTorqueParameters& parameters, const LawSettings& settings) {
  return make_law_of_size<ComputedTorqueLaw>(parameters, settings);
}

}  // namespace quasilpv
