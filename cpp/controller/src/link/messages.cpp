#include "quasilpv/messages.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <random>
#include <type_traits>

#include "quasilpv/crc32.hpp"
#include "quasilpv/failsafe.hpp"

namespace quasilpv {
namespace {

constexpr std::size_t kChecksumBytes = 8;

/// All fields have a fixed size, so the encoded size does not depend on the values.
template <class Message>
std::size_t encoded_size() noexcept {
  return static_cast<std::size_t>(Message{}.getEncodedSize());
}

std::int64_t read_big_endian(const std::uint8_t* bytes) noexcept {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < sizeof(value); ++i) {
    value = (value << 8) | bytes[i];
  }
  return static_cast<std::int64_t>(value);
}

void write_big_endian(std::uint64_t value, std::uint8_t* bytes) noexcept {
  for (std::size_t i = sizeof(value); i-- > 0; value >>= 8) {
    bytes[i] = static_cast<std::uint8_t>(value & 0xFFu);
  }
}

bool sizes_agree(const event_v2& /*message*/, const WireIdentity& /*identity*/) noexcept { return true; }
bool sizes_agree(const signals_measurement_v1& message, const WireIdentity& identity) noexcept {
  return message.signals == identity.signals.states + identity.signals.parameters;
}
bool sizes_agree(const signals_command_v1& message, const WireIdentity& identity) noexcept {
  return message.inputs == identity.signals.inputs;
}
bool sizes_agree(const signals_telemetry_v1& message, const WireIdentity& identity) noexcept {
  return message.states == identity.signals.states && message.inputs == identity.signals.inputs &&
         message.premises == identity.signals.premises;
}
template <class Message>
bool sizes_agree(const Message& message, const WireIdentity& identity) noexcept {
  return message.joints == identity.joints;
}

void copy(const double (&source)[kMaxJoints], JointArray& target) noexcept {
  std::copy(std::begin(source), std::end(source), target.begin());
}

template <std::size_t Size>
void copy(const std::array<double, Size>& source, double (&target)[Size]) noexcept {
  std::copy(source.begin(), source.end(), target);
}

/// What telemetry says of a step, whatever was measured.
template <class Sample, class Message>
void copy_step(const Sample& sample, Message& message) noexcept {
  message.seq = sample.seq;
  message.state = static_cast<std::int32_t>(sample.state);
  message.flags = static_cast<std::int32_t>(sample.flags);
  message.realtime = sample.realtime ? 1 : 0;
  message.drops = sample.drops;
  message.step_ns = sample.step_ns;
}

constexpr bool is_within(std::int64_t value, std::int64_t low, std::int64_t high) noexcept {
  return low <= value && value <= high;
}

bool is_within_bounds(const measurement_v3& message) noexcept {
  return is_within(message.available, kNoGearSensor, kAllGearSensors);
}
template <class Message>
bool is_within_bounds(const Message& message) noexcept {
  if constexpr (kIsCommand<Message>) {
    return is_within(message.state, static_cast<int>(ControllerState::kInit),
                     static_cast<int>(ControllerState::kFault));
  }
  return true;
}
bool is_within_bounds(const event_v2& message) noexcept {
  return is_within(message.source, static_cast<int>(Side::kController), static_cast<int>(Side::kOperator)) &&
         is_within(message.code, static_cast<int>(EventCode::kStarted), static_cast<int>(EventCode::kLeftDomain));
}

/// Angles, torques and signals may be any double: what reads them says what it does with them.
template <class Message>
bool has_times_within_bounds(const Message& message, std::int64_t period_ns) noexcept {
  constexpr std::int64_t kNanosecondsPerMicrosecond = 1000;
  return is_within(message.utime, 0, kLongestTimeNs / kNanosecondsPerMicrosecond) &&
         is_within(message.seq, 0, kLongestTimeNs / (period_ns > 0 ? period_ns : 1));
}

template <class Message>
bool is_possible(const Message& message, const WireIdentity& identity) noexcept {
  if constexpr (kIsTelemetry<Message>) {
    return has_times_within_bounds(message, identity.period_ns);
  } else {
    return has_times_within_bounds(message, identity.period_ns) && is_within(message.period_ns, 0, kLongestTimeNs) &&
           is_within(message.mode, static_cast<int>(Pace::kLockStep), static_cast<int>(Pace::kRealTime)) &&
           is_within_bounds(message);
  }
}

}  // namespace

std::int64_t new_sender() {
  std::random_device random;
  const std::uint64_t high = (static_cast<std::uint64_t>(random()) << 32 | random()) >> 1;
  const std::uint64_t process = static_cast<std::uint64_t>(getpid()) & 0x3FFFFF;
  return static_cast<std::int64_t>((high & ~std::uint64_t{0x3FFFFF}) | process);
}

const char* channel_name(Channel channel) noexcept {
  static constexpr std::array<const char*, kChannels> kNames = {
      "QLPV_MEASUREMENT",         "QLPV_COMMAND",         "QLPV_TELEMETRY",        "QLPV_EVENT",
      "QLPV_SIGNALS_MEASUREMENT", "QLPV_SIGNALS_COMMAND", "QLPV_SIGNALS_TELEMETRY"};
  return kNames[static_cast<std::size_t>(channel)];
}

