#include "quasilpv/messages.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "quasilpv/crc32.hpp"

namespace quasilpv {
namespace {

constexpr WireIdentity kIdentity{42, -7, 3};

template <class Message>
Message sealed_message() {
  Message message{};
  message.seq = 5;
  message.session = kIdentity.session;
  message.artifact_hash = kIdentity.artifact_hash;
  if constexpr (!std::is_same_v<Message, event_v1>) {
    message.joints = kIdentity.joints;
  }
  return message;
}

template <class Message>
DecodeStatus decode_status(const Packet& packet, const WireIdentity& identity = kIdentity) {
  Message message{};
  return decode(packet.bytes.data(), static_cast<std::size_t>(packet.size), identity, message);
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
using Messages = testing::Types<measurement_v1, command_v1, telemetry_v1, event_v1>;
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
  EXPECT_EQ(decode_status<TypeParam>(packet, {43, -7, 3}), DecodeStatus::kWrongSession);
  EXPECT_EQ(decode_status<TypeParam>(packet, {42, 7, 3}), DecodeStatus::kWrongArtifact);
}

TEST(Messages, when_the_number_of_joints_differs_expect_the_artifact_refused) {
  Packet packet;
  encode(sealed_message<measurement_v1>(), packet);
  EXPECT_EQ(decode_status<measurement_v1>(packet, {42, -7, 2}), DecodeStatus::kWrongArtifact);
}

TEST(Messages, keep_every_bit_of_a_double) {
  command_v1 sent = sealed_message<command_v1>();
  const double values[] = {
      0.1,    -0.0,  std::numeric_limits<double>::denorm_min(), std::numeric_limits<double>::infinity(), 1.0 / 3.0,
      -1e308, 5e-324};
  std::copy(std::begin(values), std::end(values), sent.torque_nm);
  Packet packet;
  encode(sent, packet);
  command_v1 received{};
  ASSERT_EQ(decode(packet.bytes.data(), static_cast<std::size_t>(packet.size), kIdentity, received),
            DecodeStatus::kAccepted);
  for (int j = 0; j < kMaxJoints; ++j) {
    EXPECT_EQ(received.torque_nm[j], values[j]);
    EXPECT_EQ(std::signbit(received.torque_nm[j]), std::signbit(values[j]));
  }
}

TEST(Messages, when_refused_expect_the_target_untouched) {
  Packet packet;
  encode(sealed_message<command_v1>(), packet);
  command_v1 target{};
  target.seq = 99;
  decode(packet.bytes.data(), static_cast<std::size_t>(packet.size), {0, 0, 3}, target);
  EXPECT_EQ(target.seq, 99);
}

}  // namespace
}  // namespace quasilpv
