// State feedback with a memory of the premises: the laws of Theorems II.7 and II.8.
#pragma once

#include "descriptor_gain.hpp"
#include "moving_window.hpp"
#include "stabilising_law.hpp"

namespace quasilpv {

/// With the weights w of the schedule's vertices, their mean varpi over the last tau = N T seconds and their values w_d
/// tau seconds ago,
///
///     Gamma = F E(z)^-T P(varpi)^-1 x, limited,   P = sum_k varpi_k P_k,   F = sum_jkm w_j varpi_k (w_d)_m F_jkm
///
/// with x = (y - r, w - r') and E = diag(I, M_n), or E = I. Before the first sample the weights count as constant. N =
/// 0 is the limit tau -> 0: varpi = w_d = w. Source: Dehak 2022, (II.49) (E = I) and (II.69).
template <int N>
class DelayedFeedbackLaw final : public StabilisingLaw<N> {
 public:
  DelayedFeedbackLaw(const DelayedFeedbackParameters& parameters, const LawSettings& settings)
      : StabilisingLaw<N>(parameters, settings),
        lyapunov_(parameters.lyapunov),
        numerators_(parameters.numerators.begin(), parameters.numerators.end()),
        window_(parameters.window_samples, parameters.lyapunov.vertices()),
        descriptor_(parameters.descriptor) {}

 private:
  using WeightArray = std::array<double, kMaxDelayedVertices>;

  void start(const typename VelocityLaw<N>::Sample& /*sample*/, const ModelSample<N>& /*model*/,
             const JointVector<N>& /*in_force*/) noexcept override {
    starting_ = true;
  }

  JointVector<N> feedback(const StateError<N>& state, std::array<double, kMaxPremises>& premise,
                          const ModelSample<N>& model, StepReport& report) noexcept override {
    if (lyapunov_.clamp(premise.data())) {
      report.flags |= kPremiseOutsideBox;
    }
    WeightArray weight{};
    lyapunov_.weights(premise.data(), weight.data());
    if (starting_) {
      window_.reset(weight.data());
      starting_ = false;
    } else {
      window_.push(weight.data());
    }
    StateGain<N> numerator = numerator_at(weight);
    if (descriptor_) {
      divide_by_descriptor(model, numerator);
    }
    const JointVector<N> torque = numerator * solve_positive_definite<2 * N>(lyapunov_at(window_.mean()), state);
    if (!torque.allFinite()) {
      report.flags |= kModelInvalid;
    }
    return torque;
  }

  Eigen::Matrix<double, 2 * N, 2 * N> lyapunov_at(const double* mean) const noexcept {
    using State = Eigen::Matrix<double, 2 * N, 2 * N>;
    State value = State::Zero();
    for (int k = 0; k < lyapunov_.vertices(); ++k) {
      value += mean[k] * Eigen::Map<const State>(lyapunov_.vertex(k).data());
    }
    return value;
  }

  StateGain<N> numerator_at(const WeightArray& weight) const noexcept {
    const auto count = static_cast<std::size_t>(lyapunov_.vertices());
    const double* const mean = window_.mean();
    const double* const delayed = window_.beginning();
    StateGain<N> value = StateGain<N>::Zero();
    for (std::size_t j = 0; j < count; ++j) {
      for (std::size_t k = 0; k < count; ++k) {
        for (std::size_t m = 0; m < count; ++m) {
          value += weight[j] * mean[k] * delayed[m] * numerators_[(j * count + k) * count + m];
        }
      }
    }
    return value;
  }

  BlockPolytope lyapunov_;
  std::vector<StateGain<N>> numerators_;
  MovingWindow window_;
  bool descriptor_;
  bool starting_ = true;
};

}  // namespace quasilpv
