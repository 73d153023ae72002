// No system call but the clock in the control step: a child process gives up the right to make any, and goes on
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
#include <limits>
#include <memory>

#include "loop_fixture.hpp"

namespace quasilpv {
namespace {

using ::quasilpv::testing::artifact;
using ::quasilpv::testing::at;
using ::quasilpv::testing::kLawKinds;
using ::quasilpv::testing::reading;
using ::quasilpv::testing::trajectory;

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

TEST_F(SystemCall, is_not_made_by_the_control_loop_of_any_law_whatever_the_readings) {
  for (const char* kind : kLawKinds) {
    LoopSettings settings;
    settings.bumpless_start = true;
    ControlLoop loop(artifact(kind), trajectory(), settings);
    auto ring = std::make_unique<SampleRing>();
    loop.publish_to(ring.get());
    EXPECT_TRUE(ends_without_a_system_call([&] {
      for (std::int64_t seq = 0; seq < 5000; seq += seq % 7 == 0 ? 3 : 1) {
        RobotReading next = reading(seq);
        next.angle_rad[1] = seq % 1000 < 30 ? std::numeric_limits<double>::quiet_NaN() : 0.1;
        loop.handle(next, at(seq));
        loop.reset_fault();
      }
      loop.handle_silence(at(5000));
    })) << kind;
  }
}

}  // namespace
}  // namespace quasilpv
