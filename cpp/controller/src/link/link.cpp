#include "quasilpv/link.hpp"

#include <algorithm>
#include <cstring>
#include <type_traits>

#include "quasilpv/failsafe.hpp"
#include "quasilpv/realtime.hpp"

namespace quasilpv {
namespace {

template <class Message>
Speaker speaker_of(const Message& message) noexcept {
  return {message.sender, static_cast<Pace>(message.mode), message.period_ns};
}

template <std::size_t size>
bool are_identical(const double (&a)[size], const double (&b)[size]) noexcept {
  // NaN is a value here, and -0 is not 0.
  return std::memcmp(a, b, sizeof(a)) == 0;  // NOLINT(bugprone-suspicious-memory-comparison)
}

/// Whether two messages about one sample say the same; their time may differ.
bool agree(const measurement_v3& a, const measurement_v3& b) noexcept {
  return a.available == b.available && are_identical(a.angle_rad, b.angle_rad) &&
         are_identical(a.speed_rad_s, b.speed_rad_s) && are_identical(a.motor_angle_rad, b.motor_angle_rad) &&
         are_identical(a.link_angle_rad, b.link_angle_rad) && are_identical(a.joint_torque_nm, b.joint_torque_nm);
}
bool agree(const command_v2& a, const command_v2& b) noexcept {
  return a.state == b.state && a.flags == b.flags && are_identical(a.torque_nm, b.torque_nm);
}
bool agree(const signals_measurement_v1& a, const signals_measurement_v1& b) noexcept {
  return a.flags == b.flags && are_identical(a.value, b.value);
}
bool agree(const signals_command_v1& a, const signals_command_v1& b) noexcept {
  return a.state == b.state && a.flags == b.flags && are_identical(a.input, b.input);
}

template <class Message>
void state_sizes(Message& message, const WireIdentity& identity) noexcept {
  message.joints = identity.joints;
}
void state_sizes(signals_measurement_v1& message, const WireIdentity& identity) noexcept {
  message.signals = identity.signals.states + identity.signals.parameters;
}
void state_sizes(signals_command_v1& message, const WireIdentity& identity) noexcept {
  message.inputs = identity.signals.inputs;
}
void state_sizes(signals_telemetry_v1& message, const WireIdentity& identity) noexcept {
  message.states = identity.signals.states;
  message.inputs = identity.signals.inputs;
  message.premises = identity.signals.premises;
}

}  // namespace

void Link::send(const measurement_v3& message) noexcept { seal_and_transmit(message); }
void Link::send(const signals_measurement_v1& message) noexcept { seal_and_transmit(message); }
void Link::send(const command_v2& message) noexcept { send_command(message); }
void Link::send(const signals_command_v1& message) noexcept { send_command(message); }

template <class Command>
void Link::send_command(const Command& message) noexcept {
  const bool in_fault = message.state == static_cast<std::int32_t>(ControllerState::kFault);
  if (!in_fault || fault_seq_ < 0) {
    fault_seq_ = in_fault ? message.seq : -1;
  }
  last_command_seq_ = message.seq;
  seal_and_transmit(message);
}
void Link::send(const telemetry_v2& message) noexcept { seal_and_transmit(message); }
void Link::send(const signals_telemetry_v1& message) noexcept { seal_and_transmit(message); }

void Link::send(EventCode code, std::int64_t seq, std::int64_t detail, std::int64_t more) noexcept {
  event_v2 event{};
  event.seq = seq;
  event.source = static_cast<std::int32_t>(side_);
  event.code = static_cast<std::int32_t>(code);
  event.detail[0] = detail;
  event.detail[1] = more;
  seal_and_transmit(event);
}

bool Link::receive(std::int64_t timeout_ns) noexcept { return drain(timeout_ns); }

template <class Message>
void Link::seal_and_transmit(Message message) noexcept {
  constexpr std::int64_t kNanosecondsPerMicrosecond = 1000;
  message.utime = monotonic_ns() / kNanosecondsPerMicrosecond;
  message.session = identity_.session;
  message.artifact_hash = identity_.artifact_hash;
  if constexpr (!kIsTelemetry<Message>) {
    message.sender = sender_;
    message.mode = static_cast<std::int32_t>(identity_.pace);
    message.period_ns = identity_.period_ns;
  }
  if constexpr (kIsCommand<Message> || std::is_same_v<Message, event_v2>) {
    message.receiver = peers_.peer();
  }
  if constexpr (std::is_same_v<Message, event_v2>) {
    // No two events of a side have one time: in authenticated mode an equal one is a replayed one.
    message.utime = last_event_utime_ = std::max(message.utime, last_event_utime_ + 1);
  } else {
    state_sizes(message, identity_);
  }
  encode(message, packet_);
  if (key_) {
    const auto size = static_cast<std::size_t>(packet_.size);
    key_->sign(packet_.bytes.data(), size, packet_.bytes.data() + size);
    packet_.size += static_cast<int>(MessageKey::kTagBytes);
  }
  if (!transmit(channel_of(message), packet_.bytes.data(), static_cast<std::size_t>(packet_.size))) {
    ++counters_.send_failures;
  }
}

void Link::accept(Channel channel, const void* bytes, std::size_t size) noexcept {
  switch (channel) {
    case Channel::kMeasurement:
      accept_into(measurement_, bytes, size);
      break;
    case Channel::kCommand:
      accept_into(command_, bytes, size);
      break;
    case Channel::kEvent:
      accept_event(bytes, size);
      break;
    case Channel::kSignalsMeasurement:
      accept_into(signals_measurement_, bytes, size);
      break;
    case Channel::kSignalsCommand:
      accept_into(signals_command_, bytes, size);
      break;
    case Channel::kTelemetry:
    case Channel::kSignalsTelemetry:
      break;  // neither side listens to it
  }
}

template <class Message>
DecodeStatus Link::open(const void* bytes, std::size_t size, Message& message) const noexcept {
  if (!key_) {
    return decode(bytes, size, identity_, message);
  }
  if (size < MessageKey::kTagBytes) {
    return DecodeStatus::kNotAuthentic;
  }
  const auto* data = static_cast<const std::uint8_t*>(bytes);
  const std::size_t signed_size = size - MessageKey::kTagBytes;
  return key_->is_authentic(data, signed_size, data + signed_size) ? decode(data, signed_size, identity_, message)
                                                                   : DecodeStatus::kNotAuthentic;
}

template <class Message>
void Link::accept_into(Inbox<Message>& inbox, const void* bytes, std::size_t size) noexcept {
  Message message;
  const DecodeStatus status = open(bytes, size, message);
  look_at_foreign(status, message);
  if (count(status) && is_of_peer(inbox, message)) {
    file(inbox, message);
  }
}

template <class Message>
void Link::look_at_foreign(DecodeStatus status, const Message& message) noexcept {
  if (status == DecodeStatus::kWrongSession) {
    foreign_session_ = message.session;
  } else if (status == DecodeStatus::kWrongArtifact && !peers_.has_peer() && message.period_ns != identity_.period_ns) {
    peers_.fits(speaker_of(message));  // another artifact, of another rate: this can become no run
  }
}

template <class Message>
bool Link::is_of_peer(Inbox<Message>& inbox, const Message& message) noexcept {
  if constexpr (kIsCommand<Message>) {
    if (side_ == Side::kPlant && message.receiver != 0 && message.receiver != sender_) {
      ++counters_.second_sender;
      peers_.hears_twin(message.receiver);
      return false;
    }
  }
  const std::int64_t takeovers = peers_.takeovers();
  if (peers_.hears(speaker_of(message))) {
    if (peers_.takeovers() > takeovers) {
      inbox = {};
    }
    return true;
  }
  ++(peers_.has_peer() ? counters_.second_sender : counters_.other_mode);
  return false;
}

void Link::accept_event(const void* bytes, std::size_t size) noexcept {
  event_v2 event;
  DecodeStatus status = open(bytes, size, event);
  // Both sides send on the channel of events, and multicast hands every sender its own packets back.
  if (status == DecodeStatus::kAccepted && event.sender == sender_) {
    return;
  }
  if (status == DecodeStatus::kWrongSession ||
      (status == DecodeStatus::kWrongArtifact && event.source != static_cast<std::int32_t>(side_))) {
    look_at_foreign(status, event);
  }
  if (status == DecodeStatus::kAccepted && !fits(event)) {
    ++counters_.unfit_events;
    return;
  }
  if (status == DecodeStatus::kAccepted && key_ && is_replayed(event)) {
    status = DecodeStatus::kNotAuthentic;
  }
  if (count(status)) {
    // Events are rare and carry the sample index: several of one sample are not duplicates of each other.
    ++counters_.accepted;
    counters_.lost_events += events_.put(event) ? 0 : 1;
  }
}

bool Link::fits(const event_v2& event) noexcept {
  const auto source = static_cast<Side>(event.source);
  const auto code = static_cast<EventCode>(event.code);
  if (source == Side::kOperator) {
    // A reset is meant for this controller and for the fault it is in, not for one before it.
    return side_ == Side::kController && code == EventCode::kReset && event.receiver == sender_ && fault_seq_ >= 0 &&
           fault_seq_ <= event.seq && event.seq <= last_command_seq_;
  }
  if (source == side_) {
    if (!peers_.has_peer() && (code == EventCode::kStarted || code == EventCode::kFault)) {
      peers_.hears_twin(event.sender);
    }
    return false;
  }
  // Of a link, only the messages of a robot or only those of a system are in use; the others are at -1.
  return fits(event, side_ == Side::kController ? std::max(measurement_.newest_seq, signals_measurement_.newest_seq)
                                                : std::max(command_.newest_seq, signals_command_.newest_seq));
}

/// An event of the other side: of the peer, and not older than what it last said about a sample.
bool Link::fits(const event_v2& event, std::int64_t newest_seq) noexcept {
  const auto code = static_cast<EventCode>(event.code);
  if (!peers_.has_peer()) {
    // A controller that refuses to start says so to the plant it has heard, before any command.
    const bool refuses = code == EventCode::kEnded && event.receiver == sender_ &&
                         event.detail[0] == static_cast<std::int64_t>(FaultCause::kStartRefused);
    return peers_.fits(speaker_of(event)) && (code == EventCode::kStarted || refuses);
  }
  return peers_.is_peer(event.sender) && code != EventCode::kReset &&
         (code != EventCode::kEnded || event.seq >= newest_seq);
}

// Measurements and commands are told apart by their seq, events only by their time.
bool Link::is_replayed(const event_v2& event) noexcept {
  const auto source = static_cast<std::size_t>(event.source) - 1;
  if (event.utime <= newest_event_utime_[source]) {
    return true;
  }
  newest_event_utime_[source] = event.utime;
  return false;
}

bool Link::EventQueue::put(const event_v2& event) noexcept {
  if (count == kCapacity) {
    return false;
  }
  events[(first + count) % kCapacity] = event;
  ++count;
  return true;
}

bool Link::EventQueue::take(event_v2& event) noexcept {
  if (count == 0) {
    return false;
  }
  event = events[first];
  first = (first + 1) % kCapacity;
  --count;
  return true;
}

std::int64_t Link::take_longest_wrong_run() noexcept {
  const std::int64_t longest = std::max(longest_wrong_run_, counters_.consecutive_wrong);
  longest_wrong_run_ = 0;
  return longest;
}

bool Link::count(DecodeStatus status) noexcept {
  switch (status) {
    case DecodeStatus::kAccepted:
      counters_.consecutive_wrong = 0;
      return true;
    case DecodeStatus::kNotAuthentic:
      ++counters_.not_authentic;
      return false;
    case DecodeStatus::kWrongLength:
      ++counters_.wrong_length;
      return false;
    case DecodeStatus::kWrongChecksum:
      ++counters_.wrong_checksum;
      return false;
    case DecodeStatus::kWrongType:
      ++counters_.wrong_type;
      return false;
    case DecodeStatus::kOutOfBounds:
      ++counters_.out_of_bounds;
      return false;
    case DecodeStatus::kWrongSession:
      ++counters_.wrong_session;
      break;
    case DecodeStatus::kWrongArtifact:
      ++counters_.wrong_artifact;
      break;
  }
  ++counters_.consecutive_wrong;
  longest_wrong_run_ = std::max(longest_wrong_run_, counters_.consecutive_wrong);
  return false;
}

template <class Message>
void Link::file(Inbox<Message>& inbox, const Message& message) noexcept {
  if (message.seq < inbox.newest_seq) {
    ++counters_.old;
    return;
  }
  if (message.seq == inbox.newest_seq) {
    if (!agree(message, inbox.newest)) {
      ++counters_.second_sender;
      peers_.hears_contradiction();
      return;
    }
    ++counters_.duplicates;
  } else {
    ++counters_.accepted;
    counters_.superseded += inbox.fresh ? 1 : 0;
    inbox.newest = message;
    inbox.newest_seq = message.seq;
  }
  inbox.fresh = true;
}

}  // namespace quasilpv
