// Exit codes of both executables, in one place; docs/reference/messages.md has the same table.
#pragma once

#include <initializer_list>
#include <string>

namespace quasilpv {

enum ExitCode : int {
  kExitDone = 0,
  kExitNo = 1,                ///< the doctor says no
  kExitBadInput = 2,          ///< also a report or record that could not be written
  kExitFaultStop = 3,         ///< the run ended in a fault, or because the other side fell silent
  kExitNoRealtime = 4,        ///< no real-time privilege although it is required
  kExitNoTransport = 5,       ///< no multicast route, or the other side was never heard
  kExitPlantFailure = 6,      ///< the plant could not be integrated
  kExitInternal = 7,          ///< no memory, or anything else that is not foreseen
  kExitReaderLeft = 128 + 13  ///< whoever read the report has left: what SIGPIPE would give
};

/// "Exit codes: 0 done, 2 bad input, ..." with those every program has and `more`. INIT-ONLY.
std::string describe_exit_codes(std::initializer_list<ExitCode> more);

}  // namespace quasilpv
