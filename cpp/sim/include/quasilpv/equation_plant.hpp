// The plant of a general system, from the programs of its equations.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "quasilpv/implicit_system.hpp"
#include "quasilpv/system_artifact.hpp"
#include "quasilpv/system_disturbance.hpp"

namespace quasilpv {

/// F(x', x, u, p) = 0 of index one: the algebraic equations can be solved for the algebraic states. In deviations from
/// the trim; the input is held between calls of set_input(). A disturbance w is added to inputs and to the rates of
/// differential states: F(x' - w_x, x, u + w_u, p) = 0.
class EquationPlant final : public ImplicitSystem {
 public:
  /// \param artifact, disturbance must outlive the plant. \param parameter deviations of all parameters, in order.
  /// INIT-ONLY.
  EquationPlant(const SystemArtifact& artifact, const std::vector<double>& parameter,
                const SystemDisturbance& disturbance);

  int size() const noexcept override { return states_; }
  Eigen::VectorXd differential() const override;
  /// In units of the domain of each state, where it has one.
  Eigen::VectorXd absolute_tolerance(double tolerance) const override;
  void residual(double t, ConstVector y, ConstVector y_dot, Vector residual) const noexcept override;
  void jacobian(double t, double c_j, ConstVector y, ConstVector y_dot, Matrix jacobian) const noexcept override;
  void derivative(double t, ConstVector y, Vector y_dot) const override;
  /// Newton's method on the algebraic states, from those of y. Throws PlantError if it does not converge.
  void make_consistent(double t, Vector y, Vector y_dot) const override;

  /// Deviations of the inputs in force from now on, kMaxInputs at most.
  void set_input(const double* input) noexcept;

 private:
  using Signals = std::array<double, kMaxSignals + kMaxStates>;
  Signals signals(double t, ConstVector y, ConstVector y_dot) const noexcept;
  /// dF/dx' and dF/dx, both [size x size].
  void partials(const Signals& values, Eigen::MatrixXd& by_rate, Eigen::MatrixXd& by_state) const noexcept;

  const SystemArtifact& artifact_;
  const SystemDisturbance& disturbance_;
  int states_;
  int differential_;
  Signals values_{};  // inputs and parameters are in place
};

}  // namespace quasilpv
