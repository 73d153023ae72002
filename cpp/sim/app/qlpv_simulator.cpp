// qlpv-simulator: the plant of one scenario, one run over LCM. Contract: docs/reference/messages.md
#include <atomic>
#include <iostream>
#include <memory>
#include <string>

#include "command_line/command_line.hpp"
#include "command_line/run_report.hpp"
#include "quasilpv/artifact.hpp"
#include "quasilpv/csv_writer.hpp"
#include "quasilpv/lcm_link.hpp"
#include "quasilpv/plant_loop.hpp"
#include "quasilpv/scenario.hpp"
#include "quasilpv/system_scenario.hpp"
#include "quasilpv/system_session.hpp"

namespace {

using namespace quasilpv;  // NOLINT(google-build-using-namespace): this file is the program

struct Options {
  CommonOptions common;
  std::string scenario;
  double brake_time_constant_s = 0.05;
  PlantRunSettings run;
};

void declare_all(CLI::App& app, Options& options) {
  app.footer(help_footer({kExitFaultStop, kExitNoRealtime, kExitNoTransport, kExitPlantFailure}));
  declare(app, options.common);
  add_file(app, "scenario", options.scenario, "the experiment, true plant included")->required();
  add_time(app, "hold-s", options.run.hold_s, "realtime: the watchdog brakes after so long without a command");
  add_time(app, "brake-time-constant-s", options.brake_time_constant_s,
           "realtime, robots: of the watchdog's viscous brake");
}

Json describe(const PlantRunReport& run, const Link& link, bool realtime) {
  return {{"end", to_string(run.end)},
          {"controller_state", to_string(run.controller_state)},
          {"samples", run.samples},
          {"repeated_measurements", run.repeated},
          {"missed_commands", run.missed_commands},
          {"late_commands", run.late_commands},
          {"refused_commands", run.refused_commands},
          {"watchdog_samples", run.watchdog_samples},
          {"stalls", run.stalls},
          {"overruns", run.overruns},
          {"skipped_ticks", run.skipped_ticks},
          {"rt", realtime},
          {"wakeup_ns", to_json(run.wakeup)},
          {"round_trip_ns", to_json(run.round_trip)},
          {"authenticated", link.is_authenticated()},
          {"link", to_json(link.counters())}};
}

/// Says so if not all of a record could be written; returns whether all of it was. A run without a sample has none.
bool write(const Record& record, OutputFile* file, const std::string& path) {
  if (file == nullptr || record.columns().empty() || record.columns().front().samples() == 0) {
    return true;
  }
  CsvWriter csv(file->stream());
  record.write_csv(csv);
  const bool whole = file->publish();
  if (!whole) {
    std::cerr << "qlpv-simulator: " << path << ": record: got a write error, expected room for the whole record\n";
  }
  return whole;
}

/// Why the run counts as stopped by a fault; empty if it does not.
std::string fault_stop_reason(const PlantRunReport& run, const Link& link) {
  switch (run.end) {
    case PlantRunEnd::kCompleted:
      break;
    case PlantRunEnd::kStopped:
      return "";
    case PlantRunEnd::kCommandsRefused:
      return to_string(run.end) + (": " + run.refusal);
    default:
      return naming(to_string(run.end), link);
  }
  if (run.watchdog_at_end) {
    return "controller silent, braked by the watchdog";
  }
  return run.controller_state == ControllerState::kFault ? "controller in fault" : "";
}

int exit_code(const PlantRunReport& run, const Link& link, const CommonOptions& options) {
  if (run.end == PlantRunEnd::kRefused) {
    throw_refused(options, link, "the controller");
  }
  if (run.end == PlantRunEnd::kControllerNeverHeard) {
    throw_never_heard(options, link, "command", "qlpv-controller");
  }
  warn_of_other_run("qlpv-simulator", link, options.url);
  if (run.refused_commands > 0 && run.end != PlantRunEnd::kCommandsRefused) {
    std::cerr << "qlpv-simulator: warning: " << run.refused_commands << " commands refused: " << run.refusal << '\n';
  }
  const std::string reason = fault_stop_reason(run, link);
  return reason.empty() ? kExitDone : report_fault_stop("qlpv-simulator", reason, run.samples);
}

/// One run of a session over LCM, from its first measurement to its report. `explain` adds to the report what only this
/// kind of plant has to say, and returns why it ended too early, if it did.
template <class Session, class Explain>
int run_session(Session& session, const Options& options, const WireIdentity& identity, OutputFile* file, bool realtime,
                Explain explain) {
  const CommonOptions& common = options.common;
  const std::atomic<bool>& stop = install_stop_signals();
  LcmLink link(Side::kPlant, identity, common.url, common.allow_network);
  apply_key(common, link);
  Record record;
  PlantRunReport report;
  try {
    report = run_plant(session, link, options.run, file != nullptr ? &record : nullptr, stop);
  } catch (const PlantError&) {
    write(record, file, common.record);  // what led to the failure
    throw;
  }
  const bool recorded = write(record, file, common.record);
  Json described = describe(report, link, realtime);
  const std::string reason = explain(described);
  print_report(std::cout, described, common.json);
  int code = exit_code(report, link, common);
  if (code == kExitDone && !reason.empty()) {
    code = report_fault_stop("qlpv-simulator", reason, report.samples);
  }
  return code == kExitDone && !recorded ? kExitBadInput : code;
}

int run_robot(const CLI::App& app, Options& options) {
  const CommonOptions& common = options.common;
  const Artifact artifact = Artifact::load(common.artifact);
  const Scenario scenario = Scenario::load(options.scenario);
  if (scenario.joints() != artifact.joints()) {
    throw InputError(options.scenario, "plant", std::to_string(scenario.joints()) + " joints",
                     std::to_string(artifact.joints()) + " as in artifact '" + artifact.name() + "'");
  }
  install_stop_signals();
  const std::unique_ptr<OutputFile> file = open_record(common, "qlpv-simulator", options.scenario);
  PlantSession session(scenario, artifact.sample_period_s());
  const bool realtime = apply_priority(app, common);
  options.run.torque_limit_nm = artifact.limits().torque_nm;
  options.run.brake_nm_s = viscous_brake(scenario, options.brake_time_constant_s);
  return run_session(session, options, identity_of(common, artifact), file.get(), realtime,
                     [](Json& /*report*/) { return std::string(); });
}

/// Says in the report where the system left its domain, and returns it in words.
std::string explain_exit(const SystemSession& session, Json& report) {
  report["left_domain"] = nullptr;
  if (!session.exit()) {
    return "";
  }
  const std::string& name = session.artifact().states()[static_cast<std::size_t>(session.exit()->state)].name;
  report["left_domain"] = {{"signal", name}, {"time_s", session.exit()->time_s}};
  return name + " left its domain at " + format_number(session.exit()->time_s) + " s";
}

int run_system(const CLI::App& app, const Options& options) {
  const CommonOptions& common = options.common;
  if (app.count("--brake-time-constant-s") > 0) {
    throw InputError("command line", "brake-time-constant-s", "a value", "nothing beside the artifact of a system");
  }
  const SystemArtifact artifact = SystemArtifact::load(common.artifact);
  const SystemScenario scenario = SystemScenario::load(options.scenario, artifact);
  install_stop_signals();
  const std::unique_ptr<OutputFile> file = open_record(common, "qlpv-simulator", options.scenario);
  SystemSession session(artifact, scenario);
  const bool realtime = apply_priority(app, common);
  return run_session(session, options, identity_of(common, artifact), file.get(), realtime,
                     [&session](Json& report) { return explain_exit(session, report); });
}

int run(const CLI::App& app, Options& options) {
  options.run.pace = options.common.pace;
  options.run.timeout_s = options.common.timeout_s;
  return SystemArtifact::is_in(options.common.artifact) ? run_system(app, options) : run_robot(app, options);
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  return run_main(
      argc, argv, "qlpv-simulator", "Runs the plant of a scenario against a controller over LCM.",
      [&](CLI::App& app) { declare_all(app, options); }, [&](const CLI::App& app) { return run(app, options); });
}
