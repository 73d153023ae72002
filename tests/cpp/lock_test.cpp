// No lock in the control thread: the ways of POSIX to lock and to wait, and with them those of C++, are replaced by
// counting ones.
#include <dlfcn.h>
#include <gtest/gtest.h>
#include <pthread.h>
#include <semaphore.h>

#include <condition_variable>
#include <mutex>
#include <shared_mutex>

#include "counting.hpp"
#include "quasilpv/telemetry_publisher.hpp"
#include "quiet_robot.hpp"

namespace {

/// Counts a call and makes it: `name` as the C library, the next in the order of symbols, has it.
template <class... Arguments>
[[maybe_unused]] int count_and_call(const char* name, Arguments... arguments) {
  ::quasilpv::testing::count();
  return reinterpret_cast<int (*)(Arguments...)>(dlsym(RTLD_NEXT, name))(arguments...);
}

}  // namespace

#if QUASILPV_COUNTS_CALLS
extern "C" {
int pthread_mutex_lock(pthread_mutex_t* mutex) noexcept { return count_and_call("pthread_mutex_lock", mutex); }
int pthread_mutex_trylock(pthread_mutex_t* mutex) noexcept { return count_and_call("pthread_mutex_trylock", mutex); }
int pthread_mutex_timedlock(pthread_mutex_t* mutex, const timespec* until) noexcept {
  return count_and_call("pthread_mutex_timedlock", mutex, until);
}
int pthread_mutex_clocklock(pthread_mutex_t* mutex, clockid_t clock, const timespec* until) noexcept {
  return count_and_call("pthread_mutex_clocklock", mutex, clock, until);
}
int pthread_rwlock_rdlock(pthread_rwlock_t* lock) noexcept { return count_and_call("pthread_rwlock_rdlock", lock); }
int pthread_rwlock_wrlock(pthread_rwlock_t* lock) noexcept { return count_and_call("pthread_rwlock_wrlock", lock); }
int pthread_rwlock_tryrdlock(pthread_rwlock_t* lock) noexcept {
  return count_and_call("pthread_rwlock_tryrdlock", lock);
}
int pthread_rwlock_trywrlock(pthread_rwlock_t* lock) noexcept {
  return count_and_call("pthread_rwlock_trywrlock", lock);
}
int pthread_spin_lock(pthread_spinlock_t* lock) noexcept { return count_and_call("pthread_spin_lock", lock); }
int pthread_spin_trylock(pthread_spinlock_t* lock) noexcept { return count_and_call("pthread_spin_trylock", lock); }
int pthread_cond_signal(pthread_cond_t* condition) noexcept { return count_and_call("pthread_cond_signal", condition); }
int pthread_cond_broadcast(pthread_cond_t* condition) noexcept {
  return count_and_call("pthread_cond_broadcast", condition);
}
int sem_trywait(sem_t* semaphore) noexcept { return count_and_call("sem_trywait", semaphore); }
int sem_post(sem_t* semaphore) noexcept { return count_and_call("sem_post", semaphore); }

// Those that wait may be cancelled, which is done by an exception.
int pthread_cond_wait(pthread_cond_t* condition, pthread_mutex_t* mutex) {
  return count_and_call("pthread_cond_wait", condition, mutex);
}
int pthread_cond_timedwait(pthread_cond_t* condition, pthread_mutex_t* mutex, const timespec* until) {
  return count_and_call("pthread_cond_timedwait", condition, mutex, until);
}
int pthread_cond_clockwait(pthread_cond_t* condition, pthread_mutex_t* mutex, clockid_t clock, const timespec* until) {
  return count_and_call("pthread_cond_clockwait", condition, mutex, clock, until);
}
int sem_wait(sem_t* semaphore) { return count_and_call("sem_wait", semaphore); }
int sem_timedwait(sem_t* semaphore, const timespec* until) { return count_and_call("sem_timedwait", semaphore, until); }
}
#endif

namespace quasilpv {
namespace {

using ::quasilpv::testing::calls_in;
using ::quasilpv::testing::kLawKinds;
using ::quasilpv::testing::kPaces;
using ::quasilpv::testing::make_loop;
using ::quasilpv::testing::QuietRobot;
using ::quasilpv::testing::run_control_thread;

class Lock : public ::testing::Test {
 protected:
  void SetUp() override {
    if (QUASILPV_COUNTS_CALLS == 0) {
      GTEST_SKIP() << "the sanitizer replaces the locks itself";
    }
  }
};

TEST_F(Lock, is_counted_for_mutexes_conditions_semaphores_and_spin_locks) {
  std::mutex mutex;
  EXPECT_EQ(calls_in([&] { const std::lock_guard<std::mutex> lock(mutex); }), 1);
  std::timed_mutex timed;
  EXPECT_EQ(calls_in([&] { EXPECT_TRUE(timed.try_lock()); }), 1);
  std::shared_mutex shared;
  EXPECT_EQ(calls_in([&] { const std::shared_lock<std::shared_mutex> lock(shared); }), 1);
  EXPECT_EQ(calls_in([&] { const std::unique_lock<std::shared_mutex> lock(shared); }), 1);
  std::condition_variable condition;
  EXPECT_EQ(calls_in([&] { condition.notify_one(); }), 1);
  EXPECT_EQ(calls_in([&] {
              std::unique_lock<std::mutex> lock(mutex);
              condition.wait_for(lock, std::chrono::nanoseconds(1));
            }),
            2);
  sem_t semaphore;
  sem_init(&semaphore, 0, 1);
  EXPECT_EQ(calls_in([&] { sem_wait(&semaphore); }), 1);
  sem_destroy(&semaphore);
  pthread_spinlock_t spin;
  pthread_spin_init(&spin, PTHREAD_PROCESS_PRIVATE);
  EXPECT_EQ(calls_in([&] { pthread_spin_lock(&spin); }), 1);
  pthread_spin_destroy(&spin);
}

/// A driver that breaks the rules.
class LockingRobot final : public QuietRobot {
 public:
  void write(const RobotCommand& command) noexcept override {
    const std::lock_guard<std::mutex> lock(mutex_);
    last_ = command;
  }

 private:
  std::mutex mutex_;
  RobotCommand last_;
};

TEST_F(Lock, is_counted_for_every_command_of_a_driver_that_takes_one) {
  ControlLoop loop = make_loop("dob-acceleration");
  LockingRobot robot;
  ControllerRunReport report;
  const int count = calls_in([&] { report = run_control_thread(loop, robot, Pace::kLockStep); });
  EXPECT_EQ(count, report.commands);
  EXPECT_GT(count, 1000);
}

TEST_F(Lock, is_not_taken_by_the_control_thread_of_any_law_whatever_the_robot_does) {
  for (const char* kind : kLawKinds) {
    for (const Pace pace : kPaces) {
      ControlLoop loop = make_loop(kind);
      TelemetryPublisher publisher(nullptr, loop.sample_period_s(), loop.joints(), nullptr);
      loop.publish_to(&publisher.ring());
      QuietRobot robot;
      ControllerRunReport report;
      EXPECT_EQ(calls_in([&] { report = run_control_thread(loop, robot, pace); }), 0) << kind;
      EXPECT_GT(loop.predicted_steps(), 0);
      EXPECT_GT(report.resets, 5);
    }
  }
}

}  // namespace
}  // namespace quasilpv
