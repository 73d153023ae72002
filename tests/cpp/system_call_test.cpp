// No system call but the clock in the control thread: a child process gives up the right to make any, and goes on
// controlling.
#include <gtest/gtest.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstddef>
#include <iterator>
#include <memory>

#include "quiet_robot.hpp"

namespace quasilpv {
namespace {

using ::quasilpv::testing::kLawKinds;
using ::quasilpv::testing::kPaces;
using ::quasilpv::testing::make_loop;
using ::quasilpv::testing::QuietRobot;
using ::quasilpv::testing::run_control_thread;

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;  // sanitizers make system calls of their own
#else
constexpr bool kSanitized = false;
#endif

/// From now on only the clock may be read and the process ended; any other system call kills it. False if the kernel
/// does not support that.
bool give_up_system_calls() {
  sock_filter rules[] = {
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, __NR_clock_gettime, 2, 0),  // where it is not answered in user space
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, __NR_exit_group, 1, 0),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
  };
  const sock_fprog program{static_cast<unsigned short>(std::size(rules)), rules};
  return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 && prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0;
}

/// Whether a child that gave them up comes to its end after `action`.
template <class Action>
bool ends_without_a_system_call(Action action) {
  const pid_t child = fork();
  if (child == 0) {
    if (!give_up_system_calls()) {
      _exit(1);
    }
    action();
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

class SystemCall : public ::testing::Test {
 protected:
  void SetUp() override {
    if (kSanitized || !ends_without_a_system_call([] {})) {
      GTEST_SKIP() << "needs seccomp and no sanitizer";
    }
  }
};

TEST_F(SystemCall, kills_the_child_that_makes_one) {
  EXPECT_FALSE(ends_without_a_system_call([] { getppid(); }));
}

TEST_F(SystemCall, is_not_made_by_the_control_thread_of_any_law_whatever_the_robot_does) {
  for (const char* kind : kLawKinds) {
    for (const Pace pace : kPaces) {
      ControlLoop loop = make_loop(kind);
      auto ring = std::make_unique<SampleRing>();
      loop.publish_to(ring.get());
      QuietRobot robot;
      EXPECT_TRUE(ends_without_a_system_call([&] { run_control_thread(loop, robot, pace); })) << kind;
    }
  }
}

}  // namespace
}  // namespace quasilpv
