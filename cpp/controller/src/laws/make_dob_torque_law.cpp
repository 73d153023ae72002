#include "dob_torque_law.hpp"

namespace quasilpv {

std::unique_ptr<ControlLaw> make_law(const DobTorqueParameters& parameters, const LawSettings& settings) {
  return make_law_of_size<DobTorqueLaw>(parameters, settings);
}

}  // namespace quasilpv
