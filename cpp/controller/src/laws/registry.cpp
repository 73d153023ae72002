#include "laws/registry.hpp"

#include "document/kinds.hpp"

namespace quasilpv {

// One line per kind of law: the function of its file that describes it.
#define QUASILPV_LAWS(LAW) \
  LAW(dob_acceleration)    \
  LAW(dob_torque)          \
  LAW(hinf_tracking)       \
  LAW(state_feedback)      \
  LAW(descriptor_feedback) \
  LAW(delayed_feedback)    \
  LAW(link_damped)         \
  LAW(motor_pid)           \
  LAW(pid)                 \
  LAW(computed_torque)     \
  LAW(computed_torque_observer)

namespace laws {
#define DECLARE(law) LawKind law();
QUASILPV_LAWS(DECLARE)
#undef DECLARE
}  // namespace laws

const std::vector<LawKind>& law_kinds() {
#define CALL(law) laws::law(),
  static const std::vector<LawKind> kinds{QUASILPV_LAWS(CALL)};
#undef CALL
  return kinds;
}

std::shared_ptr<const LawParameters> read_law(const Field& law, const Field& programs, int joints) {
  return find_kind(law_kinds(), law["kind"]).read(law, programs, joints);
}

}  // namespace quasilpv