template <class Message>
void encode(const Message& message, Packet& packet) noexcept {
  packet.size = message.encode(packet.bytes.data(), 0, static_cast<int>(packet.bytes.size()));
  const std::size_t checked = static_cast<std::size_t>(packet.size) - kChecksumBytes;
  write_big_endian(crc32(packet.bytes.data(), checked), packet.bytes.data() + checked);
}

template <class Message>
DecodeStatus decode(const void* bytes, std::size_t size, const WireIdentity& identity, Message& message) noexcept {
  if (size != encoded_size<Message>()) {
    return DecodeStatus::kWrongLength;
  }
  const auto* data = static_cast<const std::uint8_t*>(bytes);
  const std::size_t checked = size - kChecksumBytes;
  if (read_big_endian(data + checked) != static_cast<std::int64_t>(crc32(data, checked))) {
    return DecodeStatus::kWrongChecksum;
  }
  Message candidate;
  if (candidate.decode(data, 0, static_cast<int>(size)) < 0) {
    return DecodeStatus::kWrongType;
  }
  if (!is_possible(candidate, identity)) {
    return DecodeStatus::kOutOfBounds;
  }
  message = candidate;
  if (candidate.session != identity.session) {
    return DecodeStatus::kWrongSession;
  }
  if (candidate.artifact_hash != identity.artifact_hash || !sizes_agree(candidate, identity)) {
    return DecodeStatus::kWrongArtifact;
  }
  return DecodeStatus::kAccepted;
}

GearReading gears_of(const measurement_v3& message) noexcept {
  GearReading gears;
  gears.available = static_cast<std::uint32_t>(message.available);
  copy(message.motor_angle_rad, gears.motor_angle_rad);
  copy(message.link_angle_rad, gears.link_angle_rad);
  copy(message.joint_torque_nm, gears.joint_torque_nm);
  return gears;
}

void set_gears(const GearReading& gears, measurement_v3& message) noexcept {
  message.available = static_cast<std::int32_t>(gears.available);
  copy(gears.motor_angle_rad, message.motor_angle_rad);
  copy(gears.link_angle_rad, message.link_angle_rad);
  copy(gears.joint_torque_nm, message.joint_torque_nm);
}

telemetry_v2 to_message(const TelemetrySample& sample) noexcept {
  telemetry_v2 message{};
  copy_step(sample, message);
  message.premises = sample.premises;
  copy(sample.reference_angle_rad, message.reference_angle_rad);
  copy(sample.reference_speed_rad_s, message.reference_speed_rad_s);
  copy(sample.reference_acceleration_rad_s2, message.reference_acceleration_rad_s2);
  copy(sample.measured_angle_rad, message.measured_angle_rad);
  copy(sample.measured_speed_rad_s, message.measured_speed_rad_s);
  message.available = static_cast<std::int32_t>(sample.gears.available);
  copy(sample.gears.motor_angle_rad, message.motor_angle_rad);
  copy(sample.gears.link_angle_rad, message.link_angle_rad);
  copy(sample.gears.joint_torque_nm, message.joint_torque_nm);
  copy(sample.estimated_angle_rad, message.estimated_angle_rad);
  copy(sample.estimated_speed_rad_s, message.estimated_speed_rad_s);
  copy(sample.estimated_disturbance, message.estimated_disturbance);
  copy(sample.filtered_disturbance, message.filtered_disturbance);
  copy(sample.integral_error_rad_s, message.integral_error_rad_s);
  copy(sample.commanded_torque_nm, message.commanded_torque_nm);
  copy(sample.applied_torque_nm, message.applied_torque_nm);
  copy(sample.premise, message.premise);
  message.membership_sum = sample.membership_sum;
  message.premise_excess = sample.premise_excess;
  message.lyapunov_rad2 = sample.lyapunov_rad2;
  return message;
}

signals_telemetry_v1 to_message(const SystemSample& sample) noexcept {
  signals_telemetry_v1 message{};
  copy_step(sample, message);
  copy(sample.measured, message.measured);
  copy(sample.commanded, message.commanded);
  copy(sample.applied, message.applied);
  copy(sample.premise, message.premise);
  message.level = sample.level;
  return message;
}

template void encode(const measurement_v3&, Packet&) noexcept;
template void encode(const command_v2&, Packet&) noexcept;
template void encode(const telemetry_v2&, Packet&) noexcept;
template void encode(const event_v2&, Packet&) noexcept;
template void encode(const signals_measurement_v1&, Packet&) noexcept;
template void encode(const signals_command_v1&, Packet&) noexcept;
template void encode(const signals_telemetry_v1&, Packet&) noexcept;
template DecodeStatus decode(const void*, std::size_t, const WireIdentity&, measurement_v3&) noexcept;
template DecodeStatus decode(const void*, std::size_t, const WireIdentity&, command_v2&) noexcept;
template DecodeStatus decode(const void*, std::size_t, const WireIdentity&, telemetry_v2&) noexcept;
template DecodeStatus decode(const void*, std::size_t, const WireIdentity&, event_v2&) noexcept;
template DecodeStatus decode(const void*, std::size_t, const WireIdentity&, signals_measurement_v1&) noexcept;
template DecodeStatus decode(const void*, std::size_t, const WireIdentity&, signals_command_v1&) noexcept;
template DecodeStatus decode(const void*, std::size_t, const WireIdentity&, signals_telemetry_v1&) noexcept;

}  // namespace quasilpv
