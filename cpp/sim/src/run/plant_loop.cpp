#include "quasilpv/plant_loop.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>

#include "quasilpv/decimal.hpp"
#include "quasilpv/limiter.hpp"
#include "quasilpv/realtime.hpp"
#include "quasilpv/run_columns.hpp"
#include "quasilpv/watchdog.hpp"

namespace quasilpv {
namespace {

constexpr std::int64_t kRepeatPeriodNs = 50 * kNanosecondsPerMillisecond;
constexpr std::int64_t kLongestWaitNs = 10 * kNanosecondsPerMillisecond;
constexpr double kNoCommand = -1.0;

JointArray to_array(const double (&source)[kMaxJoints]) {
  JointArray target;
  std::copy(std::begin(source), std::end(source), target.begin());
  return target;
}

/// Torque of one sample and when it begins to act, s after the sample's start.
struct SampleTorque {
  JointArray torque{};
  double delay_s = kNoCommand;
};

class RunColumns {
 public:
  RunColumns(Record& record, const PlantSession& session)
      : record_(record),
        seq_(record.add_column("seq")),
        time_(record.add_column("time_s")),
        plant_(record, session.joints(), session.truth().motors.has_value()),
        torque_(record.add_column("torque_nm", static_cast<std::size_t>(session.joints()))),
        delay_(record.add_column("command_delay_s")) {
    record.reserve(static_cast<std::size_t>(session.samples()));
  }

  void append(const PlantSession& session, const SampleTorque& sample) {
    record_.append(seq_, static_cast<double>(session.seq()));
    record_.append(time_, static_cast<double>(session.seq()) * session.sample_period_s());
    plant_.append(session.truth());
    record_.append(torque_, sample.torque);
    record_.append(delay_, sample.delay_s);
  }

 private:
  Record& record_;
  std::size_t seq_, time_;
  PlantColumns plant_;
  std::size_t torque_, delay_;
};

class PlantRun {
 public:
  PlantRun(PlantSession& session, Link& link, const PlantRunSettings& settings, Record* record,
           const std::atomic<bool>& stop)
      : session_(session),
        link_(link),
        settings_(settings),
        stop_(stop),
        period_ns_(to_nanoseconds(session.sample_period_s())),
        timeout_ns_(to_nanoseconds(settings.timeout_s)),
        watchdog_(to_nanoseconds(settings.hold_s), period_ns_),
        last_heard_ns_(monotonic_ns()) {
    if (record != nullptr) {
      columns_.emplace(*record, session);
    }
  }

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
    report_.samples = session_.seq();
    report_.end = end_.value_or(PlantRunEnd::kCompleted);
    return report_;
  }

 private:
  void say_goodbye() noexcept {
    // Without an end, and incomplete: the plant could not be integrated.
    FaultCause cause = end_ || is_complete() ? FaultCause::kNone : FaultCause::kPlantFailed;
    if (end_ == PlantRunEnd::kSecondController) {
      cause = FaultCause::kSecondController;
    } else if (end_ == PlantRunEnd::kSecondPlant) {
      link_.send(EventCode::kFault, session_.seq(), static_cast<std::int64_t>(FaultCause::kSecondPlant));
    }
    link_.send(EventCode::kEnded, session_.seq(), static_cast<std::int64_t>(cause));
  }

  bool is_complete() const { return session_.seq() >= session_.samples(); }

  void send_measurement() {
    const Measurement& measured = session_.measure(session_.seq());
    measurement_v3 message{};
    message.seq = measured.seq;
    std::copy(measured.angle.begin(), measured.angle.end(), message.angle_rad);
    std::copy(measured.speed.begin(), measured.speed.end(), message.speed_rad_s);
    set_gears(measured.gears, message);
    sent_ns_ = monotonic_ns();
    link_.send(message);
  }

