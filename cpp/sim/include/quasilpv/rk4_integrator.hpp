// Classical Runge-Kutta: the independent check of IDA, and the fast choice for Monte-Carlo studies.
#pragma once

#include "quasilpv/integrator.hpp"

namespace quasilpv {

/// Integrates y' = f(t, y) (ImplicitSystem::derivative) with constant steps no longer than `step_s`: an interval is
/// divided into the smallest number of equal steps that satisfies this. Source: Kutta 1901.
class Rk4Integrator final : public Integrator {
 public:
  /// `system` must outlive the integrator; `step_s` > 0. INIT-ONLY. Throws InputError.
  Rk4Integrator(const ImplicitSystem& system, double step_s);

  /// Throws PlantError where the plant does, and if the state leaves the finite numbers.
  void advance(double from_s, double to_s, Eigen::VectorXd& y) override;

 private:
  void step(double t, double h, Eigen::VectorXd& y);

  const ImplicitSystem& system_;
  double step_s_;
  Eigen::VectorXd state_, stage_, slope_, increment_;
};

}  // namespace quasilpv
