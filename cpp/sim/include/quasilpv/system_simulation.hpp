// A general system in closed loop, in one process, in lock-step.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "quasilpv/record.hpp"
#include "quasilpv/system_controller.hpp"
#include "quasilpv/system_session.hpp"

namespace quasilpv {

/// Every sample of one run.
struct SystemRun {
  std::uint32_t flags = kSystemHealthy;
  std::optional<DomainExit> exit;
  Record samples;  ///< `time_s`, `state`, `measured`, `input`, `commanded`, `premise`, `level`, `flags`
};

/// Runs the loop for the samples of the scenario, or until a state leaves its domain: measure, step, advance the plant
/// under the held input. Deterministic. RT-UNSAFE. Throws like SystemSession.
SystemRun simulate_system(const SystemArtifact& artifact, const SystemScenario& scenario);

/// What the disturbance of a scenario is at every sample, of states (added to their rates) and inputs: row by row.
/// RT-UNSAFE.
std::vector<double> disturbance_of(const SystemArtifact& artifact, const SystemScenario& scenario);

}  // namespace quasilpv
