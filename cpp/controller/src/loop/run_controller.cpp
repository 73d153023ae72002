#include "quasilpv/run_controller.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "quasilpv/realtime.hpp"

namespace quasilpv {
namespace {

constexpr std::int64_t kLongestWaitNs = 10 * kNanosecondsPerMillisecond;
constexpr std::int64_t kLongestStopNs = 100 * kNanosecondsPerMillisecond;

template <class Loop, class Port>
class ControllerRun {
 public:
  ControllerRun(Loop& loop, Port& port, const ControllerRunSettings& settings)
      : loop_(loop),
        port_(port),
        settings_(settings),
        period_ns_(to_nanoseconds(loop.sample_period_s())),
        silence_ns_(to_nanoseconds(settings.silence_s)),
        timeout_ns_(to_nanoseconds(settings.timeout_s)),
        last_heard_ns_(monotonic_ns()) {}

  ControllerRunReport run(const std::atomic<bool>& stop) noexcept {
    port_.announce(ControllerNews::kStarted, 0, FaultCause::kNone);
    std::optional<ControllerRunEnd> end;
    while (!end) {
      typename Loop::Reading reading{};
      const bool read = port_.read(reading, wait_ns());
      now_ns_ = monotonic_ns();
      if (stop.load(std::memory_order_relaxed) && !stop_since_ns_) {
        stop_since_ns_ = now_ns_;
      }
      notice(port_.take_fault());
      answer_silence();  // first: a reading that ends a silence, as after a stop of both sides, must not hide it
      if (read) {
        answer(reading);
      }
      end = find_end();
    }
    notice(port_.take_fault());
    if (!loop_.started() && report_.robot_fault != FaultCause::kNone) {
      port_.announce(ControllerNews::kFault, 0, report_.robot_fault);  // no sample will say so
    }
    port_.announce(ControllerNews::kEnded, loop_.last_seq(), loop_.cause());
    report_.end = *end;
    return report_;
  }

 private:
  bool is_real_time() const noexcept { return settings_.pace == Pace::kRealTime; }

  // Simulated time in lock-step: the fail-safe policy must not depend on how fast this machine is.
  std::int64_t policy_clock(std::int64_t seq) const noexcept { return is_real_time() ? now_ns_ : seq * period_ns_; }

  SampleConditions conditions(std::int64_t seq) noexcept {
    return {policy_clock(seq), consecutive_overruns_, port_.take_longest_foreign_run(), stop_since_ns_.has_value(),
            std::exchange(demanded_, FaultCause::kNone)};
  }

  void notice(FaultCause fault) noexcept {
    if (fault != FaultCause::kNone) {
      demanded_ = report_.robot_fault = fault;
    }
  }

  std::int64_t wait_ns() const noexcept {
    if (!is_real_time() || !loop_.started()) {
      return kLongestWaitNs;
    }
    const std::int64_t until = silent_pacer_ ? silent_pacer_->tick_ns() : last_heard_ns_ + silence_ns_;
    return std::clamp<std::int64_t>(until - monotonic_ns(), 0, kLongestWaitNs);
  }

  void answer(const typename Loop::Reading& reading) noexcept {
    last_heard_ns_ = now_ns_;
    silent_pacer_.reset();
    if (loop_.is_new(reading.seq)) {
      report_.arrival.add(now_ns_ - reading.taken_ns);
      loop_.handle(reading, conditions(reading.seq));
      if (loop_.has_refused()) {
        return;
      }
      send_command();
      count_overrun();
    } else if (!is_real_time() && reading.seq == loop_.last_seq()) {
      port_.write(loop_.command());
      ++report_.commands;
      ++report_.repeated;
    }
  }

