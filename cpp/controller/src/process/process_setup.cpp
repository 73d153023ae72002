#include "quasilpv/process_setup.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <iostream>

#include "quasilpv/errors.hpp"
#include "quasilpv/exit_codes.hpp"

namespace quasilpv {
namespace {

constexpr rlim_t kLeastStackBytes = rlim_t{1} << 20;

/// Read-only: nothing can be written to it by mistake. The lowest free number is taken, which is the closed one.
void occupy_closed_streams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (fcntl(stream, F_GETFD) == -1 && open("/dev/null", O_RDONLY) == -1) {
      throw InputError("process", "standard streams", "a closed one", "three open ones, or /dev/null");
    }
  }
}

}  // namespace

void prepare_process() {
  occupy_closed_streams();
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);  // a file size limit is an error of the write, like a full disk
  rlimit stack{};
  if (getrlimit(RLIMIT_STACK, &stack) == 0 && stack.rlim_cur != RLIM_INFINITY && stack.rlim_cur < kLeastStackBytes) {
    throw InputError("process", "stack limit", std::to_string(stack.rlim_cur / 1024) + " KiB",
                     "at least " + std::to_string(kLeastStackBytes / 1024) + " KiB (ulimit -s)");
  }
}

int finish_output(const std::string& program, int code) {
  errno = 0;
  std::cout.flush();
  if (std::cout.good()) {
    return code;
  }
  pollfd output{STDOUT_FILENO, 0, 0};
  if (poll(&output, 1, 0) == 1 && (output.revents & POLLERR) != 0) {  // a pipe without a reader
    return code == kExitDone ? kExitReaderLeft : code;
  }
  std::cerr << program << ": standard output: got " << (errno == 0 ? "a write error" : std::strerror(errno))
            << ", expected room for the report\n";
  return code == kExitDone ? kExitBadInput : code;
}

}  // namespace quasilpv
