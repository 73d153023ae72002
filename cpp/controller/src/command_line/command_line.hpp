// What the command lines of both executables share. Only their main files include this (it needs CLI11).
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <iostream>
#include <limits>
#include <memory>
#include <new>
#include <string>
#include <vector>

#include "command_line/options.hpp"
#include "command_line/run_report.hpp"
#include "quasilpv/artifact.hpp"
#include "quasilpv/errors.hpp"
#include "quasilpv/exit_codes.hpp"
#include "quasilpv/lcm_link.hpp"
#include "quasilpv/output_file.hpp"
#include "quasilpv/pacer.hpp"
#include "quasilpv/process_setup.hpp"
#include "quasilpv/realtime.hpp"
#include "quasilpv/system_artifact.hpp"

namespace quasilpv {

/// Options that mean the same on both sides of the wire.
struct CommonOptions {
  std::string artifact;
  std::int64_t session = 0;
  std::string url = kDefaultLcmUrl;
  bool allow_network = false;
  std::string key;  ///< path; empty: messages are not authenticated
  std::string record;
  Pace pace = Pace::kLockStep;
  int priority = 0;  ///< 0: normal scheduling
  int cpu = -1;      ///< -1: any core
  bool require_realtime = false;
  double timeout_s = 10.0;
  bool json = false;
};

/// The end of the help: one run as two commands, and the exit codes.
inline std::string help_footer(std::initializer_list<ExitCode> exit_codes) {
  return "Example:\n"
         "  qlpv-controller --artifact artifact.json --trajectory trajectory.json --session 7 --record controller.csv "
         "&\n"
         "  qlpv-simulator --artifact artifact.json --scenario scenario.json --session 7 --record plant.csv\n\n" +
         describe_exit_codes(exit_codes);
}

/// Bounds of every time on a command line: shorter ones are no time for a process, longer ones no run.
inline constexpr double kShortestTimeS = 1e-4;
inline constexpr double kLongestTimeS = 86400.0;

inline CLI::Option* add_time(CLI::App& app, const std::string& name, double& value, const std::string& meaning) {
  return add_number(app, name, value, kShortestTimeS, kLongestTimeS, meaning);
}

inline void declare_identity(CLI::App& app, CommonOptions& options) {
  add_file(app, "artifact", options.artifact, "the controller, JSON or CBOR")->required();
  add_integer(app, "session", options.session, 0, std::numeric_limits<std::int64_t>::max(),
              "of your choice, the same on both sides")
      ->required();
  add_file(app, "key", options.key, "sign messages, and accept signed ones only: of mode 0600, with the secret");
}

inline void declare_transport(CLI::App& app, CommonOptions& options) {
  add_typed(app, "url", "URL", "LCM address (default " + options.url + ")", [&options](const std::string& text) {
    check_lcm_url(text);
    options.url = text;
  });
  add_switch(app, "allow-network", options.allow_network,
             "accept a url with ttl > 0; without --key messages are not authenticated");
}

inline CLI::Option* declare_priority(CLI::App& app, CommonOptions& options) {
  add_integer(app, "cpu", options.cpu, 0, kMostCpus - 1, "stay on this core");
  return add_integer(app, "priority", options.priority, 1, 99, "lock memory and use SCHED_FIFO with this priority");
}

inline void declare(CLI::App& app, CommonOptions& options) {
  declare_identity(app, options);
  declare_transport(app, options);
  add_file(app, "record", options.record, "write every sample to this CSV file");
  add_word<Pace>(app, "mode", options.pace, {{"lockstep", Pace::kLockStep}, {"realtime", Pace::kRealTime}},
                 "who makes time pass");
  add_switch(app, "require-rt", options.require_realtime, "exit 4 if --priority cannot be had")
      ->needs(declare_priority(app, options));
  add_time(app, "timeout-s", options.timeout_s, "end the run after so long without the other side");
  add_switch(app, "json", options.json, "report as one line of JSON");
}

/// How this side signs its messages.
inline WireIdentity identity_of(const CommonOptions& options, const Artifact& artifact) {
  return {options.session, artifact.hash_prefix(), artifact.joints(), options.pace,
          to_nanoseconds(artifact.sample_period_s())};
}

/// The same of a general system.
inline WireIdentity identity_of(const CommonOptions& options, const SystemArtifact& artifact) {
  const SignalCounts counts{static_cast<int>(artifact.states().size()), static_cast<int>(artifact.parameters().size()),
                            static_cast<int>(artifact.inputs().size()), artifact.gain().premises()};
  return {options.session, artifact.hash_prefix(), 0, options.pace, to_nanoseconds(artifact.sample_period_s()), counts};
}

/// Puts the link into authenticated mode if `--key` asks for it. INIT-ONLY. Throws InputError like MessageKey::load().
inline void apply_key(const CommonOptions& options, Link& link) {
  if (!options.key.empty()) {
    link.authenticate_with(MessageKey::load(options.key));
  }
}

/// The file of `--record`, null without; `document` is what the program reads besides the artifact and the key.
/// INIT-ONLY. Throws InputError like OutputFile.
inline std::unique_ptr<OutputFile> open_record(const CommonOptions& options, const std::string& program,
                                               const std::string& document) {
  if (options.record.empty()) {
    return nullptr;
  }
  return std::make_unique<OutputFile>(options.record, "record", program,
                                      std::vector{options.artifact, document, options.key});
}

/// What a run on the same address looks like from here; empty if there is no sign of one.
inline std::string other_run_hint(const Link& link, const std::string& url) {
  const LinkCounters& counted = link.counters();
  if (link.foreign_session()) {
    return std::to_string(counted.wrong_session) + " messages of session " + std::to_string(*link.foreign_session()) +
           " were heard on " + url + ": another run is there; give each a --url with a port of its own";
  }
  if (counted.wrong_artifact > 0) {
    return std::to_string(counted.wrong_artifact) +
           " messages of this session, but about another artifact, were heard on " + url +
           ": give each run a session and a --url with a port of its own";
  }
  if (counted.wrong_length + counted.wrong_type > 0) {
    return std::to_string(counted.wrong_length + counted.wrong_type) +
           " messages of another type or version, or signed " + "by one side only, were heard on " + url;
  }
  return "";
}

/// Warns of another run on the same address, once a run is over.
inline void warn_of_other_run(const std::string& program, const Link& link, const std::string& url) {
  if (const std::string hint = other_run_hint(link, url); !hint.empty()) {
    std::cerr << program << ": warning: " << hint << '\n';
  }
}

/// Throws the TransportError of a run in which the other side was never heard.
[[noreturn]] inline void throw_never_heard(const CommonOptions& options, const Link& link, const std::string& message,
                                           const std::string& other_side) {
  const std::string hint = other_run_hint(link, options.url);
  throw TransportError("no " + message + " of session " + std::to_string(options.session) + " on " + options.url +
                       " within " + format_number(options.timeout_s) + " s: is " + other_side + " running?" +
                       (hint.empty() ? "" : " (" + hint + ")"));
}

/// Throws the InputError of two sides that do not run in the same way.
[[noreturn]] inline void throw_refused(const CommonOptions& options, const Link& link, const std::string& other_side) {
  const auto name = [](Pace pace) { return std::string(pace == Pace::kLockStep ? "lockstep" : "realtime"); };
  const Speaker& other = link.peers().opponent();
  const std::string who = " of " + other_side + " (process " + std::to_string(process_of(other.sender)) + ")";
  if (other.pace != options.pace) {
    throw InputError("command line", "mode", name(options.pace), name(other.pace) + ", the mode" + who);
  }
  throw InputError(options.artifact, "sample_period_s", std::to_string(link.identity().period_ns) + " ns",
                   std::to_string(other.period_ns) + " ns, the sample period" + who);
}

/// Who the second one is, if the reason for an end is that there is one.
inline std::string naming(const std::string& reason, const Link& link) {
  const bool second = reason.rfind("second ", 0) == 0;
  const std::int64_t sender = link.peers().opponent().sender;
  return second && sender != 0 ? reason + " (process " + std::to_string(process_of(sender)) + ")" : reason;
}

/// Says why a run counts as stopped by a fault. Returns its exit code.
inline int report_fault_stop(const std::string& program, const std::string& reason, std::int64_t last_sample) {
  std::cerr << program << ": fault stop: " << reason << ", last sample " << last_sample << '\n';
  return kExitFaultStop;
}

/// No real-time privilege although it was required (exit code 4).
class NoRealtime : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Stays on the core of `--cpu`. INIT-ONLY: before any thread is created. Throws InputError if there is no such core.
inline void apply_cpu(const CommonOptions& options) {
  if (options.cpu >= 0 && !pin_to_cpu(options.cpu)) {
    throw InputError("command line", "cpu", std::to_string(options.cpu), "a core that this process may use");
  }
}

/// Pins the process to a core if `--cpu` asks for it and enters real-time scheduling if `--priority` does; true if all
/// of the latter was granted. Warns once, or throws NoRealtime if it is required; throws InputError if there is no such
/// core. INIT-ONLY: before any thread is created.
inline bool apply_priority(const CLI::App& app, const CommonOptions& options) {
  apply_cpu(options);
  if (options.priority == 0) {
    return false;
  }
  const RealtimeStatus status = enter_realtime(options.priority);
  if (status.complete()) {
    return true;
  }
  const std::string missing =
      std::string(status.fifo ? "" : "SCHED_FIFO ") + (status.memory_locked ? "" : "mlockall ") +
      "not permitted: needs CAP_SYS_NICE and CAP_IPC_LOCK, or rtprio and memlock in limits.conf";
  if (options.require_realtime) {
    throw NoRealtime(missing);
  }
  std::cerr << app.get_name() << ": warning: " << missing << "; running without\n";
  return false;
}

/// Prepares the process, declares the options, parses the command line and runs `body`; every error becomes one line on
/// stderr and its exit code, and so does a report that got lost. Never throws.
inline int run_main(int argc, char** argv, const std::string& name, const std::string& description,
                    const std::function<void(CLI::App&)>& declare_options,
                    const std::function<int(const CLI::App&)>& body) noexcept {
  const auto fail = [&name](const char* what, ExitCode code) {
    std::cerr << name << ": " << on_one_line(what) << '\n';
    return finish_output(name, code);
  };
  try {
    prepare_process();
    CLI::App app(description, name);
    declare_options(app);
    refuse_empty_switch(app, argc, argv);
    try {
      app.parse(argc, argv);
    } catch (const CLI::CallForHelp&) {
      std::cout << app.help();
      return finish_output(name, kExitDone);
    }
    return finish_output(name, body(app));
  } catch (const CLI::ParseError& error) {
    return fail(error.what(), kExitBadInput);
  } catch (const InputError& error) {
    return fail(error.what(), kExitBadInput);
  } catch (const NoRealtime& error) {
    return fail(error.what(), kExitNoRealtime);
  } catch (const TransportError& error) {
    return fail(error.what(), kExitNoTransport);
  } catch (const PlantError& error) {
    return fail(error.what(), kExitPlantFailure);
  } catch (const std::bad_alloc&) {
    return fail("no memory", kExitInternal);
  } catch (const std::exception& error) {
    return fail(error.what(), kExitInternal);
  }
}

}  // namespace quasilpv
