// Numerical integration between two jumps of the input.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <variant>

#include "quasilpv/plant.hpp"

namespace quasilpv {

/// Advances the state of one system over intervals on which its input is constant.
class Integrator {
 public:
  Integrator() = default;
  virtual ~Integrator() = default;
  Integrator(const Integrator&) = delete;
  Integrator& operator=(const Integrator&) = delete;

  /// Replaces `y`, the state at `from_s`, by the state at `to_s` > `from_s`, starting afresh: nothing is remembered
  /// from the interval before. RT-UNSAFE. Throws PlantError; `y` is then unchanged.
  virtual void advance(double from_s, double to_s, Eigen::VectorXd& y) = 0;
};

/// Variable-order, variable-step BDF (SUNDIALS IDA) on the implicit form.
struct IdaOptions {
  double relative_tolerance = 1e-8;
  double absolute_tolerance = 1e-10;  ///< see ImplicitSystem::absolute_tolerance
};

/// The classical fourth-order Runge-Kutta method with constant steps on the explicit form.
struct Rk4Options {
  int steps_per_sample = 1;
};

/// The same motion by MuJoCo, which knows the plant from its document: only a caller that has MuJoCo can make it.
struct MujocoOptions {
  int steps_per_sample = 1;
};

using IntegratorOptions = std::variant<IdaOptions, Rk4Options, MujocoOptions>;

/// Makes the integrator of one plant, which must outlive it.
using IntegratorFactory = std::function<std::unique_ptr<Integrator>(const Plant&)>;

/// The integrator a scenario asks for. `system` must outlive it. INIT-ONLY. Throws PlantError; InputError for one that
/// is not made here.
std::unique_ptr<Integrator> make_integrator(const IntegratorOptions& options, const ImplicitSystem& system,
                                            double sample_period_s);

}  // namespace quasilpv
