#include "quasilpv/rk4_integrator.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>

#include "quasilpv/errors.hpp"

namespace quasilpv {

Rk4Integrator::Rk4Integrator(const ImplicitSystem& system, double step_s)
    : system_(system),
      step_s_(step_s),
      state_(system.size()),
      stage_(system.size()),
      slope_(system.size()),
      increment_(system.size()) {
  if (!std::isfinite(step_s) || step_s <= 0.0) {
    throw InputError("Runge-Kutta integrator", "step", std::to_string(step_s), "a time > 0 s");
  }
}

void Rk4Integrator::advance(double from_s, double to_s, Eigen::VectorXd& y) {
  const double length = to_s - from_s;
  // A sample that is a whole number of steps must not get one more because its length was rounded up.
  const std::int64_t steps = static_cast<std::int64_t>(std::max(1.0, std::ceil(length / step_s_ * (1.0 - 1e-9))));
  const double h = length / static_cast<double>(steps);
  state_ = y;
  system_.make_consistent(from_s, state_, slope_);
  for (std::int64_t i = 0; i < steps; ++i) {
    step(from_s + static_cast<double>(i) * h, h, state_);
  }
  if (!state_.allFinite()) {
    throw PlantError("Runge-Kutta integrator: the state is not finite at t = " + std::to_string(to_s) + " s");
  }
  y = state_;
}

void Rk4Integrator::step(double t, double h, Eigen::VectorXd& y) {
  system_.derivative(t, y, slope_);
  increment_ = slope_;
  stage_ = y + 0.5 * h * slope_;
  system_.derivative(t + 0.5 * h, stage_, slope_);
  increment_ += 2.0 * slope_;
  stage_ = y + 0.5 * h * slope_;
  system_.derivative(t + 0.5 * h, stage_, slope_);
  increment_ += 2.0 * slope_;
  stage_ = y + h * slope_;
  system_.derivative(t + h, stage_, slope_);
  increment_ += slope_;
  y += h / 6.0 * increment_;
}

}  // namespace quasilpv
