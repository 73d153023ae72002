#include "quasilpv/latency_histogram.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace quasilpv {
namespace {

TEST(LatencyHistogram, bounds_every_quantile_from_above_within_3_2_percent) {
  std::mt19937_64 random(5);
  std::lognormal_distribution<double> latency(10.0, 2.0);
  LatencyHistogram histogram;
  std::vector<std::int64_t> values(20'000);
  for (std::int64_t& value : values) {
    value = std::llround(latency(random));
    histogram.add(value);
  }
  std::sort(values.begin(), values.end());
  for (const double fraction : {0.001, 0.5, 0.9, 0.99, 0.999, 1.0}) {
    const auto rank = static_cast<std::size_t>(std::ceil(fraction * static_cast<double>(values.size())));
    const std::int64_t exact = values[rank - 1];
    EXPECT_GE(histogram.quantile_ns(fraction), exact) << fraction;
    EXPECT_LE(static_cast<double>(histogram.quantile_ns(fraction)), 1.032 * static_cast<double>(exact)) << fraction;
  }
  EXPECT_EQ(histogram.count(), 20'000);
  EXPECT_EQ(histogram.max_ns(), values.back());
}

TEST(LatencyHistogram, is_exact_below_64_ns) {
  for (std::int64_t value = 0; value < 64; ++value) {
    LatencyHistogram histogram;
    histogram.add(value);
    histogram.add(1000);
    EXPECT_EQ(histogram.quantile_ns(0.5), value);
  }
}

TEST(LatencyHistogram, when_empty_or_out_of_range_expect_0_or_the_last_bucket) {
  LatencyHistogram histogram;
  EXPECT_EQ(histogram.quantile_ns(0.5), 0);
  histogram.add(-5);
  EXPECT_EQ(histogram.quantile_ns(1.0), 0);
  histogram.add(std::int64_t{1} << 60);
  EXPECT_EQ(histogram.max_ns(), std::int64_t{1} << 60);
  EXPECT_GT(histogram.quantile_ns(1.0), std::int64_t{1} << 39);
}

}  // namespace
}  // namespace quasilpv
