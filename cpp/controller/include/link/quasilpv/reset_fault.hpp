// A person asks a running controller to leave its latched fault.
#pragma once

#include "quasilpv/link.hpp"

namespace quasilpv {

enum class ResetOutcome {
  kLeft,        ///< a command with another state than Fault came
  kStillFault,  ///< commands came, all of them in Fault: its cause is still there
  kSilent       ///< no command: no controller of this session
};

/// Sends the reset event of the link's session to the controller whose commands it hears, about the fault they are in,
/// again every 100 ms, until they say that the fault was left or `timeout_s` passed. Another controller, and the same
/// one in a later fault, ignores it. RT-UNSAFE.
///
/// @param link  the operator's end (Side::kOperator): hears what the plant hears
ResetOutcome request_reset(Link& link, double timeout_s);

}  // namespace quasilpv
