// What a loop is told of a sample besides its measurement.
#pragma once

#include <cstdint>

#include "quasilpv/failsafe.hpp"

namespace quasilpv {

/// What only the caller can know about a sample.
struct SampleConditions {
  std::int64_t now_ns = 0;                ///< clock of the fail-safe policy: monotonic, or seq T in lock-step
  std::int64_t consecutive_overruns = 0;  ///< samples before this one that took longer than their period
  std::int64_t consecutive_foreign = 0;   ///< ControlPort::take_longest_foreign_run()
  bool stop_requested = false;
  FaultCause demanded = FaultCause::kNone;  ///< ControlPort::take_fault()
};

}  // namespace quasilpv
