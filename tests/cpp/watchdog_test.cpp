// A silence of exactly the hold time is held, one nanosecond more is not.
#include "quasilpv/watchdog.hpp"

#include <gtest/gtest.h>

namespace quasilpv {
namespace {

constexpr std::int64_t kPeriodNs = 1'000'000;
constexpr std::int64_t kHoldNs = 20'000'000;

std::int64_t held_samples(std::int64_t delay_ns, std::int64_t hold_ns) {
  Watchdog watchdog(hold_ns, kPeriodNs);
  watchdog.command_at(delay_ns);
  std::int64_t held = 0;
  while (!watchdog.takes_over()) {
    ++held;
  }
  return held;
}

TEST(Watchdog, when_the_last_command_acts_at_the_end_of_its_sample_expect_the_whole_hold_time) {
  // Twenty times 0.001 s is more than 0.02 s in floating point: this is why the time is counted in nanoseconds.
  EXPECT_EQ(held_samples(kPeriodNs, kHoldNs), 20);
  EXPECT_EQ(held_samples(kPeriodNs, kHoldNs - 1), 19);
}

TEST(Watchdog, F26_when_the_process_did_not_run_for_longer_than_the_hold_time_expect_the_brake_until_the_next_command) {
  Watchdog watchdog(kHoldNs, kPeriodNs);
  watchdog.command_at(0);
  watchdog.stalled();
  EXPECT_TRUE(watchdog.takes_over());
  EXPECT_TRUE(watchdog.takes_over());
  watchdog.command_at(0);
  EXPECT_FALSE(watchdog.takes_over());
}

TEST(Watchdog, counts_from_the_moment_the_command_acted) {
  EXPECT_EQ(held_samples(0, kHoldNs), 19);
  EXPECT_EQ(held_samples(0, kHoldNs - 1), 18);
  EXPECT_EQ(held_samples(1, kHoldNs), 19);
}

TEST(Watchdog, a_command_ends_the_silence) {
  Watchdog watchdog(kHoldNs, kPeriodNs);
  for (int k = 0; k < 1000; ++k) {
    watchdog.command_at(kPeriodNs / 2);
    for (int silent = 0; silent < 19; ++silent) {
      ASSERT_FALSE(watchdog.takes_over());
    }
  }
  EXPECT_TRUE(watchdog.takes_over());
}

}  // namespace
}  // namespace quasilpv
