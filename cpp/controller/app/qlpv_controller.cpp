// qlpv-controller: one artifact, of a robot with a trajectory or of a system, one run over LCM; a doctor; a reset.
// Contract: docs/reference/messages.md
#include <algorithm>
#include <atomic>
#include <iostream>
#include <memory>
#include <string>

#include "command_line/command_line.hpp"
#include "command_line/run_report.hpp"
#include "quasilpv/artifact.hpp"
#include "quasilpv/doctor.hpp"
#include "quasilpv/lcm_link.hpp"
#include "quasilpv/link_robot.hpp"
#include "quasilpv/loop.hpp"
#include "quasilpv/reset_fault.hpp"
#include "quasilpv/run_controller.hpp"
#include "quasilpv/system_loop.hpp"
#include "quasilpv/telemetry_publisher.hpp"
#include "quasilpv/trajectory.hpp"

namespace {

using namespace quasilpv;  // NOLINT(google-build-using-namespace): this file is the program

struct Options {
  CommonOptions common;
  std::string trajectory;
  LoopSettings loop;
  ControllerRunSettings run;
};

void declare_all(CLI::App& app, Options& options) {
  app.footer(
      help_footer({kExitFaultStop, kExitNoRealtime, kExitNoTransport, kExitPlantFailure}) +
      "\n\nAlso: qlpv-controller --doctor (will this machine hold the rate?), qlpv-controller --reset-fault (leave "
      "a latched fault); each has its own --help.");
  declare(app, options.common);
  add_file(app, "trajectory", options.trajectory, "the reference, JSON or CBOR; of robots, which need one");
  add_word<SafeAction>(app, "safe-action", options.loop.safe_action,
                       {{"zero", SafeAction::kZero}, {"gravity", SafeAction::kGravity}},
                       "of robots: torque after a fault; gravity: minus damping");
  add_time(app, "silence-s", options.run.silence_s, "realtime: fault after so long without a measurement");
  add_switch(app, "exit-on-fault", options.run.exit_on_fault, "end the run once a fault has led to the safe torque");
}

Json post_mortem_of(const ControlLoop& loop) { return to_json(loop.post_mortem(), loop.cause(), loop.joints()); }
Json post_mortem_of(const SystemLoop& loop) { return to_json(loop.post_mortem(), loop.cause(), loop.artifact()); }

template <class Loop>
Json describe(const Loop& loop, const ControllerRunReport& run, const TelemetryReport& telemetry, const Link& link,
              bool realtime) {
  return {{"end", to_string(run.end)},
          {"state", to_string(loop.state())},
          {"fault_cause", to_string(loop.cause())},
          {"robot_fault", to_string(run.robot_fault)},
          {"steps", loop.steps()},
          {"predicted_steps", loop.predicted_steps()},
          {"last_seq", loop.last_seq()},
          {"flags", loop.flags()},
          {"commands", run.commands},
          {"repeated_commands", run.repeated},
          {"deadline_overruns", run.deadline_overruns},
          {"faults", loop.faults()},
          {"resets", run.resets},
          {"rt", realtime},
          {"step_ns", to_json(loop.step_time())},
          {"wakeup_ns", to_json(run.arrival)},
          {"response_ns", to_json(run.response)},
          {"authenticated", link.is_authenticated()},
          {"link", to_json(link.counters())},
          {"telemetry",
           {{"published", telemetry.published},
            {"drops", telemetry.drops},
            {"record_drops", telemetry.record_drops},
            {"send_failures", telemetry.send_failures}}},
          {"post_mortem", post_mortem_of(loop)}};
}

std::string refused_start(const ControlLoop& loop) { return loop.refusal() ? to_string(*loop.refusal()) : ""; }
std::string refused_start(const SystemLoop& /*loop*/) { return ""; }

/// Why the run counts as stopped by a fault; empty if it does not.
template <class Loop>
std::string fault_stop_reason(const Loop& loop, const ControllerRunReport& run, const Link& link) {
  if (std::string refusal = refused_start(loop); !refusal.empty()) {
    return refusal;
  }
  if (loop.state() == ControllerState::kFault && loop.cause() != FaultCause::kStopRequested) {
    return naming(to_string(loop.cause()), link);
  }
  if (run.robot_fault != FaultCause::kNone) {
    return naming(to_string(run.robot_fault), link);
  }
  return run.end == ControllerRunEnd::kPlantSilent ? to_string(run.end) : "";
}

template <class Loop>
int exit_code(const Loop& loop, const ControllerRunReport& run, const Link& link, const CommonOptions& options) {
  if (run.end == ControllerRunEnd::kRefused) {
    throw_refused(options, link, "the plant");
  }
  if (run.end == ControllerRunEnd::kPlantNeverHeard) {
    throw_never_heard(options, link, "measurement", "qlpv-simulator");
  }
  warn_of_other_run("qlpv-controller", link, options.url);
  if (run.robot_fault == FaultCause::kPlantFailed) {
    throw PlantError("the plant says that it failed after sample " + std::to_string(loop.last_seq()));
  }
  const std::string reason = fault_stop_reason(loop, run, link);
  return reason.empty() ? kExitDone : report_fault_stop("qlpv-controller", reason, loop.last_seq());
}

/// One run of a loop over LCM, from its first reading to its report.
///
/// @param make_publisher  of the loop's samples, on a link of its own
template <class Port, class Loop, class MakePublisher>
int run_loop(Loop& loop, const Options& options, const WireIdentity& identity, MakePublisher make_publisher,
             bool realtime) {
  const CommonOptions& common = options.common;
  LcmLink link(Side::kController, identity, common.url, common.allow_network);
  apply_key(common, link);
  const auto publisher = make_publisher(
      std::make_unique<LcmLink>(Side::kController, identity, common.url, common.allow_network, Listen::kNothing));
  ControllerRunSettings settings = options.run;
  settings.pace = common.pace;
  settings.timeout_s = common.timeout_s;
  loop.publish_to(&publisher->ring());
  Port port(link);
  const ControllerRunReport report = run_controller(loop, port, settings, install_stop_signals());
  const TelemetryReport telemetry = publisher->stop();
  print_report(std::cout, describe(loop, report, telemetry, link, realtime), common.json);
  if (telemetry.record_drops > 0) {
    std::cerr << "qlpv-controller: warning: " << common.record << ": " << telemetry.record_drops
              << " rows of the record were lost\n";
  }
  return exit_code(loop, report, link, common);
}

int run_robot(const CLI::App& app, Options& options) {
  const CommonOptions& common = options.common;
  if (options.trajectory.empty()) {
    throw InputError("command line", "trajectory", "nothing", "the reference of the robot");
  }
  const Artifact artifact = Artifact::load(common.artifact);
  const Trajectory trajectory = Trajectory::load(options.trajectory);
  install_stop_signals();
  std::unique_ptr<OutputFile> record = open_record(common, "qlpv-controller", options.trajectory);
  options.loop.realtime = apply_priority(app, common);
  // In lock-step a run is the run in process, bit for bit; there is no arm that a bump could harm.
  options.loop.bumpless_start = common.pace == Pace::kRealTime;
  ControlLoop loop(artifact, trajectory, options.loop);
  const auto publisher = [&](std::unique_ptr<Link> link) {
    return std::make_unique<TelemetryPublisher>(std::move(link), artifact.sample_period_s(), artifact.joints(),
                                                std::move(record));
  };
  return run_loop<LinkRobot>(loop, options, identity_of(common, artifact), publisher, options.loop.realtime);
}

int run_system(const CLI::App& app, const Options& options) {
  const CommonOptions& common = options.common;
  for (const char* name : {"trajectory", "safe-action"}) {
    if (app.count(std::string("--") + name) > 0) {
      throw InputError("command line", name, "a value", "nothing beside the artifact of a system");
    }
  }
  const SystemArtifact artifact = SystemArtifact::load(common.artifact);
  install_stop_signals();
  std::unique_ptr<OutputFile> record = open_record(common, "qlpv-controller", "");
  SystemLoopSettings settings;
  settings.realtime = apply_priority(app, common);
  SystemLoop loop(artifact, settings);
  const auto publisher = [&](std::unique_ptr<Link> link) {
    return std::make_unique<SystemPublisher>(std::move(link), artifact, std::move(record));
  };
  return run_loop<LinkSystem>(loop, options, identity_of(common, artifact), publisher, settings.realtime);
}

int run(const CLI::App& app, Options& options) {
  return SystemArtifact::is_in(options.common.artifact) ? run_system(app, options) : run_robot(app, options);
}

struct DoctorOptions {
  CommonOptions common;
  double rate_hz = 1000.0;
  double seconds = 3.0;
  bool asked = false;  ///< always, or this would be another command
};

void declare_doctor(CLI::App& app, DoctorOptions& options) {
  app.footer("Example:\n  qlpv-controller --doctor --artifact artifact.json\n\n" +
             describe_exit_codes({kExitNo, kExitNoTransport}));
  add_switch(app, "doctor", options.asked, "measure whether this machine will hold the rate, and say what to change");
  add_file(app, "artifact", options.common.artifact, "measure the step of this controller, at its rate");
  add_number(app, "rate-hz", options.rate_hz, 1.0, 1e5, "the rate without an artifact");
  add_number(app, "seconds", options.seconds, 0.01, 3600.0, "of each measurement");
  declare_transport(app, options.common);
  options.common.priority = 50;
  declare_priority(app, options.common);
  add_switch(app, "json", options.common.json, "report as one line of JSON");
}

/// Normal scheduling first, then what is granted: the step and the round trip under the better of both.
DoctorFindings examine(const DoctorOptions& options, const std::optional<Artifact>& artifact) {
  DoctorFindings findings;
  findings.period_ns = to_nanoseconds(artifact ? artifact->sample_period_s() : 1.0 / options.rate_hz);
  const auto samples = std::max<std::int64_t>(1, to_nanoseconds(options.seconds) / findings.period_ns);
  findings.preempt_rt = is_preempt_rt();
  findings.wakeup = measure_wakeup(findings.period_ns, samples);
  findings.realtime = enter_realtime(options.common.priority);
  if (findings.realtime.fifo) {
    findings.wakeup_fifo = measure_wakeup(findings.period_ns, samples);
  }
  if (artifact) {
    findings.step = measure_step(*artifact, samples);
  }
  try {
    const WireIdentity identity{monotonic_ns(), 0, 1};
    LcmLink plant(Side::kPlant, identity, options.common.url, options.common.allow_network);
    LcmLink controller(Side::kController, identity, options.common.url, options.common.allow_network);
    findings.round_trip = measure_round_trip(plant, controller, findings.period_ns, samples);
  } catch (const TransportError& error) {
    findings.transport_error = error.what();
  }
  return findings;
}

Json describe(const DoctorFindings& findings) {
  const auto optional = [](const std::optional<LatencyHistogram>& histogram) {
    return histogram ? to_json(*histogram) : Json(nullptr);
  };
  return {{"verdict", to_string(judge(findings))},
          {"period_ns", findings.period_ns},
          {"wakeup_ns", to_json(findings.wakeup)},
          {"wakeup_fifo_ns", optional(findings.wakeup_fifo)},
          {"step_ns", optional(findings.step)},
          {"round_trip_ns", optional(findings.round_trip)},
          {"fifo", findings.realtime.fifo},
          {"memory_locked", findings.realtime.memory_locked},
          {"preempt_rt", findings.preempt_rt},
          {"multicast", findings.transport_error.empty()},
          {"advice", advice(findings)}};
}

int run_doctor(const DoctorOptions& options) {
  apply_cpu(options.common);
  std::optional<Artifact> artifact;
  if (!options.common.artifact.empty()) {
    artifact = Artifact::load(options.common.artifact);
  }
  const DoctorFindings findings = examine(options, artifact);
  Json report = describe(findings);
  if (!options.common.json) {
    report.erase("advice");
  }
  print_report(std::cout, report, options.common.json);
  if (!options.common.json) {
    std::cout << "\nAt " << kNanosecondsPerSecond / findings.period_ns << " Hz this machine "
              << to_string(judge(findings)) << ".\n";
    for (const std::string& sentence : advice(findings)) {
      std::cout << "- " << sentence << '\n';
    }
  }
  switch (judge(findings)) {
    case DoctorVerdict::kFails:
      return kExitNo;
    case DoctorVerdict::kNoTransport:
      return kExitNoTransport;
    default:
      return kExitDone;
  }
}

struct ResetOptions {
  CommonOptions common;
  bool asked = false;  ///< always
};

void declare_reset(CLI::App& app, ResetOptions& reset) {
  CommonOptions& options = reset.common;
  app.footer("Example:\n  qlpv-controller --reset-fault --artifact artifact.json --session 7\n\n" +
             describe_exit_codes({kExitFaultStop, kExitNoTransport}));
  add_switch(app, "reset-fault", reset.asked, "ask the running controller of this session to leave its latched fault");
  declare_identity(app, options);
  declare_transport(app, options);
  options.timeout_s = 1.0;
  add_time(app, "timeout-s", options.timeout_s, "ask for so long");
}

int run_reset(const CommonOptions& options) {
  const WireIdentity identity = SystemArtifact::is_in(options.artifact)
                                    ? identity_of(options, SystemArtifact::load(options.artifact))
                                    : identity_of(options, Artifact::load(options.artifact));
  LcmLink link(Side::kOperator, identity, options.url, options.allow_network);
  apply_key(options, link);
  switch (request_reset(link, options.timeout_s)) {
    case ResetOutcome::kLeft:
      return kExitDone;
    case ResetOutcome::kStillFault:
      std::cerr << "qlpv-controller: still in fault: its cause is not gone\n";
      return kExitFaultStop;
    case ResetOutcome::kSilent:
      break;
  }
  throw_never_heard(options, link, "command", "qlpv-controller");
}

}  // namespace

int main(int argc, char** argv) {
  const auto has = [&](const std::string& flag) { return std::find(argv, argv + argc, flag) != argv + argc; };
  if (has("--doctor")) {
    DoctorOptions options;
    return run_main(
        argc, argv, "qlpv-controller", "Measures whether this machine will hold the rate of a controller.",
        [&](CLI::App& app) { declare_doctor(app, options); }, [&](const CLI::App&) { return run_doctor(options); });
  }
  if (has("--reset-fault")) {
    ResetOptions options;
    return run_main(
        argc, argv, "qlpv-controller", "Asks a running controller to leave its latched fault.",
        [&](CLI::App& app) { declare_reset(app, options); },
        [&](const CLI::App&) { return run_reset(options.common); });
  }
  Options options;
  return run_main(
      argc, argv, "qlpv-controller", "Runs one controller against a plant over LCM until the plant ends the run.",
      [&](CLI::App& app) { declare_all(app, options); }, [&](const CLI::App& app) { return run(app, options); });
}
