// The closed loop in one process, in lock-step.
#pragma once

#include <cstdint>
#include <functional>

#include "quasilpv/artifact.hpp"
#include "quasilpv/controller.hpp"
#include "quasilpv/record.hpp"
#include "quasilpv/scenario.hpp"
#include "quasilpv/step.hpp"
#include "quasilpv/trajectory.hpp"

namespace quasilpv {

/// Every sample of one closed-loop run.
struct RunRecord {
  double sample_period_s = 0.0;
  int joints = 0;
  std::uint32_t flags = kStepHealthy;  ///< union of the fault bits of all steps
  Record samples;                      ///< `time_s`, then the columns of PlantColumns and StepColumns
};

/// One control step; any law that can be called. Its input is the reading as it is, with the sensors of gears beside
/// it.
using StepFunction = std::function<StepReport(const StepInput&)>;
/// Reference at plant time, s.
using ReferenceFunction = std::function<Reference(double)>;

/// Runs the loop for k = 0 .. round(duration / T) - 1: measure, evaluate the reference at k T, step, advance the plant
/// with `torque_applied`. Plant columns are taken at t_k before torque k acts. Deterministic: equal arguments give
/// equal bits. RT-UNSAFE. Throws InputError and PlantError like PlantSession.
RunRecord run_closed_loop(const Scenario& scenario, double sample_period_s, const StepFunction& step,
                          const ReferenceFunction& reference);

/// The same with a controller, which is reset first, at its own sample period. Throws InputError also if scenario,
/// controller and trajectory differ in the number of joints.
RunRecord run_closed_loop(const Scenario& scenario, Controller& controller, const Trajectory& trajectory);

/// The same with the controller and the monitor of an artifact: the record has the columns of MonitorColumns too. A
/// factory that is not empty makes the integrator instead of the scenario.
RunRecord run_closed_loop(const Scenario& scenario, const Artifact& artifact, const Trajectory& trajectory,
                          const IntegratorFactory& integrator = {});

}  // namespace quasilpv
