// SUNDIALS IDA behind one class; only ida_integrator.cpp and ida_kernels.cpp see SUNDIALS.
#pragma once

#include <memory>

#include "quasilpv/integrator.hpp"

namespace quasilpv {

/// Work done since construction.
struct IdaStatistics {
  long steps = 0;
  long residuals = 0;
  long jacobians = 0;
  long error_test_failures = 0;
  long convergence_failures = 0;
};

/// Integrates F(t, y, y') = 0 with IDA: dense direct solver, the system's analytic Jacobian, algebraic components left
/// out of the error test.
///
/// The solver restarts on every advance(): across a torque jump its polynomial history is wrong, and keeping it costs
/// two digits at the same tolerance. The start values come from ImplicitSystem::make_consistent (one mass-matrix solve)
/// rather than from IDACalcIC, which is slower, gains nothing, and fails on stabilised index-2 forms.
///
/// Source: Hindmarsh et al., "SUNDIALS: Suite of nonlinear and differential/algebraic equation solvers", ACM TOMS
/// 31(3), 2005. Not for index-3 formulations of constrained mechanisms.
class IdaIntegrator final : public Integrator {
 public:
  /// `system` must outlive the integrator. INIT-ONLY. Throws PlantError naming the IDA call that failed.
  IdaIntegrator(const ImplicitSystem& system, const IdaOptions& options);
  ~IdaIntegrator() override;

  /// Throws PlantError naming the IDA flag and the time it stopped at.
  void advance(double from_s, double to_s, Eigen::VectorXd& y) override;

  const IdaStatistics& statistics() const noexcept;

 private:
  struct Solver;  // owns every SUNDIALS object
  std::unique_ptr<Solver> solver_;
};

}  // namespace quasilpv
