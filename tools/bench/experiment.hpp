// The experiment whose samples the benchmarks replay: a controller in closed loop with a plant.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "quasilpv/artifact.hpp"
#include "quasilpv/controller.hpp"
#include "quasilpv/scenario.hpp"
#include "quasilpv/simulation.hpp"
#include "quasilpv/trajectory.hpp"

namespace quasilpv::bench {

/// What entered every control step of a run and what it answered.
struct Recording {
  std::vector<StepInput> inputs;
  std::vector<JointArray> torques;  ///< applied, N m
  std::uint32_t flags = kStepHealthy;
};

/// Runs the closed loop of an artifact, a trajectory and a scenario and records it. Throws InputError, PlantError.
inline Recording record(const Artifact& artifact, const Trajectory& trajectory, const Scenario& scenario) {
  Controller controller(artifact);
  Recording recording;
  const RunRecord run = run_closed_loop(
      scenario, artifact.sample_period_s(),
      [&](const StepInput& input) {
        const StepReport report = controller.step(input);
        recording.inputs.push_back(input);
        recording.torques.push_back(report.torque_applied);
        return report;
      },
      [&](double time_s) { return trajectory.evaluate(time_s); });
  recording.flags = run.flags;
  return recording;
}

}  // namespace quasilpv::bench
