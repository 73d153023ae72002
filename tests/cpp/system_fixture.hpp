// A general system by hand: a pendulum with one premise, x' = v, v' = z x + u, z = 9 sinc(x), u = K(z) (x, v).
#pragma once

#include <string>

#include "artifact_fixture.hpp"

namespace quasilpv::testing {

/// Gains (-10 - z, -4) at the ends z = 5 and z = 9; the input limited to 6; the state x around 1.
Json system_table();

}  // namespace quasilpv::testing
