// The wire: what is common to all messages, how they are sealed, and what makes one acceptable. Format and channels:
// docs/reference/messages.md
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "quasilpv/command_v2.hpp"
#include "quasilpv/event_v2.hpp"
#include "quasilpv/measurement_v3.hpp"
#include "quasilpv/pacer.hpp"
#include "quasilpv/step.hpp"
#include "quasilpv/telemetry_sample.hpp"
#include "quasilpv/telemetry_v2.hpp"

namespace quasilpv {

/// No message is longer: it fits one Ethernet frame, so LCM never fragments it.
inline constexpr std::size_t kMaxMessageBytes = 1400;

enum class Channel : std::uint8_t { kMeasurement, kCommand, kTelemetry, kEvent };
inline constexpr int kChannels = 4;

/// LCM channel name. RT-SAFE.
const char* channel_name(Channel channel) noexcept;

/// Channel a message type travels on.
constexpr Channel channel_of(const measurement_v3& /*type*/) noexcept { return Channel::kMeasurement; }
constexpr Channel channel_of(const command_v2& /*type*/) noexcept { return Channel::kCommand; }
constexpr Channel channel_of(const telemetry_v2& /*type*/) noexcept { return Channel::kTelemetry; }
constexpr Channel channel_of(const event_v2& /*type*/) noexcept { return Channel::kEvent; }

/// Who sent an event (`event_v2::source`).
enum class Side : std::int32_t { kController = 1, kPlant = 2, kOperator = 3 };
inline constexpr std::size_t kSides = 3;

/// What happened (`event_v2::code`).
enum class EventCode : std::int32_t {
  kStarted = 1,  ///< the sender entered its loop
  kEnded = 2,    ///< the run is over: from the plant after its last sample, from the controller when it stops
  kFault = 3,    ///< the controller latched a fault; detail[0] is its FaultCause
  kReset = 4     ///< asks the controller to leave a latched fault
};

/// Whose messages these are, and how this side runs, which every message states. A message of another session, artifact
/// or number of joints is ignored and counted.
struct WireIdentity {
  std::int64_t session = 0;        ///< chosen by who starts the run
  std::int64_t artifact_hash = 0;  ///< Artifact::hash_prefix()
  int joints = 0;
  Pace pace = Pace::kLockStep;
  std::int64_t period_ns = 0;  ///< sample period
};

/// No number of a message that counts time may lead to more than this, about 127 years: sums and products of such times
/// stay within 64 bits.
inline constexpr std::int64_t kLongestTimeNs = 4'000'000'000'000'000'000;

/// A name that no other process has: random, with the process id in the low 22 bits; > 0. INIT-ONLY.
std::int64_t new_sender();

/// The process id in the name of a sender. RT-SAFE.
constexpr std::int64_t process_of(std::int64_t sender) noexcept { return sender & 0x3FFFFF; }

/// What a message says of the gears, and the other way round. RT-SAFE.
GearReading gears_of(const measurement_v3& message) noexcept;
void set_gears(const GearReading& gears, measurement_v3& message) noexcept;

/// The sample as it is sent; who sends it fills in the rest. RT-SAFE.
telemetry_v2 to_message(const TelemetrySample& sample) noexcept;

/// Outcome of decoding one packet.
enum class DecodeStatus : std::uint8_t {
  kAccepted,
  kWrongLength,
  kWrongChecksum,
  kWrongType,
  kWrongSession,
  kWrongArtifact,
  kOutOfBounds,  ///< a number or code that no side sends
  kNotAuthentic  ///< no tag, or that of another key; never from decode()
};

/// Encoded message in a buffer of its own: nothing is allocated.
struct Packet {
  std::array<std::uint8_t, kMaxMessageBytes> bytes;
  int size = 0;
};

/// Encodes `message` and writes the checksum of all preceding bytes into its last field. RT-SAFE (bounded, no
/// allocation, no lock, no throw). Message is one of the four types above.
template <class Message>
void encode(const Message& message, Packet& packet) noexcept;

/// Decodes a packet that must have the exact length of its type (LCM's own decoder accepts trailing bytes), the right
/// checksum and fingerprint, and `identity`. `message` is written if the result is kAccepted, and for messages of
/// others (kWrongSession, kWrongArtifact), which say whose they are. RT-SAFE (bounded, no allocation, no lock, no
/// throw).
template <class Message>
DecodeStatus decode(const void* bytes, std::size_t size, const WireIdentity& identity, Message& message) noexcept;

}  // namespace quasilpv
