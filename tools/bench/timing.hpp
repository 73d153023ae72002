// How every C++ benchmark of the project measures a call, competitors included: nothing here depends on the project.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <nlohmann/json.hpp>
#include <vector>

namespace quasilpv::bench {

/// Time of a POSIX clock, ns.
inline std::int64_t clock_ns(clockid_t clock) noexcept {
  timespec now{};
  clock_gettime(clock, &now);
  return now.tv_sec * 1'000'000'000 + now.tv_nsec;
}

/// Makes the compiler believe that somebody reads `value`, so that computing it cannot be left out.
template <class Value>
void keep(const Value& value) noexcept {
  asm volatile("" : : "r"(&value) : "memory");
}

/// The smallest of `values` that is not below a share `fraction` of them. `values` must not be empty.
inline double quantile(std::vector<double> values, double fraction) {
  const auto rank = static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values[static_cast<std::size_t>(rank)];
}

/// Median time between two readings of the monotonic clock with nothing in between, ns.
inline double clock_overhead_ns() {
  constexpr int kReadings = 100'000;
  std::vector<double> gaps;
  gaps.reserve(kReadings);
  for (int i = 0; i < kReadings; ++i) {
    const std::int64_t start = clock_ns(CLOCK_MONOTONIC);
    gaps.push_back(static_cast<double>(clock_ns(CLOCK_MONOTONIC) - start));
  }
  return quantile(std::move(gaps), 0.5);
}

/// Distribution of the duration of a call, ns. Quantiles are of single calls, the clock's own time subtracted;
/// `batch` is the CPU time of a whole round divided by its calls, in which neither the clock nor other processes count.
struct Timing {
  double p50 = 0.0;
  double p99 = 0.0;
  double p999 = 0.0;
  double batch = 0.0;  ///< median over the rounds
  double clock_overhead = 0.0;
  std::size_t calls = 0;
};

/// Calls `call(i)` for i = 0 ... inputs - 1 and again, `rounds` times with a clock around every call and `rounds` times
/// with a clock around the round, after one round that nobody times: code, data and branches are warm.
///
/// @param before_round  called, untimed, before every round
template <class Call, class BeforeRound>
Timing time_calls(std::size_t inputs, int rounds, const BeforeRound& before_round, const Call& call) {
  Timing timing;
  timing.clock_overhead = clock_overhead_ns();
  std::vector<double> calls;
  std::vector<double> batches;
  calls.reserve(inputs * static_cast<std::size_t>(rounds));
  const auto untimed_round = [&] {
    before_round();
    for (std::size_t i = 0; i < inputs; ++i) {
      call(i);
    }
  };
  untimed_round();
  for (int round = 0; round < rounds; ++round) {
    before_round();
    for (std::size_t i = 0; i < inputs; ++i) {
      const std::int64_t start = clock_ns(CLOCK_MONOTONIC);
      call(i);
      const std::int64_t end = clock_ns(CLOCK_MONOTONIC);
      calls.push_back(static_cast<double>(end - start) - timing.clock_overhead);
    }
    const std::int64_t start = clock_ns(CLOCK_THREAD_CPUTIME_ID);
    untimed_round();
    const std::int64_t end = clock_ns(CLOCK_THREAD_CPUTIME_ID);
    batches.push_back(static_cast<double>(end - start) / static_cast<double>(inputs));
  }
  timing.calls = calls.size();
  timing.p50 = quantile(calls, 0.5);
  timing.p99 = quantile(calls, 0.99);
  timing.p999 = quantile(std::move(calls), 0.999);
  timing.batch = quantile(std::move(batches), 0.5);
  return timing;
}

inline nlohmann::json to_json(const Timing& timing) {
  return {{"p50_ns", timing.p50},     {"p99_ns", timing.p99},  {"p999_ns", timing.p999},
          {"batch_ns", timing.batch}, {"calls", timing.calls}, {"clock_overhead_ns", timing.clock_overhead}};
}

}  // namespace quasilpv::bench
