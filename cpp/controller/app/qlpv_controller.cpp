// qlpv-controller: one artifact, one trajectory, one run over LCM. Contract: docs/reference/messages.md
#include <iostream>
#include <map>
#include <memory>
#include <string>

#include "quasilpv/artifact.hpp"
#include "quasilpv/command_line.hpp"
#include "quasilpv/lcm_link.hpp"
#include "quasilpv/loop.hpp"
#include "quasilpv/run_controller.hpp"
#include "quasilpv/run_report.hpp"
#include "quasilpv/telemetry_publisher.hpp"
#include "quasilpv/trajectory.hpp"

namespace {

using namespace quasilpv;  // NOLINT(google-build-using-namespace): this file is the program

struct Options {
  CommonOptions common;
  std::string trajectory;
  SafeAction safe_action = SafeAction::kZero;
  ControllerRunSettings run;
};

void declare_all(CLI::App& app, Options& options) {
  static const std::map<std::string, SafeAction> kActions{{"zero", SafeAction::kZero},
                                                          {"gravity", SafeAction::kGravity}};
  app.footer(help_footer());
  declare(app, options.common);
  app.add_option("--trajectory", options.trajectory, "the reference, JSON or CBOR")->required();
  app.add_option("--safe-action", options.safe_action, "torque after a fault: zero (default), or gravity minus damping")
      ->transform(CLI::CheckedTransformer(kActions, CLI::ignore_case).description(""));
  app.add_option("--silence-s", options.run.silence_s, "realtime: fault after so long without a measurement")
      ->check(CLI::PositiveNumber.description(""))
      ->capture_default_str();
  app.add_flag("--exit-on-fault", options.run.exit_on_fault, "end the run once a fault has led to the safe torque");
}

Json describe(const ControlLoop& loop, const ControllerRunReport& run, const TelemetryReport& telemetry,
              const LinkCounters& counters, bool realtime) {
  return {{"end", to_string(run.end)},
          {"state", to_string(loop.state())},
          {"fault_cause", to_string(loop.cause())},
          {"steps", loop.steps()},
          {"predicted_steps", loop.predicted_steps()},
          {"last_seq", loop.last_seq()},
          {"flags", loop.flags()},
          {"commands", run.commands},
          {"repeated_commands", run.repeated},
          {"deadline_overruns", run.deadline_overruns},
          {"rt", realtime},
          {"step_ns", to_json(loop.step_time())},
          {"wakeup_ns", to_json(run.arrival)},
          {"response_ns", to_json(run.response)},
          {"link", to_json(counters)},
          {"telemetry",
           {{"published", telemetry.published},
            {"drops", telemetry.drops},
            {"record_drops", telemetry.record_drops},
            {"send_failures", telemetry.send_failures}}}};
}

int exit_code(const ControlLoop& loop, const ControllerRunReport& run, const CommonOptions& options) {
  if (run.end == ControllerRunEnd::kPlantNeverHeard) {
    throw_never_heard(options, "measurement", "qlpv-simulator");
  }
  const bool ended_in_fault = loop.state() == ControllerState::kFault && loop.cause() != FaultCause::kStopRequested;
  if (!ended_in_fault && run.end != ControllerRunEnd::kPlantSilent) {
    return kExitDone;
  }
  const char* reason = ended_in_fault ? to_string(loop.cause()) : to_string(run.end);
  return report_fault_stop("qlpv-controller", reason, loop.last_seq());
}

int run(const CLI::App& app, Options& options) {
  const CommonOptions& common = options.common;
  const Artifact artifact = Artifact::load(common.artifact);
  const Trajectory trajectory = Trajectory::load(options.trajectory);
  LoopSettings settings;
  settings.safe_action = options.safe_action;
  settings.realtime = apply_priority(app, common);
  ControlLoop loop(artifact, trajectory, settings);

  const WireIdentity identity = identity_of(common, artifact);
  LcmLink link(Side::kController, identity, common.url, common.allow_network);
  auto telemetry_link =
      std::make_unique<LcmLink>(Side::kController, identity, common.url, common.allow_network, Listen::kNothing);
  TelemetryPublisher publisher(std::move(telemetry_link), artifact.sample_period_s(), artifact.joints(), common.record);

  options.run.pace = common.pace;
  options.run.timeout_s = common.timeout_s;
  const ControllerRunReport report = run_controller(loop, link, &publisher.ring(), options.run, install_stop_signals());
  const TelemetryReport telemetry = publisher.stop();
  print_report(std::cout, describe(loop, report, telemetry, link.counters(), settings.realtime), common.json);
  return exit_code(loop, report, common);
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  return run_main(
      argc, argv, "qlpv-controller", "Runs one controller against a plant over LCM until the plant ends the run.",
      [&](CLI::App& app) { declare_all(app, options); }, [&](const CLI::App& app) { return run(app, options); });
}
