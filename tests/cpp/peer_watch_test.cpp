// Who is speaking: one run has two members, whoever else talks.
#include "quasilpv/peer_watch.hpp"

#include <gtest/gtest.h>

#include <random>
#include <set>

namespace quasilpv {
namespace {

constexpr std::int64_t kPeriod = 1'000'000;

Speaker speaker(std::int64_t sender, Pace pace = Pace::kRealTime, std::int64_t period_ns = kPeriod) {
  return {sender, pace, period_ns};
}

PeerWatch watch(Side side, Pace pace = Pace::kRealTime) { return {side, pace, kPeriod}; }

TEST(PeerWatch, the_first_sender_is_the_peer_and_is_listened_to) {
  PeerWatch plant = watch(Side::kPlant);
  EXPECT_FALSE(plant.has_peer());
  EXPECT_TRUE(plant.hears(speaker(7)));
  EXPECT_EQ(plant.peer(), 7);
  EXPECT_TRUE(plant.hears(speaker(7)));
  EXPECT_EQ(plant.take_conflict(), Conflict::kNone);
}

TEST(PeerWatch, F22_in_lock_step_a_second_sender_is_a_conflict_at_once) {
  for (const Side side : {Side::kPlant, Side::kController}) {
    PeerWatch end = watch(side, Pace::kLockStep);
    EXPECT_TRUE(end.hears(speaker(7, Pace::kLockStep)));
    EXPECT_FALSE(end.hears(speaker(8, Pace::kLockStep)));
    EXPECT_EQ(end.take_conflict(), side == Side::kPlant ? Conflict::kSecondController : Conflict::kSecondPlant);
    EXPECT_EQ(end.opponent().sender, 8);
    EXPECT_EQ(end.peer(), 7);
    EXPECT_EQ(end.take_conflict(), Conflict::kNone) << "told once";
  }
}

TEST(PeerWatch, F22_in_real_time_a_second_sender_is_a_conflict_once_the_peer_is_heard_again) {
  for (const Side side : {Side::kPlant, Side::kController}) {
    PeerWatch end = watch(side);
    end.hears(speaker(7));
    for (int i = 0; i < 3; ++i) {
      EXPECT_FALSE(end.hears(speaker(8)));
      EXPECT_EQ(end.take_conflict(), Conflict::kNone) << "the peer may be dead";
    }
    EXPECT_TRUE(end.hears(speaker(7)));
    EXPECT_EQ(end.take_conflict(), side == Side::kPlant ? Conflict::kSecondController : Conflict::kSecondPlant);
    EXPECT_EQ(end.opponent().sender, 8);
  }
}

TEST(PeerWatch, a_released_peer_has_a_successor_and_is_the_second_one_when_it_speaks_again) {
  PeerWatch plant = watch(Side::kPlant);
  plant.hears(speaker(7));
  EXPECT_FALSE(plant.hears(speaker(8)));
  plant.release();
  EXPECT_TRUE(plant.hears(speaker(8)));
  EXPECT_EQ(plant.takeovers(), 1);
  EXPECT_TRUE(plant.hears(speaker(8)));
  EXPECT_EQ(plant.take_conflict(), Conflict::kNone);
  EXPECT_FALSE(plant.hears(speaker(7)));
  EXPECT_TRUE(plant.hears(speaker(8)));
  EXPECT_EQ(plant.take_conflict(), Conflict::kSecondController);
  EXPECT_EQ(plant.opponent().sender, 7);
}

TEST(PeerWatch, a_released_peer_that_speaks_first_keeps_its_place) {
  PeerWatch plant = watch(Side::kPlant);
  plant.hears(speaker(7));
  plant.release();
  EXPECT_TRUE(plant.hears(speaker(7)));
  EXPECT_FALSE(plant.hears(speaker(8)));
  EXPECT_EQ(plant.peer(), 7);
}

TEST(PeerWatch, F22_a_twin_is_a_conflict_that_names_it) {
  PeerWatch controller = watch(Side::kController);
  controller.hears_twin(9);
  EXPECT_EQ(controller.take_conflict(), Conflict::kSecondController);
  EXPECT_EQ(controller.opponent().sender, 9);
  PeerWatch plant = watch(Side::kPlant);
  plant.hears_twin(9);
  EXPECT_EQ(plant.take_conflict(), Conflict::kSecondPlant);
}

TEST(PeerWatch, F24_a_sender_of_another_mode_or_rate_is_refused_and_becomes_no_peer) {
  for (const Side side : {Side::kPlant, Side::kController}) {
    PeerWatch end = watch(side);
    EXPECT_FALSE(end.hears(speaker(7, Pace::kLockStep)));
    EXPECT_EQ(end.take_conflict(), Conflict::kOtherMode);
    EXPECT_EQ(end.opponent().pace, Pace::kLockStep);
    EXPECT_FALSE(end.hears(speaker(7, Pace::kRealTime, kPeriod / 2)));
    EXPECT_EQ(end.take_conflict(), Conflict::kOtherRate);
    EXPECT_EQ(end.opponent().period_ns, kPeriod / 2);
    EXPECT_FALSE(end.has_peer());
  }
  EXPECT_TRUE(watch(Side::kOperator).hears(speaker(7, Pace::kLockStep, 1))) << "a person runs in no mode";
}

/// Whatever three senders say in whatever order: only the peer of the moment is heard, it changes only after a release,
/// and two of them that are both heard after each other are a conflict.
TEST(PeerWatch, F22_no_order_of_three_senders_and_releases_mixes_two_of_them_in_silence) {
  std::mt19937 random(4);
  for (int run = 0; run < 2000; ++run) {
    const Pace pace = random() % 2 == 0 ? Pace::kLockStep : Pace::kRealTime;
    PeerWatch plant = watch(Side::kPlant, pace);
    std::int64_t heard = 0;
    std::set<std::int64_t> strangers;  // since the peer was last heard, or became it
    bool released = false;
    for (int k = 0; k < 30; ++k) {
      if (pace == Pace::kRealTime && random() % 5 == 0) {
        plant.release();
        released = plant.has_peer();
      }
      const auto sender = static_cast<std::int64_t>(1 + random() % 3);
      const bool listened = plant.hears(speaker(sender, pace));
      const bool conflict = plant.take_conflict() != Conflict::kNone;
      ASSERT_EQ(listened, heard == 0 || sender == heard || released);
      ASSERT_EQ(conflict, pace == Pace::kLockStep ? !listened : listened && sender == heard && !strangers.empty());
      if (listened) {
        heard = sender;
        released = false;
        strangers.clear();
      } else {
        strangers.insert(sender);
      }
    }
  }
}

}  // namespace
}  // namespace quasilpv
