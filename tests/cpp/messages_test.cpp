#include "quasilpv/messages.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <limits>
#include <random>

#include "quasilpv/crc32.hpp"

namespace quasilpv {
namespace {

constexpr WireIdentity kIdentity{42, -7, 3, Pace::kLockStep, 0, {4, 2, 3, 5}};

template <class Message>
void fill(Message& message) {
  message.joints = kIdentity.joints;
}
void fill(event_v2& message) {
  message.source = static_cast<std::int32_t>(Side::kPlant);
  message.code = static_cast<std::int32_t>(EventCode::kStarted);
}
void fill(signals_measurement_v1& message) { message.signals = 6; }
void fill(signals_command_v1& message) { message.inputs = 3; }
void fill(signals_telemetry_v1& message) {
  message.states = 4;
  message.inputs = 3;
  message.premises = 5;
}

template <class Message>
Message sealed_message() {
  Message message{};
  message.seq = 5;
  message.session = kIdentity.session;
  message.artifact_hash = kIdentity.artifact_hash;
  fill(message);
  return message;
}

template <class Message>
DecodeStatus decode_status(const Packet& packet, const WireIdentity& identity = kIdentity) {
  Message message{};
  return decode(packet.bytes.data(), static_cast<std::size_t>(packet.size), identity, message);
}

WireIdentity with_identity(std::int64_t session, std::int64_t artifact_hash) {
  WireIdentity identity = kIdentity;
  identity.session = session;
  identity.artifact_hash = artifact_hash;
  return identity;
}

/// Replaces the checksum by the right one for the bytes as they are.
void reseal(Packet& packet) {
  const std::size_t checked = static_cast<std::size_t>(packet.size) - 8;
  std::uint64_t checksum = crc32(packet.bytes.data(), checked);
  for (std::size_t i = 8; i-- > 0; checksum >>= 8) {
    packet.bytes[checked + i] = static_cast<std::uint8_t>(checksum & 0xFFu);
  }
}

template <class Message>
class EveryMessage : public testing::Test {};
using Messages = testing::Types<measurement_v3, command_v2, telemetry_v2, event_v2, signals_measurement_v1,
                                signals_command_v1, signals_telemetry_v1>;
TYPED_TEST_SUITE(EveryMessage, Messages);

TYPED_TEST(EveryMessage, fits_one_unfragmented_packet) {
  EXPECT_LE(static_cast<std::size_t>(TypeParam{}.getEncodedSize()), kMaxMessageBytes);
}

TYPED_TEST(EveryMessage, when_encoded_and_decoded_expect_it_accepted_with_its_fields) {
  Packet packet;
  encode(sealed_message<TypeParam>(), packet);
  TypeParam decoded{};
  ASSERT_EQ(decode(packet.bytes.data(), static_cast<std::size_t>(packet.size), kIdentity, decoded),
            DecodeStatus::kAccepted);
  EXPECT_EQ(decoded.seq, 5);
  EXPECT_EQ(decoded.session, kIdentity.session);
}

TYPED_TEST(EveryMessage, when_the_length_is_any_other_expect_it_refused) {
  Packet packet;
  encode(sealed_message<TypeParam>(), packet);
  const int size = packet.size;
  for (packet.size = 0; packet.size < static_cast<int>(kMaxMessageBytes); ++packet.size) {
    if (packet.size != size) {
      ASSERT_EQ(decode_status<TypeParam>(packet), DecodeStatus::kWrongLength) << packet.size << " bytes";
    }
  }
}

TYPED_TEST(EveryMessage, when_any_single_bit_is_flipped_expect_it_refused) {
  Packet packet;
  encode(sealed_message<TypeParam>(), packet);
  for (std::size_t bit = 0; bit < static_cast<std::size_t>(packet.size) * 8; ++bit) {
    const auto mask = static_cast<std::uint8_t>(1u << (bit % 8));
    packet.bytes[bit / 8] ^= mask;
    ASSERT_EQ(decode_status<TypeParam>(packet), DecodeStatus::kWrongChecksum) << "bit " << bit;
    packet.bytes[bit / 8] ^= mask;
  }
  EXPECT_EQ(decode_status<TypeParam>(packet), DecodeStatus::kAccepted);
}

TYPED_TEST(EveryMessage, when_the_fingerprint_is_of_another_type_expect_it_refused) {
  Packet packet;
  encode(sealed_message<TypeParam>(), packet);
  packet.bytes[3] ^= 0x10u;
  reseal(packet);
  EXPECT_EQ(decode_status<TypeParam>(packet), DecodeStatus::kWrongType);
}

TYPED_TEST(EveryMessage, when_session_or_artifact_differ_expect_it_refused) {
  Packet packet;
  encode(sealed_message<TypeParam>(), packet);
  EXPECT_EQ(decode_status<TypeParam>(packet, with_identity(43, -7)), DecodeStatus::kWrongSession);
  EXPECT_EQ(decode_status<TypeParam>(packet, with_identity(42, 7)), DecodeStatus::kWrongArtifact);
}

TEST(Messages, when_the_number_of_joints_differs_expect_the_artifact_refused) {
  Packet packet;
  encode(sealed_message<measurement_v3>(), packet);
  EXPECT_EQ(decode_status<measurement_v3>(packet, {42, -7, 2}), DecodeStatus::kWrongArtifact);
}

TEST(Messages, when_the_number_of_any_signals_differs_expect_the_artifact_refused) {
  Packet measurement;
  Packet command;
  Packet telemetry;
  encode(sealed_message<signals_measurement_v1>(), measurement);
  encode(sealed_message<signals_command_v1>(), command);
  encode(sealed_message<signals_telemetry_v1>(), telemetry);
  for (int SignalCounts::*const count :
       {&SignalCounts::states, &SignalCounts::parameters, &SignalCounts::inputs, &SignalCounts::premises}) {
    WireIdentity other = kIdentity;
    ++(other.signals.*count);
    const bool measured = count == &SignalCounts::states || count == &SignalCounts::parameters;
    const auto expected = [](bool concerned) {
      return concerned ? DecodeStatus::kWrongArtifact : DecodeStatus::kAccepted;
    };
    EXPECT_EQ(decode_status<signals_measurement_v1>(measurement, other), expected(measured));
    EXPECT_EQ(decode_status<signals_command_v1>(command, other), expected(count == &SignalCounts::inputs));
    EXPECT_EQ(decode_status<signals_telemetry_v1>(telemetry, other), expected(count != &SignalCounts::parameters));
  }
}

TEST(Messages, of_a_system_carry_every_value_of_its_sample) {
  SystemSample sample;
  sample.seq = 7;
  sample.state = ControllerState::kDegraded;
  sample.flags = kOutsideRegion | kInputSaturated;
  sample.realtime = true;
  sample.drops = 3;
  sample.step_ns = 800;
  sample.measured.back() = 1.0 / 3.0;
  sample.commanded.back() = -2.5;
  sample.applied.back() = -0.0;
  sample.premise.back() = 0.1;
  sample.level = 1.25;
  const signals_telemetry_v1 message = to_message(sample);
  EXPECT_EQ(message.seq, 7);
  EXPECT_EQ(message.state, 3);
  EXPECT_EQ(message.flags, 20);
  EXPECT_EQ(message.realtime, 1);
  EXPECT_EQ(message.drops, 3);
  EXPECT_EQ(message.step_ns, 800);
  EXPECT_EQ(message.measured[31], 1.0 / 3.0);
  EXPECT_EQ(message.commanded[6], -2.5);
  EXPECT_TRUE(std::signbit(message.applied[6]));
  EXPECT_EQ(message.premise[31], 0.1);
  EXPECT_EQ(message.level, 1.25);
}

TEST(Messages, keep_every_bit_of_a_double) {
  command_v2 sent = sealed_message<command_v2>();
  const double values[] = {
      0.1,    -0.0,  std::numeric_limits<double>::denorm_min(), std::numeric_limits<double>::infinity(), 1.0 / 3.0,
      -1e308, 5e-324};
  std::copy(std::begin(values), std::end(values), sent.torque_nm);
  Packet packet;
  encode(sent, packet);
  command_v2 received{};
  ASSERT_EQ(decode(packet.bytes.data(), static_cast<std::size_t>(packet.size), kIdentity, received),
            DecodeStatus::kAccepted);
  for (int j = 0; j < kMaxJoints; ++j) {
    EXPECT_EQ(received.torque_nm[j], values[j]);
    EXPECT_EQ(std::signbit(received.torque_nm[j]), std::signbit(values[j]));
  }
}

TEST(Messages, when_refused_expect_the_target_untouched) {
  Packet packet;
  encode(sealed_message<command_v2>(), packet);
  command_v2 target{};
  target.seq = 99;
  packet.bytes[20] ^= 1u;
  decode(packet.bytes.data(), static_cast<std::size_t>(packet.size), kIdentity, target);
  EXPECT_EQ(target.seq, 99);
}

TEST(Messages, when_of_another_session_expect_it_to_say_of_which) {
  Packet packet;
  encode(sealed_message<command_v2>(), packet);
  command_v2 target{};
  EXPECT_EQ(decode(packet.bytes.data(), static_cast<std::size_t>(packet.size), {0, 0, 3}, target),
            DecodeStatus::kWrongSession);
  EXPECT_EQ(target.session, kIdentity.session);
}

/// A message in which one number was set to something that no side sends.
template <class Message, class Value>
DecodeStatus status_with(Value Message::*member, Value value, std::int64_t period_ns = 1'000'000) {
  Message message = sealed_message<Message>();
  message.*member = value;
  Packet packet;
  encode(message, packet);
  WireIdentity identity = kIdentity;
  identity.period_ns = period_ns;
  return decode_status<Message>(packet, identity);
}

constexpr std::int64_t kLowest = std::numeric_limits<std::int64_t>::min();
constexpr std::int64_t kHighest = std::numeric_limits<std::int64_t>::max();

TYPED_TEST(EveryMessage, when_a_number_of_it_is_beyond_what_any_side_sends_expect_it_refused) {
  for (const std::int64_t value : {kLowest, std::int64_t{-1}, kHighest}) {
    EXPECT_EQ(status_with(&TypeParam::utime, value), DecodeStatus::kOutOfBounds) << value;
    EXPECT_EQ(status_with(&TypeParam::seq, value), DecodeStatus::kOutOfBounds) << value;
    if constexpr (!kIsTelemetry<TypeParam>) {
      EXPECT_EQ(status_with(&TypeParam::period_ns, value), DecodeStatus::kOutOfBounds) << value;
    }
  }
  if constexpr (!kIsTelemetry<TypeParam>) {
    EXPECT_EQ(status_with(&TypeParam::mode, 2), DecodeStatus::kOutOfBounds);
    EXPECT_EQ(status_with(&TypeParam::mode, -1), DecodeStatus::kOutOfBounds);
    EXPECT_EQ(status_with(&TypeParam::mode, 1), DecodeStatus::kAccepted);
  }
}

TYPED_TEST(EveryMessage, when_its_sample_is_the_last_one_possible_expect_its_time_in_64_bits) {
  for (const std::int64_t period_ns : {std::int64_t{1}, std::int64_t{1'000'000}, std::int64_t{10'000'000'000}}) {
    const std::int64_t last = kLongestTimeNs / period_ns;
    EXPECT_EQ(status_with(&TypeParam::seq, last, period_ns), DecodeStatus::kAccepted);
    EXPECT_EQ(status_with(&TypeParam::seq, last + 1, period_ns), DecodeStatus::kOutOfBounds);
    EXPECT_LE(last + 1, kHighest / period_ns);
  }
}

TEST(Messages, when_a_code_has_no_meaning_expect_it_refused) {
  for (const std::int32_t code : {-1, 0, 6, 1 << 30}) {
    EXPECT_EQ(status_with(&event_v2::code, code), DecodeStatus::kOutOfBounds) << code;
    EXPECT_EQ(status_with(&event_v2::source, code == 6 ? 4 : code), DecodeStatus::kOutOfBounds) << code;
    EXPECT_EQ(status_with(&command_v2::state, code == 0 ? 5 : code), DecodeStatus::kOutOfBounds) << code;
    EXPECT_EQ(status_with(&signals_command_v1::state, code == 0 ? 5 : code), DecodeStatus::kOutOfBounds) << code;
    EXPECT_EQ(status_with(&measurement_v3::available, code == 0 || code == 6 ? 8 : code), DecodeStatus::kOutOfBounds);
  }
  EXPECT_EQ(status_with(&measurement_v3::available, 5), DecodeStatus::kAccepted);
}

TEST(Messages, a_sender_has_a_name_of_its_own_that_holds_the_process) {
  const std::int64_t first = new_sender();
  EXPECT_GT(first, 0);
  EXPECT_NE(first, new_sender());
  EXPECT_EQ(process_of(first), static_cast<std::int64_t>(getpid()) & 0x3FFFFF);
}

}  // namespace
}  // namespace quasilpv
