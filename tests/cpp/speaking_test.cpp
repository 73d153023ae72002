// Two ends of a wire and somebody else who speaks on it: nothing of the latter counts, and it is counted.
#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <tuple>

#include "quasilpv/in_process_link.hpp"
#include "quasilpv/link_robot.hpp"

namespace quasilpv {
namespace {

constexpr WireIdentity kIdentity{42, -7, 3, Pace::kRealTime, 1'000'000};
constexpr std::int64_t kStranger = 12345;

MessageKey key() { return MessageKey({1, 2, 3}); }

/// A message as somebody else sends it, with the key or without.
template <class Message>
Packet packet_of(Message message, bool with_key, const WireIdentity& identity = kIdentity) {
  message.session = identity.session;
  message.artifact_hash = identity.artifact_hash;
  message.mode = static_cast<std::int32_t>(identity.pace);
  message.period_ns = identity.period_ns;
  if constexpr (!std::is_same_v<Message, event_v2>) {
    message.joints = identity.joints;
  }
  Packet packet;
  encode(message, packet);
  if (with_key) {
    const auto size = static_cast<std::size_t>(packet.size);
    key().sign(packet.bytes.data(), size, packet.bytes.data() + size);
    packet.size += static_cast<int>(MessageKey::kTagBytes);
  }
  return packet;
}

/// In the middle of a run: measurement 10 was sent and answered.
class InARun : public ::testing::TestWithParam<bool> {
 protected:
  InARun() {
    if (GetParam()) {
      controller_.authenticate_with(key());
      plant_.authenticate_with(key());
    }
    exchange(10, ControllerState::kRunning);
  }

  void exchange(std::int64_t seq, ControllerState state) {
    measurement_v3 measurement{};
    measurement.seq = seq;
    plant_.send(measurement);
    controller_.receive(0);
    controller_.take(measurement);
    command_v2 command{};
    command.seq = seq;
    command.state = static_cast<std::int32_t>(state);
    controller_.send(command);
    plant_.receive(0);
    plant_.take(command);
  }

  template <class Message>
  void say(InProcessLink& end, const Message& message, const WireIdentity& identity = kIdentity) {
    const Packet packet = packet_of(message, GetParam(), identity);
    end.inject(channel_of(message), packet.bytes.data(), static_cast<std::size_t>(packet.size));
    end.receive(0);
  }

