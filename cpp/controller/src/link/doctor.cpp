#include "quasilpv/doctor.hpp"

#include <cmath>
#include <fstream>

#include "quasilpv/controller.hpp"
#include "quasilpv/pacer.hpp"

namespace quasilpv {
namespace {

constexpr double kRare = 0.999;
constexpr std::int64_t kLongestRoundTripNs = 100 * kNanosecondsPerMillisecond;

std::int64_t rare_ns(const std::optional<LatencyHistogram>& histogram) noexcept {
  return histogram ? histogram->quantile_ns(kRare) : 0;
}

const LatencyHistogram& best_wakeup(const DoctorFindings& findings) noexcept {
  return findings.wakeup_fifo ? *findings.wakeup_fifo : findings.wakeup;
}

/// Middle of the domain plus a slow swing over half of it, so that premises and gravity change.
StepInput sample_of(const Artifact& artifact, std::int64_t seq) {
  constexpr double kSwingRadPerSample = 0.01;
  StepInput input;
  input.seq = seq;
  for (std::size_t j = 0; j < static_cast<std::size_t>(artifact.joints()); ++j) {
    const Interval& angle = artifact.domain().angle_rad[j];
    const double swing = std::sin(kSwingRadPerSample * static_cast<double>(seq));
    input.angle[j] = (angle.low + angle.high) / 2.0 + swing * (angle.high - angle.low) / 4.0;
  }
  input.reference.angle = input.angle;
  return input;
}

/// Runs `action` once per period and adds what it returns.
template <class Action>
LatencyHistogram once_per_period(std::int64_t period_ns, std::int64_t samples, Action action) {
  LatencyHistogram histogram;
  Pacer pacer(monotonic_ns(), period_ns);
  for (std::int64_t k = 0; k < samples; ++k) {
    const std::int64_t tick_ns = pacer.next(monotonic_ns());
    sleep_until(tick_ns);
    const std::int64_t duration_ns = action(k, tick_ns);
    if (duration_ns >= 0) {
      histogram.add(duration_ns);
    }
  }
  return histogram;
}

std::string microseconds(std::int64_t ns) { return std::to_string((ns + 500) / 1000) + " us"; }

}  // namespace

const char* to_string(DoctorVerdict verdict) noexcept {
  switch (verdict) {
    case DoctorVerdict::kHolds:
      return "holds the rate";
    case DoctorVerdict::kMarginal:
      return "holds the rate, with little to spare";
    case DoctorVerdict::kFails:
      return "does not hold the rate";
    case DoctorVerdict::kNoTransport:
      return "cannot run: there is no transport";
  }
  return "unknown";
}

DoctorVerdict judge(const DoctorFindings& findings) noexcept {
  if (!findings.transport_error.empty()) {
    return DoctorVerdict::kNoTransport;
  }
  const std::int64_t needed_ns =
      best_wakeup(findings).quantile_ns(kRare) + rare_ns(findings.step) + rare_ns(findings.round_trip);
  if (needed_ns > findings.period_ns) {
    return DoctorVerdict::kFails;
  }
  return 2 * needed_ns > findings.period_ns ? DoctorVerdict::kMarginal : DoctorVerdict::kHolds;
}

std::vector<std::string> advice(const DoctorFindings& findings) {
  std::vector<std::string> sentences;
  if (!findings.transport_error.empty()) {
    sentences.push_back("Controller and plant cannot hear each other: " + findings.transport_error + ".");
  }
  if (!findings.realtime.fifo) {
    sentences.emplace_back(
        "SCHED_FIFO is not permitted: give the program CAP_SYS_NICE (setcap cap_sys_nice,cap_ipc_lock+ep "
        "qlpv-controller) or the user an rtprio line in /etc/security/limits.conf.");
  }
  if (!findings.realtime.memory_locked) {
    sentences.emplace_back(
        "Memory cannot be locked: give the program CAP_IPC_LOCK, or the user an unlimited memlock in "
        "/etc/security/limits.conf.");
  }
  const std::int64_t wakeup_ns = best_wakeup(findings).quantile_ns(kRare);
  if (4 * wakeup_ns > findings.period_ns) {
    sentences.push_back(
        "One wake-up in 1000 is late by " + microseconds(wakeup_ns) +
        (findings.preempt_rt
             ? ": keep other work off its core (isolcpus, --cpu) and disable deep idle states."
             : ": a PREEMPT_RT kernel, a core of its own (isolcpus, --cpu) and no deep idle states help."));
  }
  if (findings.round_trip && 4 * rare_ns(findings.round_trip) > findings.period_ns) {
    sentences.push_back("One LCM round trip in 1000 takes " + microseconds(rare_ns(findings.round_trip)) +
                        ": run a driver in the controller's process (docs/how-to/real-hardware.md) instead of LCM.");
  }
  if (findings.step && 4 * rare_ns(findings.step) > findings.period_ns) {
    sentences.push_back("One control step in 1000 takes " + microseconds(rare_ns(findings.step)) +
                        ": design at a lower rate, or with fewer vertices.");
  }
  return sentences;
}

LatencyHistogram measure_wakeup(std::int64_t period_ns, std::int64_t samples) {
  return once_per_period(period_ns, samples,
                         [](std::int64_t /*k*/, std::int64_t tick_ns) { return monotonic_ns() - tick_ns; });
}

LatencyHistogram measure_step(const Artifact& artifact, std::int64_t samples) {
  Controller controller(artifact);
  return once_per_period(to_nanoseconds(artifact.sample_period_s()), samples,
                         [&](std::int64_t k, std::int64_t /*tick*/) {
                           const StepInput input = sample_of(artifact, k);
                           const std::int64_t start_ns = monotonic_ns();
                           controller.step(input);
                           return monotonic_ns() - start_ns;
                         });
}

LatencyHistogram measure_round_trip(Link& plant, Link& controller, std::int64_t period_ns, std::int64_t samples) {
  return once_per_period(period_ns, samples, [&](std::int64_t k, std::int64_t /*tick*/) -> std::int64_t {
    measurement_v3 measurement{};
    measurement.seq = k;
    command_v2 command{};
    command.seq = k;
    const std::int64_t start_ns = monotonic_ns();
    const auto remaining_ns = [&] { return start_ns + kLongestRoundTripNs - monotonic_ns(); };
    plant.send(measurement);
    while (!(controller.take(measurement) && measurement.seq == k)) {
      if (remaining_ns() <= 0) {
        return -1;
      }
      controller.receive(remaining_ns());
    }
    controller.send(command);
    while (!(plant.take(command) && command.seq == k)) {
      if (remaining_ns() <= 0) {
        return -1;
      }
      plant.receive(remaining_ns());
    }
    return monotonic_ns() - start_ns;
  });
}

bool is_preempt_rt() {
  std::ifstream file("/sys/kernel/realtime");
  char flag = '0';
  return file.get(flag) && flag == '1';
}

}  // namespace quasilpv
