// Authenticated mode: what an attacker without the key can do, which is nothing but be counted.
#include "quasilpv/message_key.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstring>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "quasilpv/errors.hpp"
#include "quasilpv/failsafe.hpp"
#include "quasilpv/in_process_link.hpp"

namespace quasilpv {
namespace {

using ::testing::HasSubstr;

constexpr WireIdentity kIdentity{42, -7, 3};
constexpr std::size_t kTag = MessageKey::kTagBytes;

MessageKey key_of(std::uint8_t first) {
  std::array<std::uint8_t, MessageKey::kKeyBytes> secret{};
  secret[0] = first;
  return MessageKey(secret);
}

command_v2 command(std::int64_t seq) {
  command_v2 message{};
  message.seq = seq;
  message.session = kIdentity.session;
  message.artifact_hash = kIdentity.artifact_hash;
  message.joints = kIdentity.joints;
  return message;
}

Packet signed_packet(const command_v2& message, const MessageKey& key) {
  Packet packet;
  encode(message, packet);
  const auto size = static_cast<std::size_t>(packet.size);
  key.sign(packet.bytes.data(), size, packet.bytes.data() + size);
  packet.size += static_cast<int>(kTag);
  return packet;
}

class AuthenticatedEnds : public ::testing::Test {
 protected:
  AuthenticatedEnds() {
    controller_.authenticate_with(key_of(1));
    plant_.authenticate_with(key_of(1));
  }

  void inject(InProcessLink& end, Channel channel, const Packet& packet) {
    end.inject(channel, packet.bytes.data(), static_cast<std::size_t>(packet.size));
    end.receive(0);
  }

