// The gain of the laws with descriptor structure: rational in the premises of the inertia.
#pragma once

#include "laws/common/law_support.hpp"

namespace quasilpv {

/// y E(z)^-T, row by row, for E = diag(I, M, I ...) with M the design inertia at this sample: the block of y next to M
/// becomes the solution x of M x = y. In place. RT-SAFE (bounded, no allocation, no lock, no throw).
template <int N, int Columns>
void divide_by_descriptor(const ModelSample<N>& model, Eigen::Matrix<double, N, Columns>& rows) noexcept {
  for (int j = 0; j < N; ++j) {
    const JointVector<N> row = rows.template block<1, N>(j, N).transpose();
    rows.template block<1, N>(j, N) = model.acceleration(row).transpose();
  }
}

/// K(z) = Y(z) E(z)^-T P^-1 with a constant P, inverted once.
template <int N, int Columns>
class DescriptorGain {
 public:
  using Gain = Eigen::Matrix<double, N, Columns>;

  /// \param lyapunov P, symmetric positive definite. INIT-ONLY.
  explicit DescriptorGain(const Eigen::MatrixXd& lyapunov) {
    const State fixed = lyapunov;
    for (int j = 0; j < Columns; ++j) {
      inverse_lyapunov_.col(j) = solve_positive_definite<Columns>(fixed, State::Identity().col(j));
    }
  }

  /// K from Y at the premises of this sample; NaN if M_n is not positive definite here, which is flagged.
  /// RT-SAFE (bounded, no allocation, no lock, no throw).
  Gain at(const ModelSample<N>& model, Gain numerator, StepReport& report) const noexcept {
    divide_by_descriptor(model, numerator);
    const Gain gain = numerator.lazyProduct(inverse_lyapunov_);
    if (!gain.allFinite()) {
      report.flags |= kModelInvalid;
    }
    return gain;
  }

 private:
  using State = Eigen::Matrix<double, Columns, Columns>;
  State inverse_lyapunov_;
};

}  // namespace quasilpv
