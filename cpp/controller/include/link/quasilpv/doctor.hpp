// Will this machine hold the rate? Measurements, and what they mean in plain words.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "quasilpv/artifact.hpp"
#include "quasilpv/latency_histogram.hpp"
#include "quasilpv/link.hpp"
#include "quasilpv/realtime.hpp"

namespace quasilpv {

/// What was measured. Times in ns.
struct DoctorFindings {
  std::int64_t period_ns = kNanosecondsPerMillisecond;
  LatencyHistogram wakeup;                      ///< grid point to wake-up, normal scheduling
  RealtimeStatus realtime;                      ///< what the system grants
  std::optional<LatencyHistogram> wakeup_fifo;  ///< the same under SCHED_FIFO, if granted
  std::optional<LatencyHistogram> step;         ///< control step, if there is an artifact
  std::optional<LatencyHistogram> round_trip;   ///< measurement sent to command received, if there is a transport
  std::string transport_error;                  ///< why there is none
  bool preempt_rt = false;                      ///< the kernel says that it is a real-time one
};

/// How sure one can be that a sample is answered within its period.
enum class DoctorVerdict {
  kHolds,     ///< 999 of 1000 samples need at most half the period
  kMarginal,  ///< 999 of 1000 need at most the period
  kFails,     ///< more than one in 1000 is late
  kNoTransport
};

/// Verdict in words.
const char* to_string(DoctorVerdict verdict) noexcept;

/// p99.9 of wake-up, step and round trip added up (they may well be late together) against the period; the wake-up
/// under SCHED_FIFO if that is granted. What was not measured counts as 0, but for a missing transport.
DoctorVerdict judge(const DoctorFindings& findings) noexcept;

/// One sentence for each thing worth changing; empty if there is none.
std::vector<std::string> advice(const DoctorFindings& findings);

/// Wakes up on `samples` points of the grid. RT-UNSAFE (sleeps), as the next two.
LatencyHistogram measure_wakeup(std::int64_t period_ns, std::int64_t samples);

/// Steps of the artifact's law, one per period as in a run, so with the caches as cold as they are there; the reference
/// and the angles move through the operating domain.
LatencyHistogram measure_step(const Artifact& artifact, std::int64_t samples);

/// Measurements sent from `plant` to `controller`, each answered by a command. What does not come back within 100 ms is
/// left out.
LatencyHistogram measure_round_trip(Link& plant, Link& controller, std::int64_t period_ns, std::int64_t samples);

/// Whether the running kernel is a PREEMPT_RT one.
bool is_preempt_rt();

}  // namespace quasilpv
