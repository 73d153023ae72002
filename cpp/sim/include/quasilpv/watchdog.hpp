// The drive's watchdog: how long a torque acts that no command renews.
#pragma once

#include <algorithm>
#include <cstdint>

namespace quasilpv {

/// Counts plant time without a command and says when the last torque must no longer act. In nanoseconds: a silence of
/// exactly the hold time is still held, whatever a sum of sample periods in floating point would make of it.
class Watchdog {
 public:
  Watchdog(std::int64_t hold_ns, std::int64_t period_ns) noexcept : hold_ns_(hold_ns), period_ns_(period_ns) {}

  /// A command acts from `delay_ns` after the start of this sample.
  void command_at(std::int64_t delay_ns) noexcept { silent_ns_ = period_ns_ - delay_ns; }

  /// This process did not run for longer than the hold time: a torque of before is too old, whatever the plant's clock
  /// says.
  void stalled() noexcept { silent_ns_ = std::max(silent_ns_, hold_ns_); }

  /// A sample without a command.
  /// @return true if the silence outlasts the hold time before the sample ends: the watchdog takes the whole sample
  bool takes_over() noexcept {
    silent_ns_ += period_ns_;
    return silent_ns_ > hold_ns_;
  }

 private:
  std::int64_t hold_ns_;
  std::int64_t period_ns_;
  std::int64_t silent_ns_ = 0;
};

}  // namespace quasilpv
