// What a process needs before it does anything, and what it must check before it says that all is well.
#pragma once

#include <string>

namespace quasilpv {

/// Gives the process the three standard streams, stack and signals it relies on. A standard stream that is closed
/// becomes one that cannot be used, so that no file or socket takes its number; a write to a reader that left fails
/// instead of ending the process. INIT-ONLY: first of all, before any thread. Throws InputError if the limit of the
/// stack is too low.
void prepare_process();

/// Flushes standard output. Returns `code`, but if something written to it got lost: says so on one line, and returns
/// kExitBadInput instead of kExitDone (kExitReaderLeft, without a line, if only its reader left). RT-UNSAFE.
int finish_output(const std::string& program, int code);

}  // namespace quasilpv
