#include "quasilpv/pacer.hpp"

#include <gtest/gtest.h>

#include <random>

namespace quasilpv {
namespace {

constexpr std::int64_t kPeriod = 1'000'000;
constexpr std::int64_t kStart = 777;

TEST(Pacer, when_every_cycle_is_in_time_expect_ticks_at_every_grid_point) {
  Pacer pacer(kStart, kPeriod);
  std::int64_t now = kStart;
  for (int k = 1; k <= 100; ++k) {
    const std::int64_t tick = pacer.next(now + 3 * kPeriod / 4);
    ASSERT_EQ(tick, kStart + k * kPeriod);
    now = tick;
  }
  EXPECT_EQ(pacer.overruns(), 0);
  EXPECT_EQ(pacer.skipped_ticks(), 0);
}

struct Overrun {
  double periods;
  std::int64_t next_tick;  // in periods from the tick that overran
};

class OneOverrun : public testing::TestWithParam<Overrun> {};

TEST_P(OneOverrun, F12_continues_on_the_grid_without_a_burst) {
  Pacer pacer(kStart, kPeriod);
  const auto elapsed = static_cast<std::int64_t>(GetParam().periods * kPeriod);
  const std::int64_t tick = pacer.next(kStart + elapsed);
  EXPECT_EQ(tick, kStart + GetParam().next_tick * kPeriod);
  EXPECT_GE(tick, kStart + elapsed);
  EXPECT_EQ(pacer.overruns(), 1);
  EXPECT_EQ(pacer.consecutive_overruns(), 1);
  EXPECT_EQ(pacer.skipped_ticks(), GetParam().next_tick - 1);
  // The cycle after it is a normal one: nothing is caught up.
  EXPECT_EQ(pacer.next(tick + kPeriod / 10), tick + kPeriod);
  EXPECT_EQ(pacer.consecutive_overruns(), 0);
  EXPECT_EQ(pacer.overruns(), 1);
}

INSTANTIATE_TEST_SUITE_P(Pacer, OneOverrun,
                         testing::Values(Overrun{1.5, 2}, Overrun{2.0, 2}, Overrun{2.5, 3}, Overrun{10.0, 10}));

TEST(Pacer, F12_when_cycles_take_random_times_expect_increasing_ticks_on_the_grid_never_in_the_past) {
  std::mt19937_64 random(4);
  std::uniform_int_distribution<std::int64_t> duration(0, 5 * kPeriod);
  Pacer pacer(kStart, kPeriod);
  std::int64_t previous = kStart;
  std::int64_t grid_points = 0;
  constexpr std::int64_t kCycles = 10'000;
  for (std::int64_t i = 0; i < kCycles; ++i) {
    const std::int64_t now = previous + duration(random);
    const std::int64_t tick = pacer.next(now);
    ASSERT_EQ((tick - kStart) % kPeriod, 0);
    ASSERT_GE(tick, now);
    ASSERT_GT(tick, previous);
    ASSERT_LT(tick - now, kPeriod + (now == previous ? 1 : 0));
    grid_points += (tick - previous) / kPeriod;
    previous = tick;
  }
  EXPECT_EQ(grid_points, kCycles + pacer.skipped_ticks());
}

}  // namespace
}  // namespace quasilpv
