#include "quasilpv/lossy_robot.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <random>
#include <utility>

#include "quasilpv/errors.hpp"
#include "quasilpv/realtime.hpp"

namespace quasilpv {
namespace {

constexpr double kReorderingPeriods = 1.5;
constexpr double kLongestJitterPeriods = 0.5;  // a longer one would reorder by itself
constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();

void require_within(const std::string& field, double value, double high) {
  if (!(value >= 0.0 && value <= high)) {
    throw InputError("wire faults", field, std::to_string(value), "0 to " + std::to_string(high));
  }
}

WireFaults checked(const WireFaults& faults) {
  require_within("loss", faults.loss, 1.0);
  require_within("duplication", faults.duplication, 1.0);
  require_within("reordering", faults.reordering, 1.0);
  require_within("jitter_periods", faults.jitter_periods, kLongestJitterPeriods);
  return faults;
}

}  // namespace

/// One direction: packets on their way, in the order of their arrival.
class LossyRobot::Wire {
 public:
  struct Parcel {
    Channel channel = Channel::kEvent;
    std::array<std::uint8_t, kMaxMessageBytes> bytes{};
    std::size_t size = 0;
  };

  Wire(const WireFaults& faults, std::uint64_t stream, std::int64_t period_ns)
      : faults_(faults), random_(faults.random_seed * 2 + stream), period_ns_(static_cast<double>(period_ns)) {}

  void send(const Parcel& parcel, std::int64_t now_ns) {
    ++counters_.sent;
    if (happens(faults_.loss)) {
      ++counters_.lost;
      return;
    }
    if (happens(faults_.duplication)) {
      ++counters_.duplicated;
      on_their_way_.emplace(now_ns + delay_ns(), parcel);
    }
    const bool reordered = happens(faults_.reordering);
    counters_.reordered += reordered ? 1 : 0;
    const double extra = reordered ? kReorderingPeriods * period_ns_ : 0.0;
    on_their_way_.emplace(now_ns + delay_ns() + std::llround(extra), parcel);
  }

  std::int64_t next_arrival_ns() const noexcept {
    return on_their_way_.empty() ? kNever : on_their_way_.begin()->first;
  }

  Parcel take_next() {
    ++counters_.delivered;
    return on_their_way_.extract(on_their_way_.begin()).mapped();
  }

  WireCounters counters() const noexcept {
    WireCounters counters = counters_;
    counters.in_flight = static_cast<std::int64_t>(on_their_way_.size());
    return counters;
  }

 private:
  bool happens(double probability) { return uniform_(random_) < probability; }
  std::int64_t delay_ns() { return std::llround(faults_.jitter_periods * period_ns_ * uniform_(random_)); }

  WireFaults faults_;
  std::mt19937_64 random_;
  std::uniform_real_distribution<double> uniform_{0.0, 1.0};
  double period_ns_;
  WireCounters counters_;
  std::multimap<std::int64_t, Parcel> on_their_way_;
};

/// One end: receives one packet at a time, when its time has come.
class LossyRobot::End final : public Link {
 public:
  End(Side side, const WireIdentity& identity, Wire& incoming, Wire& outgoing, const std::int64_t& now_ns)
      : Link(side, identity), incoming_(incoming), outgoing_(outgoing), now_ns_(now_ns) {}

 private:
  bool transmit(Channel channel, const void* bytes, std::size_t size) noexcept override {
    Wire::Parcel parcel;
    parcel.channel = channel;
    parcel.size = size;
    std::copy_n(static_cast<const std::uint8_t*>(bytes), size, parcel.bytes.begin());
    outgoing_.send(parcel, now_ns_);
    return true;
  }

  bool drain(std::int64_t /*timeout_ns*/) noexcept override {
    if (incoming_.next_arrival_ns() > now_ns_) {
      return false;
    }
    const Wire::Parcel parcel = incoming_.take_next();
    accept(parcel.channel, parcel.bytes.data(), parcel.size);
    return true;
  }

  Wire& incoming_;
  Wire& outgoing_;
  const std::int64_t& now_ns_;
};

LossyRobot::LossyRobot(PlantSession& session, const WireIdentity& identity, const WireFaults& faults, Observer observer)
    : session_(session),
      observer_(std::move(observer)),
      period_ns_(to_nanoseconds(session.sample_period_s())),
      to_controller_(std::make_unique<Wire>(checked(faults), 0, period_ns_)),
      to_plant_(std::make_unique<Wire>(faults, 1, period_ns_)),
      controller_(std::make_unique<End>(Side::kController, identity, *to_controller_, *to_plant_, now_ns_)),
      plant_(std::make_unique<End>(Side::kPlant, identity, *to_plant_, *to_controller_, now_ns_)),
      controller_side_(*controller_) {
  begin_sample();
}

LossyRobot::~LossyRobot() = default;

void LossyRobot::begin_sample() {
  if (observer_) {
    observer_(session_);
  }
  torque_ = session_.torque();
  delay_ns_ = 0;
  const Measurement& measured = session_.measure(session_.seq());
  measurement_v3 message{};
  message.seq = measured.seq;
  std::copy(measured.angle.begin(), measured.angle.end(), message.angle_rad);
  std::copy(measured.speed.begin(), measured.speed.end(), message.speed_rad_s);
  set_gears(measured.gears, message);
  plant_->send(message);
}

void LossyRobot::finish_sample() {
  try {
    const double nanosecond = 1.0 / static_cast<double>(kNanosecondsPerSecond);
    session_.advance(session_.seq(), torque_, static_cast<double>(delay_ns_) * nanosecond);
  } catch (const PlantError& error) {
    failure_ = error.what();
  }
  if (!is_over()) {
    begin_sample();
  }
}

void LossyRobot::receive_command() {
  command_v2 command;
  plant_->receive(0);
  if (plant_->take(command) && command.seq > last_command_seq_) {
    last_command_seq_ = command.seq;
    std::copy(std::begin(command.torque_nm), std::end(command.torque_nm), torque_.begin());
    delay_ns_ = now_ns_ - session_.seq() * period_ns_;
  }
}

bool LossyRobot::read(RobotReading& reading, std::int64_t timeout_ns) noexcept {
  while (!is_over()) {
    const std::int64_t sample_end_ns = (session_.seq() + 1) * period_ns_;
    const std::int64_t measurement_ns = to_controller_->next_arrival_ns();
    const std::int64_t command_ns = to_plant_->next_arrival_ns();
    now_ns_ = std::min({measurement_ns, command_ns, sample_end_ns});
    if (now_ns_ == sample_end_ns) {
      finish_sample();
    } else if (now_ns_ == command_ns) {
      receive_command();
    } else {
      return controller_side_.read(reading, timeout_ns);
    }
  }
  return false;
}

void LossyRobot::write(const RobotCommand& command) noexcept { controller_side_.write(command); }

RobotRequest LossyRobot::take_request() noexcept { return is_over() ? RobotRequest::kEnd : RobotRequest::kNone; }

std::int64_t LossyRobot::take_longest_foreign_run() noexcept { return controller_side_.take_longest_foreign_run(); }

WireCounters LossyRobot::measurement_wire() const noexcept { return to_controller_->counters(); }
WireCounters LossyRobot::command_wire() const noexcept { return to_plant_->counters(); }
const LinkCounters& LossyRobot::measurements() const noexcept { return controller_->counters(); }
const LinkCounters& LossyRobot::commands() const noexcept { return plant_->counters(); }

}  // namespace quasilpv