  // The path of the measurements may be broken while that of the commands is not: keep commanding what is safe.
  void answer_silence() noexcept {
    if (!is_real_time() || !loop_.started() || now_ns_ - last_heard_ns_ < silence_ns_) {
      return;
    }
    if (!silent_pacer_) {
      silent_pacer_.emplace(now_ns_, period_ns_);
    }
    if (now_ns_ >= silent_pacer_->tick_ns()) {
      loop_.handle_silence(conditions(loop_.last_seq() + 1));
      send_command();
      silent_pacer_->next(now_ns_);
    }
  }

  void send_command() noexcept {
    port_.write(loop_.command());
    ++report_.commands;
    if (loop_.faults() > faults_announced_) {
      faults_announced_ = loop_.faults();
      port_.announce(ControllerNews::kFault, loop_.last_seq(), loop_.cause());
    }
  }

  void count_overrun() noexcept {
    const std::int64_t response_ns = monotonic_ns() - now_ns_;
    report_.response.add(response_ns);
    if (is_real_time() && response_ns > period_ns_) {
      ++report_.deadline_overruns;
      ++consecutive_overruns_;
    } else {
      consecutive_overruns_ = 0;
    }
  }

  std::optional<ControllerRunEnd> find_end() noexcept {
    if (loop_.has_refused()) {
      return ControllerRunEnd::kStartRefused;
    }
    const RobotRequest request = port_.take_request();
    if (request == RobotRequest::kEnd) {
      return ControllerRunEnd::kPlantEnded;
    }
    if (request == RobotRequest::kRefuse) {
      return ControllerRunEnd::kRefused;
    }
    if (!loop_.started() && report_.robot_fault != FaultCause::kNone) {
      return ControllerRunEnd::kFault;
    }
    if (request == RobotRequest::kResetFault) {
      report_.resets += loop_.reset_fault() ? 1 : 0;
    }
    const bool safe = loop_.started() && loop_.is_safe(policy_clock(loop_.last_seq()));
    if (stop_since_ns_ && (safe || !loop_.started() || now_ns_ - *stop_since_ns_ > kLongestStopNs)) {
      return ControllerRunEnd::kStopped;
    }
    if (settings_.exit_on_fault && safe) {
      return ControllerRunEnd::kFault;
    }
    if (now_ns_ - last_heard_ns_ > timeout_ns_) {
      return loop_.started() ? ControllerRunEnd::kPlantSilent : ControllerRunEnd::kPlantNeverHeard;
    }
    return std::nullopt;
  }

  Loop& loop_;
  Port& port_;
  ControllerRunSettings settings_;
  std::int64_t period_ns_;
  std::int64_t silence_ns_;
  std::int64_t timeout_ns_;
  std::int64_t last_heard_ns_;
  std::int64_t now_ns_ = 0;
  std::int64_t consecutive_overruns_ = 0;
  FaultCause demanded_ = FaultCause::kNone;
  std::optional<std::int64_t> stop_since_ns_;
  std::optional<Pacer> silent_pacer_;
  std::int64_t faults_announced_ = 0;
  ControllerRunReport report_;
};

}  // namespace

const char* to_string(ControllerRunEnd end) noexcept {
  switch (end) {
    case ControllerRunEnd::kPlantEnded:
      return "plant ended";
    case ControllerRunEnd::kStopped:
      return "stopped";
    case ControllerRunEnd::kFault:
      return "fault";
    case ControllerRunEnd::kRefused:
      return "refused";
    case ControllerRunEnd::kStartRefused:
      return "start refused";
    case ControllerRunEnd::kPlantSilent:
      return "plant silent";
    case ControllerRunEnd::kPlantNeverHeard:
      return "plant never heard";
  }
  return "unknown";
}

ControllerRunReport run_controller(ControlLoop& loop, Robot& robot, const ControllerRunSettings& settings,
                                   const std::atomic<bool>& stop) noexcept {
  return ControllerRun(loop, robot, settings).run(stop);
}

ControllerRunReport run_controller(SystemLoop& loop, SystemPort& system, const ControllerRunSettings& settings,
                                   const std::atomic<bool>& stop) noexcept {
  return ControllerRun(loop, system, settings).run(stop);
}

}  // namespace quasilpv
