// The plant's side of a run over a link, whatever is measured and commanded.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "quasilpv/pacer.hpp"
#include "quasilpv/plant_loop.hpp"
#include "quasilpv/realtime.hpp"
#include "quasilpv/watchdog.hpp"

namespace quasilpv {

inline constexpr double kNoCommand = -1.0;

/// @tparam Side  what is measured and commanded:
///  * `Command`, the message that acts; `Values`, what it asks for
///  * `samples()`, `seq()`, `sample_period_s()` of its session
///  * `measurement()`, the message of the current sample
///  * `values(command)`, and `refusal(command)`: why it must not act, empty if it may
///  * `in_force()`, `brake()`: what acts without a command, before and after the watchdog takes over
///  * `append(values, delay_s)` to the record, if there is one
///  * `advance(values)` with the delay of the scenario, `advance(values, delay_s)` with that of the command
///  * `announce(link)`: what else is to be said before the end
template <class Side>
class PlantRun {
 public:
  PlantRun(Side& side, Link& link, const PlantRunSettings& settings, const std::atomic<bool>& stop)
      : side_(side),
        link_(link),
        settings_(settings),
        stop_(stop),
        period_ns_(to_nanoseconds(side.sample_period_s())),
        timeout_ns_(to_nanoseconds(settings.timeout_s)),
        watchdog_(to_nanoseconds(settings.hold_s), period_ns_),
        last_heard_ns_(monotonic_ns()) {}

  PlantRunReport run() {
    struct SayGoodbye {
      PlantRun& run;
      ~SayGoodbye() { run.say_goodbye(); }
    } goodbye{*this};
    link_.send(EventCode::kStarted, 0);
    if (lock_step_sample() && settings_.pace == Pace::kRealTime) {
      run_real_time();
    } else {
      while (!end_ && !is_complete() && !must_end() && lock_step_sample()) {
      }
    }
    report_.samples = side_.seq();
    report_.end = end_.value_or(PlantRunEnd::kCompleted);
    return report_;
  }

 private:
  using Command = typename Side::Command;

  static constexpr std::int64_t kRepeatPeriodNs = 50 * kNanosecondsPerMillisecond;
  static constexpr std::int64_t kLongestWaitNs = 10 * kNanosecondsPerMillisecond;

  /// What acts on one sample and when it begins to, s after the sample's start.
  struct Acting {
    typename Side::Values values{};
    double delay_s = kNoCommand;
  };

  void say_goodbye() noexcept {
    // Without an end, and incomplete: the plant could not be integrated.
    FaultCause cause = end_ || is_complete() ? FaultCause::kNone : FaultCause::kPlantFailed;
    if (end_ == PlantRunEnd::kSecondController) {
      cause = FaultCause::kSecondController;
    } else if (end_ == PlantRunEnd::kSecondPlant) {
      link_.send(EventCode::kFault, side_.seq(), static_cast<std::int64_t>(FaultCause::kSecondPlant));
    }
    side_.announce(link_);
    link_.send(EventCode::kEnded, side_.seq(), static_cast<std::int64_t>(cause));
  }

  bool is_complete() const { return side_.seq() >= side_.samples(); }

  void send_measurement() {
    sent_ns_ = monotonic_ns();
    link_.send(side_.measurement());
  }

  /// Newest command not seen before, if it may act; notes who is alive.
  bool take_command(Command& command) {
    if (link_.peers().takeovers() != takeovers_) {
      takeovers_ = link_.peers().takeovers();
      last_command_seq_ = -1;  // a successor does not know how far the one before it went
    }
    if (!link_.take(command) || command.seq <= last_command_seq_ || is_refused(command)) {
      return false;
    }
    last_command_seq_ = command.seq;
    last_heard_ns_ = monotonic_ns();
    report_.controller_state = static_cast<ControllerState>(command.state);
    return true;
  }

  bool is_refused(const Command& command) {
    std::string refusal = side_.refusal(command);
    if (refusal.empty()) {
      return false;
    }
    ++report_.refused_commands;
    report_.refusal = std::move(refusal);
    return true;
  }

  /// Sets the end of the run if it is due.
  bool must_end() {
    event_v2 event;
    if (stop_.load(std::memory_order_relaxed)) {
      end_ = PlantRunEnd::kStopped;
    } else if (const Conflict conflict = link_.peers().take_conflict(); conflict != Conflict::kNone) {
      end_ = end_by(conflict);
    } else if (link_.take(event) && event.code == static_cast<std::int32_t>(EventCode::kEnded)) {
      end_ = end_by(event);
    }
    if (end_) {
      return true;
    }
    if (monotonic_ns() - last_heard_ns_ > timeout_ns_) {
      end_ = report_.refused_commands > 0 ? PlantRunEnd::kCommandsRefused
             : last_command_seq_ < 0      ? PlantRunEnd::kControllerNeverHeard
                                          : PlantRunEnd::kControllerSilent;
    }
    return end_.has_value();
  }

