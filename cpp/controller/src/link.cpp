#include "quasilpv/link.hpp"

#include <algorithm>
#include <type_traits>

#include "quasilpv/realtime.hpp"

namespace quasilpv {

void Link::send(const measurement_v1& message) noexcept { seal_and_transmit(message); }
void Link::send(const command_v1& message) noexcept { seal_and_transmit(message); }
void Link::send(const telemetry_v1& message) noexcept { seal_and_transmit(message); }

void Link::send(EventCode code, std::int64_t seq, std::int64_t detail) noexcept {
  event_v1 event{};
  event.seq = seq;
  event.source = static_cast<std::int32_t>(side_);
  event.code = static_cast<std::int32_t>(code);
  event.detail[0] = detail;
  seal_and_transmit(event);
}

bool Link::receive(std::int64_t timeout_ns) noexcept { return drain(timeout_ns); }

template <class Message>
void Link::seal_and_transmit(Message message) noexcept {
  constexpr std::int64_t kNanosecondsPerMicrosecond = 1000;
  message.utime = monotonic_ns() / kNanosecondsPerMicrosecond;
  message.session = identity_.session;
  message.artifact_hash = identity_.artifact_hash;
  if constexpr (std::is_same_v<Message, event_v1>) {
    // No two events of a side have one time: in authenticated mode an equal one is a replayed one.
    message.utime = last_event_utime_ = std::max(message.utime, last_event_utime_ + 1);
  } else {
    message.joints = identity_.joints;
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
    case Channel::kTelemetry:
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
  if (count(open(bytes, size, message))) {
    file(inbox, message);
  }
}

void Link::accept_event(const void* bytes, std::size_t size) noexcept {
  event_v1 event;
  DecodeStatus status = open(bytes, size, event);
  // Both sides send on the channel of events, and multicast hands every sender its own packets back.
  if (status == DecodeStatus::kAccepted && event.source == static_cast<std::int32_t>(side_)) {
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

// Measurements and commands are told apart by their seq, events only by their time.
bool Link::is_replayed(const event_v1& event) noexcept {
  const auto source = static_cast<std::size_t>(event.source) - 1;  // of an authentic event
  if (source >= kSides || event.utime <= newest_event_utime_[source]) {
    return true;
  }
  newest_event_utime_[source] = event.utime;
  return false;
}

bool Link::EventQueue::put(const event_v1& event) noexcept {
  if (count == kCapacity) {
    return false;
  }
  events[(first + count) % kCapacity] = event;
  ++count;
  return true;
}

bool Link::EventQueue::take(event_v1& event) noexcept {
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
