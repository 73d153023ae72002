// Calls of library functions, counted by replacements of them: the counter of this thread, and when it runs.
#pragma once

// Sanitizers bring their own malloc and their own locks: there is nothing to replace.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define QUASILPV_COUNTS_CALLS 0
#else
#define QUASILPV_COUNTS_CALLS 1
#endif

namespace quasilpv::testing {

inline thread_local bool counting = false;
inline thread_local int calls = 0;

/// What a replacement does before it makes the call.
inline void count() noexcept { calls += counting ? 1 : 0; }

/// Calls that `action` makes in this thread.
template <class Action>
int calls_in(Action action) {
  calls = 0;
  counting = true;
  action();
  counting = false;
  return calls;
}

}  // namespace quasilpv::testing
