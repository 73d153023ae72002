// The plant's side of a run over a link.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>

#include "quasilpv/failsafe.hpp"
#include "quasilpv/latency_histogram.hpp"
#include "quasilpv/link.hpp"
#include "quasilpv/pacer.hpp"
#include "quasilpv/plant_session.hpp"
#include "quasilpv/record.hpp"
#include "quasilpv/scenario.hpp"
#include "quasilpv/system_session.hpp"

namespace quasilpv {

struct PlantRunSettings {
  Pace pace = Pace::kLockStep;
  double timeout_s = 10.0;                    ///< without any command: end of the run
  double hold_s = 0.02;                       ///< real time: the last torque stays in force for at most this long
  JointArray brake_nm_s{};                    ///< watchdog's viscous brake per joint, N m s/rad; viscous_brake()
  std::optional<JointArray> torque_limit_nm;  ///< no controller of this run commands more: what does is refused
};

/// How a run ended.
enum class PlantRunEnd {
  kCompleted,
  kStopped,               ///< SIGINT or SIGTERM
  kControllerEnded,       ///< lock-step: the controller said it leaves
  kStartRefused,          ///< the controller does not start where the plant begins, and said so
  kControllerSilent,      ///< no command for `timeout_s`
  kCommandsRefused,       ///< commands, but for `timeout_s` none that may act
  kControllerNeverHeard,  ///< no command at all
  kSecondPlant,           ///< another plant speaks in this session
  kSecondController,      ///< two controllers speak in this session
  kRefused                ///< the controller runs in another way; Link::peers() says how
};

const char* to_string(PlantRunEnd end) noexcept;

struct PlantRunReport {
  PlantRunEnd end = PlantRunEnd::kCompleted;
  std::int64_t samples = 0;           ///< integrated
  std::int64_t repeated = 0;          ///< measurements sent again
  std::int64_t missed_commands = 0;   ///< real time: samples that ended without their command
  std::int64_t late_commands = 0;     ///< real time: commands that arrived in a later sample, and acted from there
  std::int64_t refused_commands = 0;  ///< not finite, or beyond the limits: treated as if they had not come
  std::string refusal;                ///< what was wrong with the last one of them
  std::int64_t watchdog_samples = 0;  ///< real time: samples under the watchdog's brake
  bool watchdog_at_end = false;       ///< the last sample was one of them
  std::int64_t overruns = 0;          ///< real time: samples this process did not finish in time
  std::int64_t skipped_ticks = 0;     ///< grid points skipped for it: the plant's clock stood still
  std::int64_t stalls = 0;            ///< real time: it did not run for longer than `hold_s`, and braked for a sample
  ControllerState controller_state = ControllerState::kInit;  ///< of the last command
  LatencyHistogram wakeup;                                    ///< real time: grid point to wake-up
  LatencyHistogram round_trip;  ///< measurement sent to its command received; from sample 1 on
};

/// Viscous coefficient per joint that, alone, would stop the joint with the given time constant at the scenario's
/// initial posture: b_j = 1 / (time_constant * d(acceleration_j)/d(torque_j)). INIT-ONLY. Throws PlantError like
/// Plant::sample().
JointArray viscous_brake(const Scenario& scenario, double time_constant_s);

/// Runs the plant to the end of its scenario over a link (docs/reference/messages.md). Both modes begin in lock-step:
/// measurement 0 is repeated every 50 ms until the controller answers.
///
/// Lock-step: sample k is integrated after command k arrived, with the scenario's delay: the same calls, in the same
/// order, as run_closed_loop().
///
/// Real time: sample k begins at the first free point of the grid, command k acts from the moment it arrives (measured
/// from the measurement's departure), a late one from its arrival in a later sample; of two that arrive in one sample
/// the newer one acts. After `hold_s` of plant time without a command the watchdog applies -brake_nm_s * speed, taken
/// per sample. Wall time that this process misses (its tick comes late) passes for the controller, not for the plant;
/// after more than `hold_s` of it the sample is braked.
///
/// A command that is not finite or beyond `torque_limit_nm` is refused and counted: it never acts.
///
/// RT-UNSAFE. Throws PlantError like PlantSession::advance(); the controller is told that the run is over either way.
///
/// @param record  gets `seq`, `time_s`, the columns of PlantColumns, `torque_nm` (the command, or what stands in for
/// it)
///                and `command_delay_s` (-1: no command in this sample); may be null
/// @param stop    set by a signal handler or another thread
PlantRunReport run_plant(PlantSession& session, Link& link, const PlantRunSettings& settings, Record* record,
                         const std::atomic<bool>& stop);

/// The same of a general system. A command that is not finite or beyond the limits of an input is refused; the watchdog
/// applies the trim input, or the limit next to it. A system that leaves its domain says so (EventCode::kLeftDomain)
/// and ends the run.
///
/// @param record  gets `seq`, `time_s`, `state.NAME` of every state (the truth), `input.NAME` of every input and
///                `command_delay_s`; may be null
PlantRunReport run_plant(SystemSession& session, Link& link, const PlantRunSettings& settings, Record* record,
                         const std::atomic<bool>& stop);

}  // namespace quasilpv
