// A general system in closed loop, in one process, in lock-step.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "quasilpv/integrator.hpp"
#include "quasilpv/record.hpp"
#include "quasilpv/system_controller.hpp"

namespace quasilpv {

/// What is simulated. Values are those of the signals, trim included.
struct SystemExperiment {
  std::vector<double> start;      ///< of all states; algebraic ones are a first guess
  std::vector<double> parameter;  ///< of all parameters, true to the plant and told to the law where it knows them
  std::int64_t samples = 0;
  IntegratorOptions integrator = IdaOptions{};
  double delay_s = 0.0;  ///< until an input acts, at most one sample
};

/// Where a state left its domain, which ends a run.
struct DomainExit {
  double time_s = 0.0;
  std::string signal;
};

/// Every sample of one run.
struct SystemRun {
  std::uint32_t flags = kSystemHealthy;
  std::optional<DomainExit> exit;
  Record samples;  ///< `time_s`, `state`, `input`, `commanded`, `premise`, `level`, `flags`
};

/// Runs the loop for `samples` samples, or until a state leaves its domain: measure, step, advance the plant under the
/// held input. Deterministic. RT-UNSAFE. Throws InputError for sizes that do not fit, PlantError like the plant.
SystemRun simulate_system(const SystemArtifact& artifact, const SystemExperiment& experiment);

}  // namespace quasilpv
