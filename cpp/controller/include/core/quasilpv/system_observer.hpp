// Estimates of the states that the law of a general system does not measure.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace quasilpv {

class SystemArtifact;

/// A matrix affine in the premises, X(z) = X_0 + sum_p z_p X_p.
struct AffineMatrix {
  Eigen::MatrixXd constant;
  std::vector<Eigen::MatrixXd> slopes;

  /// RT-SAFE (bounded, no allocation, no lock, no throw). `value` has the size already.
  void evaluate(const double* premise, Eigen::Ref<Eigen::MatrixXd> value) const noexcept;
};

/// The observer of an artifact as data: the model it predicts with, and how measurements correct it.
struct SystemObserverParameters {
  AffineMatrix E, A, B;           ///< [n x n], [n x n], [n x m]
  std::vector<int> measured;      ///< numbers of the measured states, in order
  std::vector<bool> is_measured;  ///< of every state
  Eigen::MatrixXd gain;           ///< L, [q x measured]
  Eigen::VectorXd start;          ///< [q], deviations
};

/// h with h+ = h + T E_1^-1 (A xi + B u)_1 + L (y - C h), algebraic states eliminated; xi = y where a state is
/// measured, h elsewhere. In deviations from the trim. Its proof: docs/concepts/observers.md.
class SystemObserver {
 public:
  /// \param artifact has an observer. INIT-ONLY.
  explicit SystemObserver(const SystemArtifact& artifact);

  /// Back to the stated start; the next measurement takes the place of the measured states of h. RT-SAFE, as all that
  /// follow (bounded, no allocation, no lock, no throw).
  void reset() noexcept;

  /// The same with another start, of all differential states, which the next measurement does not replace.
  void reset(const double* estimate) noexcept;

  /// xi of this sample. \param[in,out] state deviations of all states: what is measured is read, the others written.
  void complete(double* state) noexcept;

  /// xi of a sample without a measurement: h. \param[out] state deviations of all states.
  void without_measurement(double* state) noexcept;

  /// h of the next sample. \param premise of this one, in its box. \param input that acts, deviations.
  /// \returns false if it was not finite: h is then back at its start.
  bool predict(const double* premise, const double* input) noexcept;

  /// h, [q].
  const Eigen::VectorXd& estimate() const noexcept { return estimate_; }

 private:
  const SystemObserverParameters* parameters_;
  double period_s_;
  bool is_fresh_ = true;
  Eigen::VectorXd estimate_;
  Eigen::VectorXd completed_;  // xi
  Eigen::VectorXd innovation_;
  Eigen::MatrixXd E_, A_, B_, matrix_;
  Eigen::VectorXd input_, rates_, right_;
};

}  // namespace quasilpv
