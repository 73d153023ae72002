// When to wake next: a policy without a clock of its own, so that tests drive it with a synthetic one.
#pragma once

#include <cstdint>

namespace quasilpv {

/// Who makes time pass.
enum class Pace {
  kLockStep,  ///< simulated time: the plant waits for the answer to each measurement
  kRealTime   ///< the monotonic clock
};

/// Ticks on the absolute grid t_0 + k T.
///
/// A cycle that overruns its period is counted and the next tick is the first grid point that is not in the past:
/// missed ticks are skipped, never caught up in a burst. Times are nanoseconds of any monotonic clock. RT-SAFE
/// (bounded, no allocation, no lock, no throw).
class Pacer {
 public:
  Pacer(std::int64_t start_ns, std::int64_t period_ns) noexcept : tick_ns_(start_ns), period_ns_(period_ns) {}

  /// Ends the cycle of the current tick at time `now_ns`; returns the time of the next tick, which becomes current.
  std::int64_t next(std::int64_t now_ns) noexcept {
    const std::int64_t elapsed = now_ns - tick_ns_;
    if (elapsed <= period_ns_) {
      consecutive_overruns_ = 0;
      tick_ns_ += period_ns_;
      return tick_ns_;
    }
    const std::int64_t periods = (elapsed + period_ns_ - 1) / period_ns_;
    ++overruns_;
    ++consecutive_overruns_;
    skipped_ticks_ += periods - 1;
    tick_ns_ += periods * period_ns_;
    return tick_ns_;
  }

  std::int64_t tick_ns() const noexcept { return tick_ns_; }
  std::int64_t overruns() const noexcept { return overruns_; }
  std::int64_t consecutive_overruns() const noexcept { return consecutive_overruns_; }
  std::int64_t skipped_ticks() const noexcept { return skipped_ticks_; }

 private:
  std::int64_t tick_ns_;
  std::int64_t period_ns_;
  std::int64_t overruns_ = 0;
  std::int64_t consecutive_overruns_ = 0;
  std::int64_t skipped_ticks_ = 0;
};

}  // namespace quasilpv
