// What the command lines of both executables share. Only their main files include this (it needs CLI11).
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <iostream>
#include <map>
#include <string>

#include "quasilpv/artifact.hpp"
#include "quasilpv/errors.hpp"
#include "quasilpv/lcm_link.hpp"
#include "quasilpv/pacer.hpp"
#include "quasilpv/realtime.hpp"
#include "quasilpv/run_report.hpp"

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
inline std::string help_footer(const std::string& more_exit_codes = "") {
  return "Example:\n"
         "  qlpv-controller --artifact artifact.json --trajectory trajectory.json --session 7 --record controller.csv "
         "&\n"
         "  qlpv-simulator --artifact artifact.json --scenario scenario.json --session 7 --record plant.csv\n\n"
         "Exit codes: 0 done, 2 bad input, 3 fault stop, 4 no real-time privilege, 5 no transport" +
         more_exit_codes + ".";
}

inline void declare_identity(CLI::App& app, CommonOptions& options) {
  app.add_option("--artifact", options.artifact, "the controller, JSON or CBOR")->required();
  app.add_option("--session", options.session, "a number of your choice, the same on both sides")->required();
  app.add_option("--key", options.key,
                 "sign messages, and accept signed ones only: a file of mode 0600 with the secret");
}

inline void declare_transport(CLI::App& app, CommonOptions& options) {
  app.add_option("--url", options.url, "LCM address")->capture_default_str();
  app.add_flag("--allow-network", options.allow_network,
               "accept a url with ttl > 0; without --key messages are not authenticated");
}

inline CLI::Option* declare_priority(CLI::App& app, CommonOptions& options) {
  app.add_option("--cpu", options.cpu, "stay on this core, 0, 1, ...")->check(CLI::NonNegativeNumber.description(""));
  return app.add_option("--priority", options.priority, "lock memory and use SCHED_FIFO with this priority, 1..99")
      ->check(CLI::Range(1, 99).description(""));
}

inline void declare(CLI::App& app, CommonOptions& options) {
  static const std::map<std::string, Pace> kPaces{{"lockstep", Pace::kLockStep}, {"realtime", Pace::kRealTime}};
  declare_identity(app, options);
  declare_transport(app, options);
  app.add_option("--record", options.record, "write every sample to this CSV file");
  app.add_option("--mode", options.pace, "lockstep (default) or realtime")
      ->transform(CLI::CheckedTransformer(kPaces, CLI::ignore_case).description(""));
  app.add_flag("--require-rt", options.require_realtime, "exit 4 if --priority cannot be had")
      ->needs(declare_priority(app, options));
  app.add_option("--timeout-s", options.timeout_s, "end the run after so long without the other side")
      ->check(CLI::PositiveNumber.description(""))
      ->capture_default_str();
  app.add_flag("--json", options.json, "report as one line of JSON");
}

/// How this side signs its messages.
inline WireIdentity identity_of(const CommonOptions& options, const Artifact& artifact) {
  return {options.session, artifact.hash_prefix(), artifact.joints(), options.pace,
          to_nanoseconds(artifact.sample_period_s())};
}

/// Puts the link into authenticated mode if `--key` asks for it. INIT-ONLY. Throws InputError like MessageKey::load().
inline void apply_key(const CommonOptions& options, Link& link) {
  if (!options.key.empty()) {
    link.authenticate_with(MessageKey::load(options.key));
  }
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
                       " within " + std::to_string(options.timeout_s) + " s: is " + other_side + " running?" +
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

/// Declares the options, parses the command line and runs `body`; every error becomes one line on stderr and its exit
/// code. Never throws.
inline int run_main(int argc, char** argv, const std::string& name, const std::string& description,
                    const std::function<void(CLI::App&)>& declare_options,
                    const std::function<int(const CLI::App&)>& body) noexcept {
  const auto fail = [&name](const char* what, ExitCode code) {
    std::cerr << name << ": " << what << '\n';
    return static_cast<int>(code);
  };
  try {
    CLI::App app(description, name);
    declare_options(app);
    try {
      app.parse(argc, argv);
    } catch (const CLI::CallForHelp&) {
      std::cout << app.help();
      return kExitDone;
    }
    return body(app);
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
  } catch (const std::exception& error) {
    return fail(error.what(), kExitInternal);
  }
}

}  // namespace quasilpv
