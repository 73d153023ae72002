// The differences between SUNDIALS 6 (Debian 12) and 7 (Debian 13), all of them: elsewhere the code is written for 7.
#pragma once

#include <ida/ida.h>
#include <sundials/sundials_config.h>
#include <sundials/sundials_context.h>

#include <string>

#if SUNDIALS_VERSION_MAJOR < 7
/// No communicator: the context belongs to this process alone. From version 7 on it is that of MPI, if SUNDIALS was
/// built with it, and a null pointer is then an error that ends the process.
#define SUN_COMM_NULL nullptr
#else
#include <sundials/sundials_errors.h>
#endif

namespace quasilpv {

#if SUNDIALS_VERSION_MAJOR < 7
/// What vectors, matrices and linear solvers return when all went well: SUNMAT_SUCCESS, SUNLS_SUCCESS and plain zero.
inline constexpr int SUN_SUCCESS = 0;

inline void keep_message(int /*code*/, const char* /*module*/, const char* /*function*/, char* text, void* last) {
  *static_cast<std::string*>(last) = text;
}

/// Keeps what IDA says of its last failure in `last`, instead of printing it; negative on failure. INIT-ONLY.
/// \param context the one `ida` was created in: it is the one that speaks in version 7.
/// \param last outlives both.
inline int keep_messages(SUNContext /*context*/, void* ida, std::string& last) {
  return IDASetErrHandlerFn(ida, keep_message, &last);
}
#else
inline void keep_message(int /*line*/, const char* /*function*/, const char* /*file*/, const char* text,
                         SUNErrCode /*code*/, void* last, SUNContext /*context*/) {
  *static_cast<std::string*>(last) = text;
}

inline int keep_messages(SUNContext context, void* /*ida*/, std::string& last) {
  // All handlers are called, one after the other, and the first of them prints.
  const SUNErrCode cleared = SUNContext_ClearErrHandlers(context);
  return cleared != SUN_SUCCESS ? cleared : SUNContext_PushErrHandler(context, keep_message, &last);
}
#endif

}  // namespace quasilpv
