// From the control thread to the publisher thread without a lock.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "quasilpv/telemetry_sample.hpp"

namespace quasilpv {

/// Single-producer, single-consumer ring (Lamport 1983, with each side caching the other's index). Both operations are
/// wait-free: the producer never waits for the consumer, a full ring drops the new element and counts it.
///
/// @tparam Element   trivially copyable
/// @tparam Capacity  power of two
template <class Element, std::size_t Capacity>
class TelemetryRing {
  static_assert(std::is_trivially_copyable_v<Element>);
  static_assert(Capacity > 0 && (Capacity & (Capacity - 1)) == 0, "capacity must be a power of two");

 public:
  static constexpr std::size_t capacity() noexcept { return Capacity; }

  /// Producer only. Returns false, and counts a drop, if the ring is full. RT-SAFE (bounded, no allocation, no lock, no
  /// throw).
  bool push(const Element& element) noexcept {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    if (tail - cached_head_ == Capacity) {
      cached_head_ = head_.load(std::memory_order_acquire);
      if (tail - cached_head_ == Capacity) {
        drops_.store(drops_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
        return false;
      }
    }
    elements_[tail % Capacity] = element;
    tail_.store(tail + 1, std::memory_order_release);
    return true;
  }

  /// Consumer only. Returns false if the ring is empty. RT-SAFE (bounded, no allocation, no lock, no throw).
  bool pop(Element& element) noexcept {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (head == cached_tail_) {
      cached_tail_ = tail_.load(std::memory_order_acquire);
      if (head == cached_tail_) {
        return false;
      }
    }
    element = elements_[head % Capacity];
    head_.store(head + 1, std::memory_order_release);
    return true;
  }

  /// Elements that push() refused; any thread. RT-SAFE.
  std::int64_t drops() const noexcept { return drops_.load(std::memory_order_relaxed); }

 private:
  static constexpr std::size_t kCacheLine = 64;  // producer and consumer state never share one

  alignas(kCacheLine) std::atomic<std::size_t> tail_{0};
  std::size_t cached_head_ = 0;
  std::atomic<std::int64_t> drops_{0};
  alignas(kCacheLine) std::atomic<std::size_t> head_{0};
  std::size_t cached_tail_ = 0;
  alignas(kCacheLine) std::array<Element, Capacity> elements_{};
};

/// The telemetry of a run on its way out: four seconds of samples at 1 kHz.
using SampleRing = TelemetryRing<TelemetrySample, 4096>;

}  // namespace quasilpv
