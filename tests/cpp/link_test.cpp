#include "quasilpv/link.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <random>
#include <string>
#include <vector>

#include "quasilpv/errors.hpp"
#include "quasilpv/in_process_link.hpp"
#include "quasilpv/lcm_link.hpp"
#include "quasilpv/realtime.hpp"

namespace quasilpv {
namespace {

using testing::HasSubstr;

constexpr WireIdentity kIdentity{42, -7, 3};
constexpr std::int64_t kSecond = kNanosecondsPerSecond;

measurement_v3 measurement(std::int64_t seq, double angle = 0.0) {
  measurement_v3 message{};
  message.seq = seq;
  message.angle_rad[0] = angle;
  return message;
}

class TwoEnds : public testing::Test {
 protected:
  std::pair<std::unique_ptr<InProcessLink>, std::unique_ptr<InProcessLink>> ends_ =
      InProcessLink::create_pair(kIdentity);
  InProcessLink& controller_ = *ends_.first;
  InProcessLink& plant_ = *ends_.second;
};

TEST_F(TwoEnds, carry_a_measurement_one_way_and_its_command_the_other) {
  plant_.send(measurement(4, 0.5));
  ASSERT_TRUE(controller_.receive(kSecond));
  measurement_v3 received{};
  ASSERT_TRUE(controller_.take(received));
  EXPECT_EQ(received.seq, 4);
  EXPECT_EQ(received.angle_rad[0], 0.5);

  command_v2 command{};
  command.seq = 4;
  controller_.send(command);
  ASSERT_TRUE(plant_.receive(kSecond));
  ASSERT_TRUE(plant_.take(command));
  EXPECT_EQ(command.seq, 4);
  EXPECT_EQ(command.joints, kIdentity.joints);
}

TEST_F(TwoEnds, when_nothing_arrives_expect_a_wait_that_ends) {
  const std::int64_t start_ns = monotonic_ns();
  EXPECT_FALSE(controller_.receive(20 * kNanosecondsPerMillisecond));
  EXPECT_GE(monotonic_ns() - start_ns, 20 * kNanosecondsPerMillisecond);
  measurement_v3 message{};
  EXPECT_FALSE(controller_.take(message));
}

TEST_F(TwoEnds, when_several_measurements_are_pending_expect_only_the_newest) {
  for (const std::int64_t seq : {1, 2, 3}) {
    plant_.send(measurement(seq));
  }
  ASSERT_TRUE(controller_.receive(kSecond));
  measurement_v3 received{};
  ASSERT_TRUE(controller_.take(received));
  EXPECT_EQ(received.seq, 3);
  EXPECT_FALSE(controller_.take(received));
  EXPECT_EQ(controller_.counters().accepted, 3);
  EXPECT_EQ(controller_.counters().superseded, 2);
}

TEST_F(TwoEnds, F4_when_packets_are_reordered_expect_the_old_ones_ignored_and_counted) {
  for (const std::int64_t seq : {7, 5, 6}) {
    plant_.send(measurement(seq));
  }
  controller_.receive(kSecond);
  measurement_v3 received{};
  ASSERT_TRUE(controller_.take(received));
  EXPECT_EQ(received.seq, 7);
  EXPECT_EQ(controller_.counters().old, 2);
}

TEST_F(TwoEnds, F4_when_a_measurement_is_repeated_expect_it_counted_and_offered_again) {
  measurement_v3 received{};
  for (int i = 0; i < 3; ++i) {
    plant_.send(measurement(9));
    controller_.receive(kSecond);
    EXPECT_TRUE(controller_.take(received));
  }
  EXPECT_EQ(controller_.counters().accepted, 1);
  EXPECT_EQ(controller_.counters().duplicates, 2);
}

TEST_F(TwoEnds, F4_when_a_duplicate_differs_expect_the_first_one_kept) {
  plant_.send(measurement(9, 1.0));
  plant_.send(measurement(9, 2.0));
  controller_.receive(kSecond);
  measurement_v3 received{};
  ASSERT_TRUE(controller_.take(received));
  EXPECT_EQ(received.angle_rad[0], 1.0);
  EXPECT_EQ(controller_.counters().duplicates, 0);
  EXPECT_EQ(controller_.counters().second_sender, 1);
  EXPECT_EQ(controller_.peers().take_conflict(), Conflict::kSecondPlant);
}

TEST_F(TwoEnds, F5_when_foreign_messages_arrive_expect_a_run_of_them_counted_until_a_good_one) {
  measurement_v3 foreign = measurement(1);
  foreign.joints = kIdentity.joints;
  Packet packet;
  foreign.session = kIdentity.session + 1;
  foreign.artifact_hash = kIdentity.artifact_hash;
  encode(foreign, packet);
  controller_.inject(Channel::kMeasurement, packet.bytes.data(), static_cast<std::size_t>(packet.size));
  foreign.session = kIdentity.session;
  foreign.artifact_hash = kIdentity.artifact_hash + 1;
  encode(foreign, packet);
  controller_.inject(Channel::kMeasurement, packet.bytes.data(), static_cast<std::size_t>(packet.size));
  controller_.receive(kSecond);
  EXPECT_EQ(controller_.counters().wrong_session, 1);
  EXPECT_EQ(controller_.counters().wrong_artifact, 1);
  EXPECT_EQ(controller_.counters().consecutive_wrong, 2);

  plant_.send(measurement(1));
  controller_.receive(kSecond);
  EXPECT_EQ(controller_.counters().consecutive_wrong, 0);
  EXPECT_EQ(controller_.counters().accepted, 1);
}

Packet foreign_measurement() {
  measurement_v3 foreign = measurement(1);
  foreign.joints = kIdentity.joints;
  foreign.session = kIdentity.session + 1;
  foreign.artifact_hash = kIdentity.artifact_hash;
  Packet packet;
  encode(foreign, packet);
  return packet;
}

TEST_F(TwoEnds, F5_when_a_good_message_ends_a_foreign_run_in_the_same_drain_expect_the_run_still_seen_once) {
  const Packet packet = foreign_measurement();
  for (int i = 0; i < 30; ++i) {
    controller_.inject(Channel::kMeasurement, packet.bytes.data(), static_cast<std::size_t>(packet.size));
  }
  plant_.send(measurement(1));
  controller_.receive(kSecond);
  EXPECT_EQ(controller_.take_longest_wrong_run(), 30);
  EXPECT_EQ(controller_.take_longest_wrong_run(), 0);
}

TEST_F(TwoEnds, F6_when_a_message_is_truncated_anywhere_or_of_another_type_expect_it_counted_and_not_accepted) {
  measurement_v3 whole = measurement(1);
  whole.joints = kIdentity.joints;
  whole.session = kIdentity.session;
  whole.artifact_hash = kIdentity.artifact_hash;
  Packet packet;
  encode(whole, packet);
  for (int size = 0; size < packet.size; ++size) {
    controller_.inject(Channel::kMeasurement, packet.bytes.data(), static_cast<std::size_t>(size));
    controller_.receive(0);
  }
  EXPECT_EQ(controller_.counters().wrong_length, packet.size);
  command_v2 command{};
  encode(command, packet);
  controller_.inject(Channel::kMeasurement, packet.bytes.data(), static_cast<std::size_t>(packet.size));
  controller_.receive(0);
  EXPECT_EQ(controller_.counters().wrong_length, measurement_v3{}.getEncodedSize() + 1);
  EXPECT_EQ(controller_.counters().accepted, 0);
}

TEST_F(TwoEnds, when_several_events_arrive_at_once_expect_all_of_them_in_order) {
  plant_.send(measurement(8));
  plant_.send(EventCode::kStarted, 0);
  plant_.send(EventCode::kEnded, 9);
  controller_.receive(kSecond);
  event_v2 event{};
  ASSERT_TRUE(controller_.take(event));
  EXPECT_EQ(event.code, static_cast<std::int32_t>(EventCode::kStarted));
  ASSERT_TRUE(controller_.take(event));
  EXPECT_EQ(event.code, static_cast<std::int32_t>(EventCode::kEnded));
  EXPECT_FALSE(controller_.take(event));
}

TEST_F(TwoEnds, when_more_events_wait_than_are_kept_expect_the_loss_counted) {
  for (int i = 0; i < 11; ++i) {
    plant_.send(EventCode::kStarted, i);
  }
  controller_.receive(kSecond);
  EXPECT_EQ(controller_.counters().lost_events, 3);
}

TEST_F(TwoEnds, F6_when_random_bytes_arrive_expect_each_counted_and_none_accepted) {
  std::mt19937 random(3);
  constexpr int kPackets = 100'000;
  std::vector<std::uint8_t> noise(100 * kMaxMessageBytes);
  for (std::uint8_t& byte : noise) {
    byte = static_cast<std::uint8_t>(random());
  }
  for (int i = 0; i < kPackets; ++i) {
    const std::uint8_t* bytes = noise.data() + random() % (noise.size() - kMaxMessageBytes);
    // Every other packet has the right length, so that the checks behind the length see random bytes too.
    const auto right = static_cast<std::size_t>(measurement_v3{}.getEncodedSize());
    const std::size_t size = i % 2 == 0 ? right : random() % kMaxMessageBytes;
    controller_.inject(Channel::kMeasurement, bytes, size);
    controller_.receive(0);
  }
  const LinkCounters& counted = controller_.counters();
  EXPECT_EQ(counted.accepted, 0);
  EXPECT_EQ(counted.wrong_length + counted.wrong_checksum + counted.wrong_type + counted.wrong_session, kPackets);
  EXPECT_GT(counted.wrong_length, 0);
  EXPECT_GE(counted.wrong_checksum, kPackets / 2);
}

TEST_F(TwoEnds, when_the_queue_is_full_expect_the_newest_dropped_and_counted) {
  for (std::size_t i = 0; i < InProcessLink::kQueueCapacity + 3; ++i) {
    plant_.send(measurement(static_cast<std::int64_t>(i)));
  }
  EXPECT_EQ(plant_.counters().send_failures, 3);
  controller_.receive(kSecond);
  EXPECT_EQ(controller_.counters().accepted, static_cast<std::int64_t>(InProcessLink::kQueueCapacity));
}

TEST_F(TwoEnds, tell_each_other_of_events_with_their_detail) {
  controller_.send(command_v2{});
  controller_.send(EventCode::kFault, 17, 2);
  ASSERT_TRUE(plant_.receive(kSecond));
  event_v2 event{};
  ASSERT_TRUE(plant_.take(event));
  EXPECT_EQ(event.code, static_cast<std::int32_t>(EventCode::kFault));
  EXPECT_EQ(event.source, static_cast<std::int32_t>(Side::kController));
  EXPECT_EQ(event.seq, 17);
  EXPECT_EQ(event.detail[0], 2);
}

/// A port of this process's own, so that parallel tests do not hear each other.
std::string own_url(int ttl = 0) {
  return "udpm://239.255.76.67:" + std::to_string(20000 + getpid() % 40000) + "?ttl=" + std::to_string(ttl);
}

TEST(LcmLink, carries_messages_between_two_ends_and_ignores_its_own_events) {
  LcmLink controller(Side::kController, kIdentity, own_url(), false);
  LcmLink plant(Side::kPlant, kIdentity, own_url(), false);
  plant.send(EventCode::kStarted, 0);
  plant.send(measurement(3, 0.25));
  measurement_v3 received{};
  event_v2 event{};
  bool measured = false;
  bool told = false;
  for (int tries = 0; tries < 100 && !(measured && told); ++tries) {
    controller.receive(50 * kNanosecondsPerMillisecond);
    measured = controller.take(received) || measured;
    told = controller.take(event) || told;
  }
  ASSERT_TRUE(measured);
  ASSERT_TRUE(told);
  EXPECT_EQ(received.seq, 3);
  EXPECT_EQ(received.angle_rad[0], 0.25);
  plant.receive(50 * kNanosecondsPerMillisecond);
  EXPECT_FALSE(plant.take(event));
}

std::string refusal_of(const std::string& url, bool allow_network) {
  try {
    LcmLink link(Side::kPlant, kIdentity, url, allow_network);
  } catch (const InputError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(LcmLink, when_packets_could_leave_the_machine_expect_refusal_without_a_flag) {
  EXPECT_THAT(refusal_of(own_url(1), false), HasSubstr("--allow-network"));
  EXPECT_EQ(refusal_of(own_url(1), true), "accepted");
}

TEST(LcmLink, when_the_url_is_malformed_expect_one_line_that_says_so) {
  for (const char* url : {"", "udpm://", "memq://", "tcpq://127.0.0.1:7700", "udpm://127.0.0.1:7667?ttl=0",
                          "udpm://239.255.76.67:7667?ttl=-1", "udpm://239.255.76.67:70000?ttl=0",
                          "udpm://239.255.76.67:7667?ttl=256", "udpm://239.255.76.67:7667?ttl=0&ttl=1",
                          "udpm://239.255.76.67", "udpm://239.255.76.67:", "udpm://239.255.76.67:7667?ttl=",
                          "udpm://239.255.76.67:7667?", "udpm://239.255.76.67:7667 ", "udpm://239.255:76:7667"}) {
    const std::string refusal = refusal_of(url, true);
    EXPECT_THAT(refusal, HasSubstr("expected")) << url;
    EXPECT_EQ(refusal.find('\n'), std::string::npos) << url;
  }
}

}  // namespace
}  // namespace quasilpv