  /// Newest command not seen before, if it may act; notes who is alive.
  bool take_command(command_v2& command) {
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

  bool is_refused(const command_v2& command) {
    for (std::size_t j = 0; j < static_cast<std::size_t>(session_.joints()); ++j) {
      const double torque = command.torque_nm[j];
      const double limit = settings_.torque_limit_nm ? (*settings_.torque_limit_nm)[j] : kLargestTorqueNm;
      if (!(std::abs(torque) <= limit)) {  // NaN is not
        ++report_.refused_commands;
        report_.refusal = "torque_nm[" + std::to_string(j) + "] of sample " + std::to_string(command.seq) + " is " +
                          format_number(torque) + ", beyond " + format_number(limit);
        return true;
      }
    }
    return false;
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
    command_v2 command;
    while (true) {
      link_.receive(std::min(kLongestWaitNs, kRepeatPeriodNs));
      if (take_command(command) && command.seq == session_.seq()) {
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
    if (session_.seq() > 0) {  // the first answer waits for the controller to start
      report_.round_trip.add(monotonic_ns() - first_sent_ns);
    }
    finish_sample(SampleTorque{to_array(command.torque_nm), 0.0}, /*scenario_delay=*/true);
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
      const SampleTorque sample = wait_for_command();
      if (!must_end()) {
        finish_sample(guard(sample), /*scenario_delay=*/false);
      }
    }
    report_.overruns = pacer.overruns();
    report_.skipped_ticks = pacer.skipped_ticks();
  }

  /// The sample begins when its measurement leaves, not at the grid point: a late wake-up must not cost the controller
  /// time.
  SampleTorque wait_for_command() {
    const std::int64_t seq = session_.seq();
    const std::int64_t deadline_ns = sent_ns_ + period_ns_;
    SampleTorque sample{session_.torque(), kNoCommand};
    command_v2 command;
    for (std::int64_t now_ns = monotonic_ns(); now_ns < deadline_ns; now_ns = monotonic_ns()) {
      link_.receive(std::min(deadline_ns - now_ns, kLongestWaitNs));
      if (!take_command(command)) {
        continue;
      }
      const std::int64_t delay_ns = std::min(monotonic_ns() - sent_ns_, period_ns_);
      sample = {to_array(command.torque_nm),
                static_cast<double>(delay_ns) / static_cast<double>(kNanosecondsPerSecond)};
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
  SampleTorque guard(const SampleTorque& sample) {
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
    SampleTorque brake{{}, kNoCommand};
    for (std::size_t j = 0; j < static_cast<std::size_t>(session_.joints()); ++j) {
      brake.torque[j] = -settings_.brake_nm_s[j] * session_.truth().driven_speed()[j];
    }
    return brake;
  }

  void finish_sample(const SampleTorque& sample, bool scenario_delay) {
    if (columns_) {
      columns_->append(session_, sample);
    }
    if (scenario_delay) {
      session_.advance(session_.seq(), sample.torque);
    } else {
      session_.advance(session_.seq(), sample.torque, std::max(sample.delay_s, 0.0));
    }
  }

  PlantSession& session_;
  Link& link_;
  PlantRunSettings settings_;
  const std::atomic<bool>& stop_;
  std::optional<RunColumns> columns_;
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

}  // namespace

const char* to_string(PlantRunEnd end) noexcept {
  switch (end) {
    case PlantRunEnd::kCompleted:
      return "completed";
    case PlantRunEnd::kStopped:
      return "stopped";
    case PlantRunEnd::kControllerEnded:
      return "controller ended";
    case PlantRunEnd::kStartRefused:
      return "start refused by the controller";
    case PlantRunEnd::kControllerSilent:
      return "controller silent";
    case PlantRunEnd::kCommandsRefused:
      return "commands refused";
    case PlantRunEnd::kControllerNeverHeard:
      return "controller never heard";
    case PlantRunEnd::kSecondPlant:
      return "second plant on this session";
    case PlantRunEnd::kSecondController:
      return "second controller on this session";
    case PlantRunEnd::kRefused:
      return "refused";
  }
  return "unknown";
}

JointArray viscous_brake(const Scenario& scenario, double time_constant_s) {
  const std::unique_ptr<Plant> plant = scenario.make_plant();
  const Eigen::VectorXd state = plant->initial_state(scenario.initial_angle, scenario.initial_speed);
  const JointArray without_torque = plant->sample(0.0, state).driven_acceleration();
  JointArray brake{};
  for (std::size_t j = 0; j < static_cast<std::size_t>(plant->joints()); ++j) {
    JointArray unit{};
    unit[j] = 1.0;
    plant->set_torque(unit);
    const double mobility = plant->sample(0.0, state).driven_acceleration()[j] - without_torque[j];
    brake[j] = 1.0 / (time_constant_s * mobility);
  }
  return brake;
}

PlantRunReport run_plant(PlantSession& session, Link& link, const PlantRunSettings& settings, Record* record,
                         const std::atomic<bool>& stop) {
  return PlantRun(session, link, settings, record, stop).run();
}

}  // namespace quasilpv
