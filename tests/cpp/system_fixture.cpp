#include "system_fixture.hpp"

namespace quasilpv::testing {

Json system_table() {
  return Json::parse(R"({
    "schema": "quasilpv.system_artifact", "schema_version": 1, "name": "pendulum",
    "creator": {"tool": "test", "version": "1"},
    "design_hash": "0000000000000000000000000000000000000000000000000000000000000000",
    "sample_period_s": 0.01,
    "signals": [
      {"name": "x", "role": "state", "unit": "rad", "low": -1.5, "high": 1.5, "trim": 1, "known": true},
      {"name": "v", "role": "state", "unit": "rad/s", "low": null, "high": null, "trim": 0, "known": true},
      {"name": "u", "role": "input", "unit": "1", "low": -6, "high": 6, "trim": 0.5, "known": true}],
    "model": {"differential": 2, "names": ["z"], "lower": [5], "upper": [9],
      "premises": {"outputs": 1, "code": [["signal", 0], ["sinc"], ["const", 9], ["mul"]]},
      "E": {"constant": [[1, 0], [0, 1]], "coefficients": [[[0, 0], [0, 0]]]},
      "A": {"constant": [[0, 1], [0, 0]], "coefficients": [[[0, 0], [1, 0]]]},
      "B": {"constant": [[0], [1]], "coefficients": [[[0], [0]]]}},
    "law": {"kind": "regional-feedback",
      "gain": {"premises": 1, "lower": [5], "upper": [9], "centre": [7],
        "blocks": [{"kind": "box", "premises": [0], "vertices": [[[-15, -4]], [[-19, -4]]]}]},
      "schedule": {"outputs": 1, "code": [["signal", 0], ["sinc"], ["const", 9], ["mul"]]}},
    "region": {"lyapunov": [[0.25, 0], [0, 4]], "decay_rate_per_s": 1, "speed_per_s": null},
    "plant": {
      "residual": {"outputs": 2, "code": [["signal", 3], ["signal", 1], ["sub"],
        ["signal", 4], ["signal", 0], ["sin"], ["const", 9], ["mul"], ["sub"], ["signal", 2], ["sub"]]},
      "jacobian": [
        {"outputs": 4, "code": [["const", 1], ["const", 0], ["const", 0], ["const", -1]]},
        {"outputs": 4, "code": [["const", 0], ["const", 1],
          ["signal", 0], ["cos"], ["const", -9], ["mul"], ["const", 0]]}]},
    "witness": {}, "sampling": null, "verification": null})");
}

}  // namespace quasilpv::testing