  std::pair<std::unique_ptr<InProcessLink>, std::unique_ptr<InProcessLink>> ends_ =
      InProcessLink::create_pair(kIdentity);
  InProcessLink& controller_ = *ends_.first;
  InProcessLink& plant_ = *ends_.second;
};

INSTANTIATE_TEST_SUITE_P(Key, InARun, ::testing::Bool(),
                         [](const auto& with_key) { return with_key.param ? "with_key" : "without_key"; });

TEST_P(InARun, F23_every_event_of_a_process_that_is_not_part_of_it_is_ignored_and_counted) {
  exchange(11, ControllerState::kFault);
  for (InProcessLink* end : {&controller_, &plant_}) {
    std::int64_t counted = 0;
    for (std::int32_t source = 1; source <= 3; ++source) {
      for (std::int32_t code = 1; code <= 4; ++code) {
        for (const std::int64_t receiver : {std::int64_t{0}, kStranger}) {
          event_v2 event{};
          event.utime = 1;
          event.seq = 11;
          event.sender = kStranger;
          event.receiver = receiver;
          event.source = source;
          event.code = code;
          say(*end, event);
          EXPECT_FALSE(end->take(event)) << "source " << source << " code " << code;
          EXPECT_EQ(end->counters().unfit_events, ++counted);
          EXPECT_EQ(end->peers().take_conflict(), Conflict::kNone);
        }
      }
    }
  }
}

TEST_P(InARun, F23_an_end_of_the_plant_counts_unless_it_is_older_than_what_it_measured) {
  event_v2 ended{};
  ended.utime = 1;
  ended.sender = plant_.sender();
  ended.source = static_cast<std::int32_t>(Side::kPlant);
  ended.code = static_cast<std::int32_t>(EventCode::kEnded);
  ended.seq = 9;
  say(controller_, ended);
  event_v2 event;
  EXPECT_FALSE(controller_.take(event));
  EXPECT_EQ(controller_.counters().unfit_events, 1);
  ended.seq = 10;
  say(controller_, ended);
  EXPECT_TRUE(controller_.take(event));
}

// Of all that a controller could say before its first command, only that it started, or refuses to start here, counts.
TEST(BeforeARun, F19_the_plant_hears_a_refusal_that_is_meant_for_it_and_nothing_else) {
  const auto ends = InProcessLink::create_pair(kIdentity);
  InProcessLink& plant = *ends.second;
  std::int64_t unfit = 0;
  for (const std::int64_t receiver : {std::int64_t{0}, kStranger, plant.sender()}) {
    for (std::int32_t code = 2; code <= 4; ++code) {
      for (const FaultCause cause : {FaultCause::kNone, FaultCause::kStopRequested, FaultCause::kStartRefused}) {
        event_v2 event{};
        event.sender = ends.first->sender();
        event.receiver = receiver;
        event.source = static_cast<std::int32_t>(Side::kController);
        event.code = code;
        event.detail[0] = static_cast<std::int64_t>(cause);
        const Packet packet = packet_of(event, false);
        plant.inject(Channel::kEvent, packet.bytes.data(), static_cast<std::size_t>(packet.size));
        plant.receive(0);
        const bool counts = receiver == plant.sender() && code == static_cast<std::int32_t>(EventCode::kEnded) &&
                            cause == FaultCause::kStartRefused;
        EXPECT_EQ(plant.take(event), counts) << receiver << ' ' << code << ' ' << to_string(cause);
        EXPECT_EQ(plant.counters().unfit_events, unfit += counts ? 0 : 1);
      }
    }
  }
}

TEST_P(InARun, F22_a_measurement_of_a_second_plant_never_reaches_the_law_and_is_a_fault_once_the_first_goes_on) {
  LinkRobot robot(controller_);
  measurement_v3 other{};
  other.sender = kStranger;
  other.angle_rad[0] = 9.0;
  for (const std::int64_t seq : {0, 10, 11, 1000}) {
    other.seq = seq;
    say(controller_, other);
    EXPECT_FALSE(controller_.take(other)) << seq;
    EXPECT_EQ(robot.take_fault(), FaultCause::kNone);
  }
  EXPECT_EQ(controller_.counters().second_sender, 4);
  measurement_v3 next{};
  next.seq = 11;
  plant_.send(next);
  RobotReading reading;
  ASSERT_TRUE(robot.read(reading, 0));
  EXPECT_EQ(reading.angle_rad[0], 0.0);
  EXPECT_EQ(robot.take_fault(), FaultCause::kSecondPlant);
  EXPECT_EQ(controller_.peers().opponent().sender, kStranger);
}

TEST_P(InARun, F22_a_duplicate_with_other_bytes_is_a_second_sender_although_it_uses_the_name_of_the_first) {
  command_v2 other{};
  other.utime = 1;
  other.seq = 10;
  other.sender = controller_.sender();
  other.receiver = plant_.sender();
  other.state = static_cast<std::int32_t>(ControllerState::kRunning);
  say(plant_, other);
  EXPECT_EQ(plant_.peers().take_conflict(), Conflict::kNone) << "the same bytes but for the time: a repetition";
  EXPECT_EQ(plant_.counters().duplicates, 1);
  EXPECT_TRUE(plant_.take(other));
  other.torque_nm[2] = -0.0;
  say(plant_, other);
  EXPECT_EQ(plant_.peers().take_conflict(), Conflict::kSecondController);
  EXPECT_EQ(plant_.counters().second_sender, 1);
  EXPECT_FALSE(plant_.take(other));
}

TEST_P(InARun, F22_a_command_for_another_plant_says_that_there_is_one) {
  command_v2 other{};
  other.seq = 11;
  other.sender = controller_.sender();
  other.receiver = kStranger;
  say(plant_, other);
  EXPECT_FALSE(plant_.take(other));
  EXPECT_EQ(plant_.peers().take_conflict(), Conflict::kSecondPlant);
  EXPECT_EQ(plant_.peers().opponent().sender, kStranger);
}

class BeforeARun : public InARun {
 protected:
  std::pair<std::unique_ptr<InProcessLink>, std::unique_ptr<InProcessLink>> fresh_ =
      InProcessLink::create_pair(kIdentity);
};

INSTANTIATE_TEST_SUITE_P(Key, BeforeARun, ::testing::Values(false), [](const auto&) { return "without_key"; });

TEST_P(BeforeARun, F22_a_twin_that_starts_or_says_so_ends_both) {
  for (const EventCode code : {EventCode::kStarted, EventCode::kFault, EventCode::kEnded}) {
    event_v2 event{};
    event.sender = kStranger;
    event.source = static_cast<std::int32_t>(Side::kController);
    event.code = static_cast<std::int32_t>(code);
    say(*fresh_.first, event);
    EXPECT_EQ(fresh_.first->peers().take_conflict(),
              code == EventCode::kEnded ? Conflict::kNone : Conflict::kSecondController);
  }
}

TEST_P(BeforeARun, F24_the_other_mode_or_rate_is_refused_from_any_message_and_by_both) {
  WireIdentity other_mode = kIdentity;
  other_mode.pace = Pace::kLockStep;
  WireIdentity other_rate = kIdentity;
  other_rate.period_ns = 500'000;
  WireIdentity other_artifact = other_rate;
  other_artifact.artifact_hash = 8;
  event_v2 ended{};
  ended.code = static_cast<std::int32_t>(EventCode::kEnded);
  for (const auto& [identity, conflict] :
       {std::pair{other_mode, Conflict::kOtherMode}, {other_rate, Conflict::kOtherRate}}) {
    say(*fresh_.first, measurement_v3{}, identity);
    EXPECT_EQ(fresh_.first->peers().take_conflict(), conflict);
    ended.source = static_cast<std::int32_t>(Side::kPlant);
    say(*fresh_.first, ended, identity);
    EXPECT_EQ(fresh_.first->peers().take_conflict(), conflict);
    say(*fresh_.second, command_v2{}, identity);
    EXPECT_EQ(fresh_.second->peers().take_conflict(), conflict);
    ended.source = static_cast<std::int32_t>(Side::kController);
    say(*fresh_.second, ended, identity);
    EXPECT_EQ(fresh_.second->peers().take_conflict(), conflict);
  }
  EXPECT_EQ(fresh_.first->counters().other_mode, 2);
  say(*fresh_.first, measurement_v3{}, other_artifact);
  EXPECT_EQ(fresh_.first->peers().take_conflict(), Conflict::kOtherRate);
  EXPECT_EQ(fresh_.first->counters().wrong_artifact, 1);
  LinkRobot robot(*fresh_.first);
  say(*fresh_.first, measurement_v3{}, other_mode);
  EXPECT_EQ(robot.take_request(), RobotRequest::kRefuse);
}

TEST_P(BeforeARun, another_run_on_the_same_address_is_known_by_its_session) {
  EXPECT_EQ(fresh_.first->foreign_session(), std::nullopt);
  WireIdentity other_session = kIdentity;
  other_session.session = 43;
  say(*fresh_.first, measurement_v3{}, other_session);
  EXPECT_EQ(fresh_.first->foreign_session(), 43);
}

}  // namespace
}  // namespace quasilpv
