// What the laws in acceleration coordinates share: gains of the errors and of the observer, scalars for every joint.
#pragma once

#include "laws/common/law_table.hpp"
#include "laws/common/observer_law.hpp"

namespace quasilpv {

/// Gains of errors x - x_r: stabilising ones are negative.
struct AccelerationFeedback {
  double kp = 0.0;  ///< 1/s^2
  double kd = 0.0;  ///< 1/s
  double ki = 0.0;  ///< 1/s^3
};

using ObserverGains = std::array<double, 4>;  ///< l1 (1), l2 (1/s), l3 (1/s^2), l4 (1/s^3)

/// Members of `feedback` in a document.
inline MemberTable<AccelerationFeedback> feedback_table() {
  using F = AccelerationFeedback;
  MemberTable<F> feedback;
  feedback.number("kp", &F::kp);
  feedback.number("kd", &F::kd);
  feedback.number("ki", &F::ki);
  return feedback;
}

/// A law whose current estimator is x_hat += [l1, l2, l3, l4] (y - th).
template <int N>
class AccelerationLaw : public ObserverLaw<N> {
 protected:
  AccelerationLaw(const ObserverParameters& parameters, const ObserverGains& observer, const LawSettings& settings)
      : ObserverLaw<N>(parameters, settings), observer_(observer) {}

 private:
  void correct(const JointVector<N>& measured, StepReport& /*report*/, ObserverState<N>& state) noexcept final {
    const JointVector<N> innovation = measured - state.angle;
    state.angle += observer_[0] * innovation;
    state.speed += observer_[1] * innovation;
    state.disturbance += observer_[2] * innovation;
    state.disturbance_rate += observer_[3] * innovation;
  }

  ObserverGains observer_;
};

}  // namespace quasilpv
