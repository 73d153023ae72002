// A general system by hand: a pendulum with one premise, x' = v, v' = z x + u, z = 9 sinc(x), u = K(z) (x, v).
#pragma once

#include <string>

#include "artifact_fixture.hpp"

namespace quasilpv::testing {

/// Gains (-10 - z, -4) at the ends z = 5 and z = 9; the input limited to 6; the state x around 1.
Json system_table();

/// The same with x measured and v estimated, at first as 0.25.
inline Json observed_table() {
  Json table = system_table();
  table["schema_version"] = 2;
  table["observer"] = Json::parse(R"({
    "measured": ["x"], "gain": [[0.25], [2]], "lyapunov": [[0.01, 0], [0, 1]], "weight": 1, "start": [0, 0.25]})");
  return table;
}

}  // namespace quasilpv::testing
