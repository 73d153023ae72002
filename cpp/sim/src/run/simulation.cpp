#include "quasilpv/simulation.hpp"

#include <string>
#include <vector>

#include "quasilpv/errors.hpp"
#include "quasilpv/plant_session.hpp"
#include "quasilpv/run_columns.hpp"

namespace quasilpv {
namespace {

void require_joints(const Scenario& scenario, const std::string& source, int joints) {
  if (joints != scenario.joints()) {
    throw InputError(source, "joints", std::to_string(joints),
                     std::to_string(scenario.joints()) + " as in scenario '" + scenario.name + "'");
  }
}

RunRecord run_session(PlantSession& session, double sample_period_s, const StepFunction& step,
                      const ReferenceFunction& reference, const Controller* chooser) {
  RunRecord run;
  run.sample_period_s = sample_period_s;
  run.joints = session.joints();
  const std::size_t time = run.samples.add_column("time_s");
  PlantColumns plant_columns(run.samples, run.joints, session.truth().motors.has_value());
  StepColumns step_columns(run.samples, run.joints, session.measure(0).gears.available);
  run.samples.reserve(static_cast<std::size_t>(session.samples()));

  for (std::int64_t k = 0; k < session.samples(); ++k) {
    const double t = static_cast<double>(k) * sample_period_s;
    const Measurement& measurement = session.measure(k);
    StepInput input;
    input.seq = k;
    input.angle = measurement.angle;
    input.speed = measurement.speed;
    input.gears = measurement.gears;
    input.reference = reference(t);
    if (chooser != nullptr) {
      chooser->choose_angle(input);
    }
    const StepReport report = step(input);

    run.flags |= report.flags;
    run.samples.append(time, t);
    plant_columns.append(session.truth());
    step_columns.append(input, measurement.angle, report);
    session.advance(k, report.torque_applied);
  }
  return run;
}

RunRecord follow(const Scenario& scenario, double sample_period_s, const Trajectory& trajectory,
                 const StepFunction& step, const IntegratorFactory& integrator, const Controller& chooser) {
  require_joints(scenario, "trajectory '" + trajectory.name() + "'", trajectory.joints());
  PlantSession session(scenario, sample_period_s, integrator);
  return run_session(
      session, sample_period_s, step, [&](double time_s) { return trajectory.evaluate(time_s); }, &chooser);
}

}  // namespace

RunRecord run_closed_loop(const Scenario& scenario, double sample_period_s, const StepFunction& step,
                          const ReferenceFunction& reference) {
  PlantSession session(scenario, sample_period_s);
  return run_session(session, sample_period_s, step, reference, nullptr);
}

RunRecord run_closed_loop(const Scenario& scenario, Controller& controller, const Trajectory& trajectory) {
  require_joints(scenario, "controller", controller.joints());
  controller.reset();
  return follow(
      scenario, controller.sample_period_s(), trajectory,
      [&](const StepInput& input) { return controller.step(input); }, {}, controller);
}

RunRecord run_closed_loop(const Scenario& scenario, const Artifact& artifact, const Trajectory& trajectory,
                          const IntegratorFactory& integrator) {
  require_joints(scenario, "artifact '" + artifact.name() + "'", artifact.joints());
  Controller controller(artifact);
  const Monitor monitor(artifact);
  std::vector<MonitorReport> seen;
  const StepFunction step = [&](const StepInput& input) {
    const StepReport report = controller.step(input);
    seen.push_back(monitor.observe(input, report));
    return report;
  };
  RunRecord run = follow(scenario, artifact.sample_period_s(), trajectory, step, integrator, controller);
  MonitorColumns columns(run.samples);
  for (const MonitorReport& sample : seen) {
    columns.append(sample);
  }
  return run;
}

}  // namespace quasilpv
