#include "quasilpv/realtime.hpp"

#include <sched.h>
#include <sys/mman.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <ctime>

namespace quasilpv {
namespace {

std::atomic<bool> g_stop_requested{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may only touch lock-free atomics");

cpu_set_t cores_at_start() noexcept {
  cpu_set_t cores;
  CPU_ZERO(&cores);
  sched_getaffinity(0, sizeof(cores), &cores);
  return cores;
}

const cpu_set_t g_cores_at_start = cores_at_start();

void touch_stack() noexcept {
  constexpr std::size_t kPageBytes = 4096;
  constexpr std::size_t kStackBytes = 64 * kPageBytes;
  char stack[kStackBytes];
  volatile char* const pages = stack;  // volatile: the writes are the purpose
  for (std::size_t i = 0; i < kStackBytes; i += kPageBytes) {
    pages[i] = 0;
  }
}

extern "C" void request_stop(int /*signal*/) { g_stop_requested.store(true, std::memory_order_relaxed); }

}  // namespace

std::int64_t to_nanoseconds(double seconds) noexcept {
  constexpr double kLongestSeconds = 4e9;  // the sum of two fits
  if (std::isnan(seconds)) {
    return 0;
  }
  return std::llround(std::clamp(seconds, -kLongestSeconds, kLongestSeconds) *
                      static_cast<double>(kNanosecondsPerSecond));
}

std::int64_t monotonic_ns() noexcept {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<std::int64_t>(now.tv_sec) * kNanosecondsPerSecond + now.tv_nsec;
}

void sleep_until(std::int64_t deadline_ns) noexcept {
  timespec deadline{};
  deadline.tv_sec = deadline_ns / kNanosecondsPerSecond;
  deadline.tv_nsec = deadline_ns % kNanosecondsPerSecond;
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &deadline, nullptr);
}

RealtimeStatus enter_realtime(int priority) noexcept {
  RealtimeStatus status;
  status.memory_locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
  touch_stack();
  sched_param parameters{};
  parameters.sched_priority = priority;
  status.fifo = sched_setscheduler(0, SCHED_FIFO, &parameters) == 0;
  return status;
}

void leave_realtime() noexcept {
  const sched_param parameters{};
  sched_setscheduler(0, SCHED_OTHER, &parameters);
  sched_setaffinity(0, sizeof(g_cores_at_start), &g_cores_at_start);
}

bool pin_to_cpu(int cpu) noexcept {
  if (cpu < 0 || cpu >= CPU_SETSIZE) {
    return false;
  }
  cpu_set_t cores;
  CPU_ZERO(&cores);
  CPU_SET(cpu, &cores);
  return sched_setaffinity(0, sizeof(cores), &cores) == 0;
}

const std::atomic<bool>& install_stop_signals() noexcept {
  // Without SA_RESTART a blocking wait returns, so that the loop sees the request at once.
  struct sigaction action {};
  action.sa_handler = request_stop;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  struct sigaction hang_up {};
  if (sigaction(SIGHUP, nullptr, &hang_up) == 0 && hang_up.sa_handler != SIG_IGN) {  // nohup asks to ignore it
    sigaction(SIGHUP, &action, nullptr);
  }
  return g_stop_requested;
}

}  // namespace quasilpv
