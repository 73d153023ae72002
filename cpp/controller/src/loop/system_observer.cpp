#include "quasilpv/system_observer.hpp"

#include "laws/common/elimination.hpp"
#include "quasilpv/system_artifact.hpp"

namespace quasilpv {

void AffineMatrix::evaluate(const double* premise, Eigen::Ref<Eigen::MatrixXd> value) const noexcept {
  value = constant;
  for (std::size_t p = 0; p < slopes.size(); ++p) {
    value += premise[p] * slopes[p];
  }
}

SystemObserver::SystemObserver(const SystemArtifact& artifact)
    : parameters_(&*artifact.observer()), period_s_(artifact.sample_period_s()) {
  const Eigen::Index states = parameters_->A.constant.rows();
  const Eigen::Index inputs = parameters_->B.constant.cols();
  estimate_ = parameters_->start;
  completed_ = Eigen::VectorXd::Zero(parameters_->start.size());
  innovation_ = Eigen::VectorXd::Zero(parameters_->gain.cols());
  E_ = A_ = matrix_ = Eigen::MatrixXd::Zero(states, states);
  B_ = Eigen::MatrixXd::Zero(states, inputs);
  input_ = Eigen::VectorXd::Zero(inputs);
  rates_ = right_ = Eigen::VectorXd::Zero(states);
}

void SystemObserver::reset() noexcept {
  estimate_ = parameters_->start;
  is_fresh_ = true;
}

void SystemObserver::reset(const double* estimate) noexcept {
  estimate_ = Eigen::Map<const Eigen::VectorXd>(estimate, estimate_.size());
  is_fresh_ = false;
}

void SystemObserver::complete(double* state) noexcept {
  for (std::size_t i = 0; i < parameters_->measured.size(); ++i) {
    const int k = parameters_->measured[i];
    if (is_fresh_) {
      estimate_[k] = state[k];
    }
    innovation_[static_cast<Eigen::Index>(i)] = state[k] - estimate_[k];
  }
  is_fresh_ = false;
  for (Eigen::Index k = 0; k < estimate_.size(); ++k) {
    completed_[k] = parameters_->is_measured[static_cast<std::size_t>(k)] ? state[k] : estimate_[k];
    state[k] = completed_[k];
  }
}

void SystemObserver::without_measurement(double* state) noexcept {
  innovation_.setZero();
  completed_ = estimate_;
  Eigen::Map<Eigen::VectorXd>(state, completed_.size()) = completed_;
}

bool SystemObserver::predict(const double* premise, const double* input) noexcept {
  const Eigen::Index q = estimate_.size();
  const Eigen::Index algebraic = E_.rows() - q;
  parameters_->E.evaluate(premise, E_);
  parameters_->A.evaluate(premise, A_);
  parameters_->B.evaluate(premise, B_);
  input_ = Eigen::Map<const Eigen::VectorXd>(input, input_.size());
  right_.noalias() = A_.leftCols(q) * completed_;
  right_.noalias() += B_ * input_;
  matrix_.leftCols(q) = E_.leftCols(q);
  matrix_.rightCols(algebraic) = -A_.rightCols(algebraic);
  eliminate(matrix_, right_, rates_);
  estimate_ += period_s_ * rates_.head(q);
  estimate_.noalias() += parameters_->gain * innovation_;
  if (estimate_.allFinite()) {
    return true;
  }
  reset();
  return false;
}

}  // namespace quasilpv
