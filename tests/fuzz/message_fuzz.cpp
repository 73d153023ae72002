// The message decoder and the receiving end of a link under any bytes.
//
// The first byte chooses the channel, the rest is the packet. Random bytes never have the right checksum, so each
// packet is used twice: as it is, and with its checksum put right. Every packet must be counted exactly once, and what
// is accepted must be the encoding of its message.
#include <array>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "quasilpv/crc32.hpp"
#include "quasilpv/link.hpp"

namespace {

using namespace quasilpv;  // NOLINT(google-build-using-namespace): this file is the program

constexpr WireIdentity kIdentity{42, -7, 3, Pace::kLockStep, 0, {4, 2, 3, 5}};
constexpr std::size_t kChecksumBytes = 8;

void require(bool holds) {
  if (!holds) {
    std::abort();
  }
}

std::vector<std::uint8_t> with_checksum(std::vector<std::uint8_t> bytes) {
  if (bytes.size() >= kChecksumBytes) {
    const std::size_t checked = bytes.size() - kChecksumBytes;
    std::uint64_t checksum = crc32(bytes.data(), checked);
    for (std::size_t i = kChecksumBytes; i-- > 0; checksum >>= 8) {
      bytes[checked + i] = static_cast<std::uint8_t>(checksum & 0xFFu);
    }
  }
  return bytes;
}

template <class Message>
void decode_as(const std::vector<std::uint8_t>& bytes) {
  Message message{};
  if (decode(bytes.data(), bytes.size(), kIdentity, message) == DecodeStatus::kAccepted) {
    Packet again;
    encode(message, again);
    require(static_cast<std::size_t>(again.size) == bytes.size());
    require(std::memcmp(again.bytes.data(), bytes.data(), bytes.size()) == 0);
  }
}

std::int64_t counted(const LinkCounters& counters) {
  return counters.accepted + counters.duplicates + counters.old + counters.not_authentic + counters.wrong_length +
         counters.wrong_checksum + counters.wrong_type + counters.wrong_session + counters.wrong_artifact +
         counters.out_of_bounds + counters.second_sender + counters.other_mode + counters.unfit_events;
}

/// The receiving end of a link, given its packets by hand.
class Receiver final : public Link {
 public:
  Receiver(Side side, bool authenticated) : Link(side, kIdentity) {
    if (authenticated) {
      authenticate_with(MessageKey({1, 2, 3}));
    }
  }

  using Link::accept;

 private:
  bool transmit(Channel /*channel*/, const void* /*bytes*/, std::size_t /*size*/) noexcept override { return true; }
  bool drain(std::int64_t /*timeout_ns*/) noexcept override { return false; }
};

/// One packet at an end that is new: nothing is remembered from the input before.
void receive(Channel channel, const std::vector<std::uint8_t>& bytes, bool authenticated) {
  const bool measured = channel == Channel::kMeasurement || channel == Channel::kSignalsMeasurement;
  Receiver end(measured ? Side::kController : Side::kPlant, authenticated);
  end.accept(channel, bytes.data(), bytes.size());
  require(counted(end.counters()) == 1);
  require(!authenticated || end.counters().accepted == 0);
  event_v2 event;
  require(end.take(event) == (channel == Channel::kEvent && end.counters().accepted == 1));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::array<Channel, 5> kHeard{Channel::kMeasurement, Channel::kCommand, Channel::kEvent,
                                          Channel::kSignalsMeasurement, Channel::kSignalsCommand};
  if (size < 2 || size > kMaxMessageBytes) {
    return 0;
  }
  const Channel channel = kHeard[data[0] % kHeard.size()];
  const std::vector<std::uint8_t> raw(data + 1, data + size);
  for (const std::vector<std::uint8_t>& bytes : {raw, with_checksum(raw)}) {
    decode_as<measurement_v3>(bytes);
    decode_as<command_v2>(bytes);
    decode_as<telemetry_v2>(bytes);
    decode_as<event_v2>(bytes);
    decode_as<signals_measurement_v1>(bytes);
    decode_as<signals_command_v1>(bytes);
    decode_as<signals_telemetry_v1>(bytes);
    receive(channel, bytes, false);
    receive(channel, bytes, true);
  }
  return 0;
}
