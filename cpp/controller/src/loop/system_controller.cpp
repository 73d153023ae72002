#include "quasilpv/system_controller.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace quasilpv {

SystemController::SystemController(SystemArtifact artifact)
    : artifact_(std::move(artifact)),
      gain_(static_cast<Eigen::Index>(artifact_.inputs().size()), artifact_.differential()),
      state_(artifact_.differential()),
      input_(static_cast<Eigen::Index>(artifact_.inputs().size())),
      scaled_(artifact_.differential()) {
  if (artifact_.observer()) {
    observer_.emplace(artifact_);
  }
  reset();
}

void SystemController::reset() noexcept {
  for (std::size_t k = 0; k < artifact_.inputs().size(); ++k) {
    last_[k] = artifact_.inputs()[k].trim;
  }
  has_sample_ = false;
  if (observer_) {
    observer_->reset();
  }
}

void SystemController::reset(const double* estimate) noexcept {
  reset();
  if (observer_) {
    for (int k = 0; k < artifact_.differential(); ++k) {
      signal_[static_cast<std::size_t>(k)] = estimate[k] - artifact_.states()[static_cast<std::size_t>(k)].trim;
    }
    observer_->reset(signal_.data());
  }
}

void SystemController::applied(const double* input) noexcept {
  std::copy_n(input, artifact_.inputs().size(), last_.begin());
}

bool SystemController::read(const double* state, const double* parameter) noexcept {
  const std::vector<SystemSignal>& states = artifact_.states();
  const std::vector<SystemSignal>& parameters = artifact_.parameters();
  const std::size_t first = states.size() + artifact_.inputs().size();
  bool finite = true;
  for (std::size_t k = 0; k < states.size(); ++k) {
    finite = finite && (!artifact_.is_measured(k) || std::isfinite(state[k]));
  }
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    finite = finite && (!parameters[k].known || std::isfinite(parameter[k]));
  }
  if (!finite) {
    return false;
  }
  for (std::size_t k = 0; k < states.size(); ++k) {
    signal_[k] = artifact_.is_measured(k) ? state[k] - states[k].trim : 0.0;
  }
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    signal_[first + k] = parameters[k].known ? parameter[k] - parameters[k].trim : 0.0;
  }
  return true;
}

bool SystemController::predict() noexcept {
  if (!observer_ || !has_sample_) {
    return true;
  }
  std::array<double, kMaxInputs> deviation;
  for (std::size_t k = 0; k < artifact_.inputs().size(); ++k) {
    deviation[k] = last_[k] - artifact_.inputs()[k].trim;
  }
  return observer_->predict(premise_.data(), deviation.data());
}

SystemReport SystemController::step(const double* state, const double* parameter) noexcept {
  const std::vector<SystemSignal>& states = artifact_.states();
  const std::vector<SystemSignal>& inputs = artifact_.inputs();
  SystemReport report;
  report.input = last_;
  report.commanded = last_;
  if (!predict()) {
    report.flags |= kInputNotFinite;
  }
  const bool valid = read(state, parameter);
  if (!valid) {
    report.flags |= kSignalInvalid;
  }
  if (observer_ && valid) {
    observer_->complete(signal_.data());
  } else if (observer_ && has_sample_) {
    observer_->without_measurement(signal_.data());
  } else if (!valid) {
    return report;
  }
  has_sample_ = true;
  for (std::size_t k = 0; k < states.size(); ++k) {
    report.state[k] = signal_[k] + states[k].trim;
  }
  artifact_.schedule().evaluate({nullptr, nullptr, nullptr, signal_.data()}, report.premise.data());
  if (artifact_.gain().evaluate_sized(report.premise.data(), gain_)) {
    report.flags |= kSystemPremiseOutside;
  }
  premise_ = report.premise;
  if (!valid || (report.flags & kInputNotFinite) != 0) {
    return report;
  }
  for (Eigen::Index k = 0; k < state_.size(); ++k) {
    state_[k] = signal_[static_cast<std::size_t>(k)];
  }
  scaled_.noalias() = artifact_.lyapunov_inverse() * state_;
  report.level = state_.dot(scaled_);
  if (!(report.level <= 1.0)) {
    report.flags |= kOutsideRegion;
  }
  input_.noalias() = gain_ * state_;
  if (!input_.allFinite()) {
    report.flags |= kInputNotFinite;
    return report;
  }
  for (std::size_t k = 0; k < inputs.size(); ++k) {
    const double wanted = input_[static_cast<Eigen::Index>(k)];
    const double given = std::clamp(wanted, inputs[k].low, inputs[k].high);
    if (given != wanted) {
      report.flags |= kInputSaturated;
    }
    report.commanded[k] = wanted + inputs[k].trim;
    report.input[k] = given + inputs[k].trim;
  }
  last_ = report.input;
  return report;
}

}  // namespace quasilpv
