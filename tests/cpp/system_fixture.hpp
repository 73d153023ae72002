// A general system by hand: a pendulum with one premise, x' = v, v' = z x + u, z = 9 sinc(x), u = K(z) (x, v).
#pragma once

#include <string>

#include "artifact_fixture.hpp"

namespace quasilpv::testing {

/// Gains (-10 - z, -4) at the ends z = 5 and z = 9; the input limited to 6; the state x around 1.
Json system_table();

/// The same as version 2 of the format states it.
inline Json second_table() {
  Json table = system_table();
  table["schema_version"] = 2;
  table["law"]["premise_fault_s"] = 1;
  table["observer"] = nullptr;
  return table;
}

/// The same with x measured and v estimated, at first as 0.25.
inline Json observed_table() {
  Json table = second_table();
  table["observer"] = Json::parse(R"({
    "measured": ["x"], "gain": [[0.25], [2]], "lyapunov": [[0.01, 0], [0, 1]], "weight": 1, "start": [0, 0.25]})");
  return table;
}

}  // namespace quasilpv::testing
