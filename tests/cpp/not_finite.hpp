// Numbers that no measurement may be.
#pragma once

#include <limits>

namespace quasilpv::testing {

inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace quasilpv::testing
