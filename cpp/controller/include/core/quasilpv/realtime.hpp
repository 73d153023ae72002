// What the loop asks of the operating system: a clock, a sleep, memory that stays, a priority, a polite stop.
#pragma once

#include <atomic>
#include <cstdint>

namespace quasilpv {

inline constexpr std::int64_t kNanosecondsPerSecond = 1'000'000'000;
inline constexpr std::int64_t kNanosecondsPerMillisecond = 1'000'000;
inline constexpr int kMostCpus = 1024;  ///< cores a machine may have: CPU_SETSIZE

/// Seconds as whole nanoseconds, rounded to nearest; at most 127 years either way, and 0 for NaN. RT-SAFE.
std::int64_t to_nanoseconds(double seconds) noexcept;

/// CLOCK_MONOTONIC, ns: steps of the wall clock have no effect on it, and all processes of a machine share it. RT-SAFE.
std::int64_t monotonic_ns() noexcept;

/// Sleeps until monotonic_ns() >= `deadline_ns`; returns at once if it has passed, earlier if a signal arrives. RT-SAFE
/// in the sense that blocking is its purpose.
void sleep_until(std::int64_t deadline_ns) noexcept;

/// Outcome of enter_realtime().
struct RealtimeStatus {
  bool memory_locked = false;
  bool fifo = false;

  bool complete() const noexcept { return memory_locked && fifo; }
};

/// Locks all present and future memory, touches the stack once so that no page of it is missing later, and puts the
/// calling thread, and the threads it creates from then on, into SCHED_FIFO with the given priority (1..99). INIT-ONLY.
/// Without the privilege the status says so; nothing is thrown.
RealtimeStatus enter_realtime(int priority) noexcept;

/// Takes the calling thread back to normal scheduling, on any core the process had at its start. INIT-ONLY.
void leave_realtime() noexcept;

/// Keeps the calling thread, and the threads it creates from then on, on one core. False if there is no such core for
/// this process. INIT-ONLY.
bool pin_to_cpu(int cpu) noexcept;

/// Set by SIGINT, SIGTERM and SIGHUP (unless that is ignored) once the handlers are installed, which interrupt a sleep
/// or a wait. INIT-ONLY.
const std::atomic<bool>& install_stop_signals() noexcept;

}  // namespace quasilpv
