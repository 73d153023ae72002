// What led to a fault: the last samples before it, kept when it happens.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "quasilpv/telemetry_sample.hpp"

namespace quasilpv {

/// Ring of the last 50 samples, the one that latched the fault included. keep() sets them aside until the next fault.
/// RT-SAFE (bounded, no allocation, no lock, no throw).
///
/// @tparam Sample  trivially copyable
template <class Sample>
class LastSamples {
 public:
  static constexpr std::size_t kCapacity = 50;

  void add(const Sample& sample) noexcept {
    recent_[next_] = sample;
    next_ = (next_ + 1) % kCapacity;
    count_ = count_ < kCapacity ? count_ + 1 : kCapacity;
  }

  /// Sets the samples aside as those of a fault.
  void keep() noexcept {
    kept_count_ = count_;
    for (std::size_t i = 0; i < count_; ++i) {
      kept_[i] = recent_[(next_ + kCapacity - count_ + i) % kCapacity];
    }
  }

  /// Number of samples set aside, 0 without a fault.
  std::size_t size() const noexcept { return kept_count_; }
  /// Sample i of those set aside, the oldest first; i < size().
  const Sample& operator[](std::size_t i) const noexcept { return kept_[i]; }

 private:
  std::array<Sample, kCapacity> recent_{};
  std::array<Sample, kCapacity> kept_{};
  std::size_t next_ = 0;
  std::size_t count_ = 0;
  std::size_t kept_count_ = 0;
};

/// Those of a robot.
using PostMortem = LastSamples<TelemetrySample>;

}  // namespace quasilpv