  std::pair<std::unique_ptr<InProcessLink>, std::unique_ptr<InProcessLink>> ends_ =
      InProcessLink::create_pair(kIdentity);
  InProcessLink& controller_ = *ends_.first;
  InProcessLink& plant_ = *ends_.second;
};

TEST_F(AuthenticatedEnds, with_one_key_understand_each_other) {
  measurement_v3 measurement{};
  measurement.seq = 3;
  plant_.send(measurement);
  plant_.send(EventCode::kStarted, 0);
  plant_.send(EventCode::kEnded, 9);
  controller_.receive(0);
  EXPECT_TRUE(controller_.take(measurement));
  event_v2 event;
  EXPECT_TRUE(controller_.take(event));
  EXPECT_TRUE(controller_.take(event));
  command_v2 answer = command(3);
  controller_.send(answer);
  plant_.receive(0);
  EXPECT_TRUE(plant_.take(answer));
  EXPECT_EQ(controller_.counters().not_authentic + plant_.counters().not_authentic, 0);
}

TEST_F(AuthenticatedEnds, when_100000_commands_are_forged_or_replayed_expect_none_accepted) {
  constexpr std::int64_t kNewest = 1000;
  constexpr int kAttacks = 100'000;
  std::mt19937_64 random(5);
  std::vector<Packet> recorded;
  for (std::int64_t seq = 0; seq <= kNewest; ++seq) {
    recorded.push_back(signed_packet(command(seq), key_of(1)));
    inject(plant_, Channel::kCommand, recorded.back());
  }
  command_v2 taken;
  ASSERT_TRUE(plant_.take(taken));
  ASSERT_EQ(plant_.counters().accepted, kNewest + 1);

  std::int64_t forged = 0;
  std::int64_t replayed = 0;
  for (int attack = 0; attack < kAttacks; ++attack) {
    command_v2 next = command(kNewest + 1 + attack);
    next.torque_nm[0] = 1e3;
    Packet packet = recorded[random() % recorded.size()];
    switch (attack % 5) {
      case 0:  // right in all but the key
        packet = signed_packet(next, key_of(static_cast<std::uint8_t>(2 + random() % 250)));
        break;
      case 1:  // a new message under a recorded tag
        encode(next, packet);
        packet.size += static_cast<int>(kTag);
        break;
      case 2:  // any bit of a genuine one flipped, the tag included
        packet.bytes[random() % static_cast<std::uint64_t>(packet.size)] ^=
            static_cast<std::uint8_t>(1u << random() % 8);
        break;
      case 3:  // no tag at all
        encode(next, packet);
        break;
      default:  // a genuine one again
        ++replayed;
        --forged;
    }
    ++forged;
    inject(plant_, Channel::kCommand, packet);
  }
  const LinkCounters& counted = plant_.counters();
  EXPECT_EQ(counted.accepted, kNewest + 1);
  EXPECT_EQ(counted.not_authentic, forged);
  EXPECT_EQ(counted.old + counted.duplicates, replayed);
  // The newest one may be replayed: it is what is in force already.
  if (plant_.take(taken)) {
    EXPECT_EQ(taken.seq, kNewest);
    EXPECT_EQ(taken.torque_nm[0], 0.0);
  }
}

TEST_F(AuthenticatedEnds, when_a_reset_is_replayed_expect_it_refused_and_a_new_one_accepted) {
  event_v2 reset{};
  reset.utime = 17;
  reset.session = kIdentity.session;
  reset.artifact_hash = kIdentity.artifact_hash;
  reset.source = static_cast<std::int32_t>(Side::kOperator);
  reset.code = static_cast<std::int32_t>(EventCode::kReset);
  reset.receiver = controller_.sender();
  reset.seq = 3;
  command_v2 in_fault = command(3);
  in_fault.state = static_cast<std::int32_t>(ControllerState::kFault);
  controller_.send(in_fault);
  const auto send = [&] {
    Packet packet;
    encode(reset, packet);
    const auto size = static_cast<std::size_t>(packet.size);
    key_of(1).sign(packet.bytes.data(), size, packet.bytes.data() + size);
    packet.size += static_cast<int>(kTag);
    inject(controller_, Channel::kEvent, packet);
    event_v2 event;
    return controller_.take(event);
  };
  EXPECT_TRUE(send());
  EXPECT_FALSE(send());
  EXPECT_EQ(controller_.counters().not_authentic, 1);
  ++reset.utime;
  EXPECT_TRUE(send());
}

TEST_F(AuthenticatedEnds, when_only_one_side_has_the_key_expect_neither_to_accept_the_other) {
  const auto [controller, plant] = InProcessLink::create_pair(kIdentity);
  controller->authenticate_with(key_of(1));
  plant->send(measurement_v3{});
  controller->send(command(0));
  controller->receive(0);
  plant->receive(0);
  EXPECT_EQ(controller->counters().not_authentic, 1);
  EXPECT_EQ(plant->counters().wrong_length, 1);
}

/// A file in the tests' folder with the given content and mode.
std::string key_file(const std::string& content, ::mode_t mode = 0600) {
  const std::string path = ::testing::TempDir() + "quasilpv-test.key";
  std::remove(path.c_str());
  std::ofstream(path) << content;
  chmod(path.c_str(), mode);
  return path;
}

std::string refusal_of(const std::string& path) {
  try {
    MessageKey::load(path);
  } catch (const InputError& error) {
    return error.what();
  }
  return "accepted";
}

const std::string kSecret(64, 'a');

TEST(MessageKey, when_the_file_is_private_and_holds_64_digits_expect_the_key_of_these_digits) {
  std::array<std::uint8_t, MessageKey::kKeyBytes> secret;
  secret.fill(0xaa);
  const std::string text = "any bytes";
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(text.data());
  std::array<std::uint8_t, kTag> tag{};
  MessageKey(secret).sign(bytes, text.size(), tag.data());
  for (const std::string& end : {std::string(), std::string("\n")}) {
    EXPECT_TRUE(MessageKey::load(key_file(kSecret + end)).is_authentic(bytes, text.size(), tag.data()));
  }
}

TEST(MessageKey, when_others_may_read_the_file_expect_one_line_that_says_so) {
  for (const ::mode_t mode : {0644u, 0640u, 0604u, 0700u}) {
    EXPECT_THAT(refusal_of(key_file(kSecret, mode)), HasSubstr("expected mode 0600")) << mode;
  }
}

TEST(MessageKey, when_it_is_no_key_expect_one_line_without_its_content) {
  for (const std::string& content : {std::string(), std::string(63, 'a'), std::string(65, 'a'), std::string(64, 'x'),
                                     kSecret + "\n\n", std::string(1000, 'a')}) {
    const std::string refusal = refusal_of(key_file(content));
    EXPECT_THAT(refusal, HasSubstr("expected 64 hexadecimal digits")) << content;
    EXPECT_EQ(refusal.find('\n'), std::string::npos);
    EXPECT_EQ(refusal.find("aaaa"), std::string::npos);
  }
  EXPECT_THAT(refusal_of("/nowhere.key"), HasSubstr("/nowhere.key"));
  EXPECT_THAT(refusal_of(::testing::TempDir()), HasSubstr("regular file"));
}

// The expected tag is of Python: hashlib.blake2b(b"abc", digest_size=16, key=bytes(32)).hexdigest()
TEST(MessageKey, signs_as_an_independent_implementation_of_keyed_blake2b) {
  const std::array<std::uint8_t, MessageKey::kKeyBytes> zero{};
  std::array<std::uint8_t, kTag> tag{};
  MessageKey(zero).sign(reinterpret_cast<const std::uint8_t*>("abc"), 3, tag.data());
  std::string digits;
  for (const std::uint8_t byte : tag) {
    constexpr const char* kHex = "0123456789abcdef";
    digits += {kHex[byte >> 4], kHex[byte & 15u]};
  }
  EXPECT_EQ(digits, "5f5b3b301f676e9f2ed8d0e8439807c7");
}

}  // namespace
}  // namespace quasilpv
