// The seam of a general system: signals in, inputs out, in the order and the units of the artifact's signals.
#pragma once

#include <array>
#include <cstdint>

#include "quasilpv/control_port.hpp"
#include "quasilpv/system_artifact.hpp"
#include "quasilpv/system_controller.hpp"

namespace quasilpv {

/// One value per measured signal: the states, then the parameters; what there is not is 0.
using SignalArray = std::array<double, kMaxSignals>;

/// One value per input; what there is not is 0.
using InputArray = std::array<double, kMaxInputs>;

/// What was measured at one sample.
struct SystemReading {
  std::int64_t seq = 0;       ///< sample index k, so its time is k T; a gap is a lost sample
  std::int64_t taken_ns = 0;  ///< monotonic_ns() of the measurement
  SignalArray value{};        ///< with trim; NaN marks a sensor that failed: the input is then held
};

/// What the system shall get from now on.
struct SystemCommand {
  std::int64_t seq = 0;  ///< of the reading it answers
  InputArray input{};    ///< with trim, within the limits of the artifact
  ControllerState state = ControllerState::kInit;
  std::uint32_t flags = kSystemHealthy;  ///< SystemFlag bits
};

/// A general system as the control thread sees it.
using SystemPort = ControlPort<SystemReading, SystemCommand>;

}  // namespace quasilpv
