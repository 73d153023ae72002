// The wire: what is common to all messages, how they are sealed, and what makes one acceptable. Format and channels:
// docs/reference/messages.md
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "quasilpv/command_v2.hpp"
#include "quasilpv/event_v2.hpp"
#include "quasilpv/measurement_v3.hpp"
#include "quasilpv/pacer.hpp"
#include "quasilpv/signals_command_v1.hpp"
#include "quasilpv/signals_measurement_v1.hpp"
#include "quasilpv/signals_telemetry_v1.hpp"
#include "quasilpv/step.hpp"
#include "quasilpv/system_sample.hpp"
#include "quasilpv/telemetry_sample.hpp"
#include "quasilpv/telemetry_v2.hpp"

namespace quasilpv {

/// No message is longer: it fits one Ethernet frame, so LCM never fragments it.
inline constexpr std::size_t kMaxMessageBytes = 1400;

enum class Channel : std::uint8_t {
  kMeasurement,
  kCommand,
  kTelemetry,
  kEvent,
  kSignalsMeasurement,  ///< of general systems, as the next two
  kSignalsCommand,
  kSignalsTelemetry
};
inline constexpr int kChannels = 7;

/// LCM channel name. RT-SAFE.
const char* channel_name(Channel channel) noexcept;

/// Channel a message type travels on.
constexpr Channel channel_of(const measurement_v3& /*type*/) noexcept { return Channel::kMeasurement; }
constexpr Channel channel_of(const command_v2& /*type*/) noexcept { return Channel::kCommand; }
constexpr Channel channel_of(const telemetry_v2& /*type*/) noexcept { return Channel::kTelemetry; }
constexpr Channel channel_of(const event_v2& /*type*/) noexcept { return Channel::kEvent; }
constexpr Channel channel_of(const signals_measurement_v1& /*type*/) noexcept { return Channel::kSignalsMeasurement; }
constexpr Channel channel_of(const signals_command_v1& /*type*/) noexcept { return Channel::kSignalsCommand; }
constexpr Channel channel_of(const signals_telemetry_v1& /*type*/) noexcept { return Channel::kSignalsTelemetry; }

/// What only the controller sends, for those who look on: nothing that acts listens to it.
template <class Message>
inline constexpr bool kIsTelemetry =
    std::is_same_v<Message, telemetry_v2> || std::is_same_v<Message, signals_telemetry_v1>;

/// What the plant acts on.
template <class Message>
inline constexpr bool kIsCommand = std::is_same_v<Message, command_v2> || std::is_same_v<Message, signals_command_v1>;

/// Who sent an event (`event_v2::source`).
enum class Side : std::int32_t { kController = 1, kPlant = 2, kOperator = 3 };
inline constexpr std::size_t kSides = 3;

/// What happened (`event_v2::code`).
enum class EventCode : std::int32_t {
  kStarted = 1,    ///< the sender entered its loop
  kEnded = 2,      ///< the run is over: from the plant after its last sample, from the controller when it stops
  kFault = 3,      ///< the controller latched a fault; detail[0] is its FaultCause
  kReset = 4,      ///< asks the controller to leave a latched fault
  kLeftDomain = 5  ///< a general system left its domain; detail[0] is the index of the state
};

/// How many signals of a general system the messages carry.
struct SignalCounts {
  int states = 0;  ///< 0: a robot
  int parameters = 0;
  int inputs = 0;
  int premises = 0;
};

/// Whose messages these are, and how this side runs, which every message states. A message of another session, artifact
/// or number of joints or signals is ignored and counted.
struct WireIdentity {
  std::int64_t session = 0;        ///< chosen by who starts the run
  std::int64_t artifact_hash = 0;  ///< hash_prefix() of the artifact
  int joints = 0;                  ///< 0: a general system
  Pace pace = Pace::kLockStep;
  std::int64_t period_ns = 0;  ///< sample period
  SignalCounts signals{};

  bool is_of_system() const noexcept { return signals.states > 0; }
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
signals_telemetry_v1 to_message(const SystemSample& sample) noexcept;

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
/// allocation, no lock, no throw). Message is one of the types that have a channel_of().
template <class Message>
void encode(const Message& message, Packet& packet) noexcept;

/// Decodes a packet that must have the exact length of its type (LCM's own decoder accepts trailing bytes), the right
/// checksum and fingerprint, and `identity`. `message` is written if the result is kAccepted, and for messages of
/// others (kWrongSession, kWrongArtifact), which say whose they are. RT-SAFE (bounded, no allocation, no lock, no
/// throw).
template <class Message>
DecodeStatus decode(const void* bytes, std::size_t size, const WireIdentity& identity, Message& message) noexcept;

}  // namespace quasilpv
