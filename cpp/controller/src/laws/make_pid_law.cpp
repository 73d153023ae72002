#include "pid_law.hpp"

namespace quasilpv {

std::unique_ptr<ControlLaw> make_law(const PidParameters& parameters, const LawSettings& settings) {
  return make_law_of_size<PidLaw>(parameters, settings);
}

}  // namespace quasilpv