  /// In real time another controller may follow one that leaves, but none will start where one has refused to.
  std::optional<PlantRunEnd> end_by(const event_v2& ended) const noexcept {
    if (last_command_seq_ < 0 && ended.detail[0] == static_cast<std::int64_t>(FaultCause::kStartRefused)) {
      return PlantRunEnd::kStartRefused;
    }
    return settings_.pace == Pace::kLockStep ? std::optional(PlantRunEnd::kControllerEnded) : std::nullopt;
  }

  static PlantRunEnd end_by(Conflict conflict) noexcept {
    switch (conflict) {
      case Conflict::kSecondPlant:
        return PlantRunEnd::kSecondPlant;
      case Conflict::kSecondController:
        return PlantRunEnd::kSecondController;
      default:
        return PlantRunEnd::kRefused;
    }
  }

  /// One sample of simulated time; false if the run ended instead.
  bool lock_step_sample() {
    send_measurement();
    const std::int64_t first_sent_ns = sent_ns_;
    Command command;
    while (true) {
      link_.receive(std::min(kLongestWaitNs, kRepeatPeriodNs));
      if (take_command(command) && command.seq == side_.seq()) {
        break;
      }
      if (must_end()) {
        return false;
      }
      if (monotonic_ns() - sent_ns_ >= kRepeatPeriodNs) {
        send_measurement();
        ++report_.repeated;
      }
    }
    if (side_.seq() > 0) {  // the first answer waits for the controller to start
      report_.round_trip.add(monotonic_ns() - first_sent_ns);
    }
    finish_sample(Acting{side_.values(command), 0.0}, /*scenario_delay=*/true);
    return true;
  }

  void run_real_time() {
    Pacer pacer(monotonic_ns(), period_ns_);
    sent_ns_ = monotonic_ns();
    while (!end_ && !is_complete()) {
      const std::int64_t tick_ns = pacer.next(monotonic_ns());
      sleep_until(tick_ns);
      report_.wakeup.add(monotonic_ns() - tick_ns);
      const std::int64_t last_sent_ns = sent_ns_;
      send_measurement();
      stalled_ = sent_ns_ - last_sent_ns > period_ns_ + to_nanoseconds(settings_.hold_s);
      const Acting sample = wait_for_command();
      if (!must_end()) {
        finish_sample(guard(sample), /*scenario_delay=*/false);
      }
    }
    report_.overruns = pacer.overruns();
    report_.skipped_ticks = pacer.skipped_ticks();
  }

  /// The sample begins when its measurement leaves, not at the grid point: a late wake-up must not cost the controller
  /// time.
  Acting wait_for_command() {
    const std::int64_t seq = side_.seq();
    const std::int64_t deadline_ns = sent_ns_ + period_ns_;
    Acting sample{side_.in_force(), kNoCommand};
    Command command;
    for (std::int64_t now_ns = monotonic_ns(); now_ns < deadline_ns; now_ns = monotonic_ns()) {
      link_.receive(std::min(deadline_ns - now_ns, kLongestWaitNs));
      if (!take_command(command)) {
        continue;
      }
      const std::int64_t delay_ns = std::min(monotonic_ns() - sent_ns_, period_ns_);
      sample = {side_.values(command), static_cast<double>(delay_ns) / static_cast<double>(kNanosecondsPerSecond)};
      if (command.seq >= seq) {
        report_.round_trip.add(monotonic_ns() - sent_ns_);
        return sample;
      }
      ++report_.late_commands;
    }
    ++report_.missed_commands;
    return sample;
  }

  /// What acts on the sample if no command arrived.
  Acting guard(const Acting& sample) {
    report_.watchdog_at_end = false;
    if (stalled_) {
      ++report_.stalls;
      watchdog_.stalled();
    } else if (sample.delay_s != kNoCommand) {
      watchdog_.command_at(to_nanoseconds(sample.delay_s));
      return sample;
    }
    if (!watchdog_.takes_over()) {
      return sample;
    }
    link_.peers().release();
    ++report_.watchdog_samples;
    report_.watchdog_at_end = true;
    return {side_.brake(), kNoCommand};
  }

  void finish_sample(const Acting& sample, bool scenario_delay) {
    side_.append(sample.values, sample.delay_s);
    if (scenario_delay) {
      side_.advance(sample.values);
    } else {
      side_.advance(sample.values, std::max(sample.delay_s, 0.0));
    }
  }

  Side& side_;
  Link& link_;
  PlantRunSettings settings_;
  const std::atomic<bool>& stop_;
  std::int64_t period_ns_;
  std::int64_t timeout_ns_;
  Watchdog watchdog_;
  std::int64_t last_heard_ns_;
  std::int64_t sent_ns_ = 0;
  std::int64_t last_command_seq_ = -1;
  std::int64_t takeovers_ = 0;
  bool stalled_ = false;
  std::optional<PlantRunEnd> end_;
  PlantRunReport report_;
};

}  // namespace quasilpv
