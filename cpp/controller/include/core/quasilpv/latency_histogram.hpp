// Latencies of a run of any length in constant memory.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

namespace quasilpv {

/// Counts durations in buckets that are exact below 64 ns and 1/32 of their value wide above: a quantile is at most 3.2
/// % too high, never too low, and the maximum is exact. Durations below 0 count as 0, those above 2^40 ns (18 minutes)
/// share the last bucket. RT-SAFE (bounded, no allocation, no lock, no throw).
class LatencyHistogram {
 public:
  void add(std::int64_t duration_ns) noexcept {
    const std::int64_t value = std::max<std::int64_t>(duration_ns, 0);
    ++counts_[bucket_of(value)];
    ++count_;
    max_ns_ = std::max(max_ns_, value);
  }

  std::int64_t count() const noexcept { return count_; }
  std::int64_t max_ns() const noexcept { return max_ns_; }

  /// Smallest bound such that a share `fraction` of all durations lies at or below it; 0 if there are none.
  std::int64_t quantile_ns(double fraction) const noexcept {
    const double target = fraction * static_cast<double>(count_);
    std::int64_t seen = 0;
    for (int bucket = 0; bucket < kBuckets; ++bucket) {
      seen += counts_[bucket];
      if (seen > 0 && static_cast<double>(seen) >= target) {
        return std::min(upper_bound_of(bucket), max_ns_);
      }
    }
    return max_ns_;
  }

 private:
  // The 32 sub-buckets of [2^e, 2^(e+1)) follow each other; values below 64 are their own bucket.
  static constexpr int kSubBits = 5;
  static constexpr int kMaxExponent = 40;
  static constexpr int kBuckets = (kMaxExponent - kSubBits + 1) << kSubBits;

  static int bucket_of(std::int64_t value) noexcept {
    int shift = 0;
    while ((value >> shift) >= (2 << kSubBits)) {
      ++shift;
    }
    return std::min(static_cast<int>(value >> shift) + (shift << kSubBits), kBuckets - 1);
  }

  static std::int64_t upper_bound_of(int bucket) noexcept {
    if (bucket < (2 << kSubBits)) {
      return bucket;
    }
    const int shift = (bucket >> kSubBits) - 1;
    const std::int64_t mantissa = bucket - (shift << kSubBits);
    return ((mantissa + 1) << shift) - 1;
  }

  std::array<std::int64_t, kBuckets> counts_{};
  std::int64_t count_ = 0;
  std::int64_t max_ns_ = 0;
};

}  // namespace quasilpv
