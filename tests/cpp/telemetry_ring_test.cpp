#include "quasilpv/telemetry_ring.hpp"

#include <gtest/gtest.h>

#include <array>
#include <thread>

namespace quasilpv {
namespace {

TEST(TelemetryRing, returns_elements_in_order_and_reports_empty) {
  TelemetryRing<int, 4> ring;
  int value = 0;
  EXPECT_FALSE(ring.pop(value));
  EXPECT_TRUE(ring.push(1));
  EXPECT_TRUE(ring.push(2));
  EXPECT_TRUE(ring.pop(value));
  EXPECT_EQ(value, 1);
  EXPECT_TRUE(ring.pop(value));
  EXPECT_EQ(value, 2);
  EXPECT_FALSE(ring.pop(value));
}

TEST(TelemetryRing, when_full_expect_the_new_element_dropped_and_counted_and_the_old_ones_kept) {
  TelemetryRing<int, 4> ring;
  for (int i = 0; i < 7; ++i) {
    EXPECT_EQ(ring.push(i), i < 4);
  }
  EXPECT_EQ(ring.drops(), 3);
  for (int i = 0; i < 4; ++i) {
    int value = -1;
    ASSERT_TRUE(ring.pop(value));
    EXPECT_EQ(value, i);
  }
}

TEST(TelemetryRing, when_indices_wrap_around_expect_no_difference) {
  TelemetryRing<int, 4> ring;
  for (int i = 0; i < 1000; ++i) {
    ASSERT_TRUE(ring.push(i));
    int value = -1;
    ASSERT_TRUE(ring.pop(value));
    ASSERT_EQ(value, i);
  }
  EXPECT_EQ(ring.drops(), 0);
}

TEST(TelemetryRing, when_two_threads_share_it_expect_every_element_whole_and_in_order_or_counted) {
  // A torn element would mix two numbers.
  using Block = std::array<std::int64_t, 32>;
  static constexpr std::int64_t kCount = 200'000;
  TelemetryRing<Block, 64> ring;
  std::int64_t attempts = 0;
  std::thread producer([&attempts, &ring] {
    Block block;
    for (std::int64_t i = 0; i < kCount; ++i, ++attempts) {
      block.fill(i);
      ring.push(block);
    }
    block.fill(kCount);
    for (bool pushed = false; !pushed; ++attempts) {
      pushed = ring.push(block);
    }
  });
  std::int64_t received = 0;
  std::int64_t previous = -1;
  Block block{};
  while (previous < kCount) {
    if (!ring.pop(block)) {
      std::this_thread::yield();
      continue;
    }
    for (const std::int64_t value : block) {
      ASSERT_EQ(value, block[0]);
    }
    ASSERT_GT(block[0], previous);
    previous = block[0];
    ++received;
  }
  producer.join();
  EXPECT_EQ(received + ring.drops(), attempts);
  EXPECT_GT(received, 1);
}

}  // namespace
}  // namespace quasilpv
