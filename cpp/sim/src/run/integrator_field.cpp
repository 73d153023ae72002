#include "run/integrator_field.hpp"

#include <nlohmann/json.hpp>

namespace quasilpv {
namespace {

constexpr int kMaxStepsPerSample = 1000000;
constexpr double kMaxTolerance = 0.1;

}  // namespace

double at_most(double limit, const Field& field, double value) {
  if (value > limit) {
    field.fail(field.json().dump(), "at most " + Json(limit).dump());
  }
  return value;
}

IntegratorOptions read_integrator(const Field& field) {
  const std::string kind = field["kind"].text();
  if (kind == "ida") {
    field.only({"kind", "relative_tolerance", "absolute_tolerance"});
    const Field relative = field["relative_tolerance"];
    const Field absolute = field["absolute_tolerance"];
    return IdaOptions{at_most(kMaxTolerance, relative, relative.positive()),
                      at_most(kMaxTolerance, absolute, absolute.positive())};
  }
  if (kind == "rk4") {
    field.only({"kind", "steps_per_sample"});
    return Rk4Options{static_cast<int>(field["steps_per_sample"].integer(1, kMaxStepsPerSample))};
  }
  if (kind == "mujoco") {
    field.only({"kind", "steps_per_sample"});
    return MujocoOptions{static_cast<int>(field["steps_per_sample"].integer(1, kMaxStepsPerSample))};
  }
  field["kind"].fail_choice({"ida", "rk4", "mujoco"});
}

}  // namespace quasilpv
