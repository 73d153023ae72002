// What one step of the loop of a general system read and computed: plain data, whoever takes it away.
#pragma once

#include <array>
#include <cstdint>

#include "quasilpv/failsafe.hpp"
#include "quasilpv/system_port.hpp"
#include "quasilpv/telemetry_ring.hpp"

namespace quasilpv {

/// One sample of a run. `quasilpv::link` sends it as `signals_telemetry_v1` (docs/reference/messages.md).
struct SystemSample {
  std::int64_t seq = 0;
  ControllerState state = ControllerState::kInit;
  std::uint32_t flags = kSystemHealthy;        ///< SystemFlag bits
  bool realtime = false;                       ///< memory locked and SCHED_FIFO
  std::int64_t drops = 0;                      ///< samples that the ring could not take so far
  std::int64_t step_ns = 0;                    ///< duration of the step
  std::array<double, kMaxStates> measured{};   ///< states: as they were read, or estimated
  InputArray commanded{};                      ///< before limits
  InputArray applied{};                        ///< what the plant got
  std::array<double, kMaxPremises> premise{};  ///< after clamping
  double level = 0.0;                          ///< V of the states as the law used them
};

/// The telemetry of a run on its way out.
using SystemRing = TelemetryRing<SystemSample, 4096>;

}  // namespace quasilpv
