#include "quasilpv/external_torque.hpp"

#include <cmath>
#include <string>
#include <utility>

#include "quasilpv/errors.hpp"

namespace quasilpv {

ExternalTorque::ExternalTorque(std::vector<SineTorque> terms) : terms_(std::move(terms)) {
  for (std::size_t i = 0; i < terms_.size(); ++i) {
    if (terms_[i].joint < 0 || terms_[i].joint >= kMaxJoints) {
      throw InputError("external torque", "[" + std::to_string(i) + "].joint", std::to_string(terms_[i].joint),
                       "0 to " + std::to_string(kMaxJoints - 1));
    }
  }
}

JointArray ExternalTorque::at(double time_s) const noexcept {
  JointArray torque{};
  for (const SineTorque& term : terms_) {
    torque[static_cast<std::size_t>(term.joint)] +=
        term.amplitude_nm * std::sin(term.frequency_rad_s * time_s + term.phase_rad);
  }
  return torque;
}

}  // namespace quasilpv
