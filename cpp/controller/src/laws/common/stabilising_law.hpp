// What the laws that stabilise have in common: feedback of angle and speed, scheduled on premises of both.
#pragma once

#include "laws/common/velocity_law.hpp"

namespace quasilpv {

/// Parameters of a law that stabilises.
struct StabilisingParameters : VelocityParameters {
  Program schedule;  ///< premises of the gains, from angles and speeds
};

/// x = (y - r, w - r') and the gain [Kp Kd] that acts on it.
template <int N>
using StateError = Eigen::Matrix<double, 2 * N, 1>;
template <int N>
using StateGain = Eigen::Matrix<double, N, 2 * N>;

/// One sample of a law Gamma = feedback(x, z(y, w)) with x = (y - r, w - r'), w the filtered measured speed and z the
/// premises of the program `schedule`. There is no integral, and nothing is fed forward, not even gravity: x = 0 is an
/// equilibrium where gravity is zero.
template <int N>
class StabilisingLaw : public VelocityLaw<N> {
 protected:
  using typename VelocityLaw<N>::Sample;

  StabilisingLaw(const StabilisingParameters& parameters, const LawSettings& settings)
      : VelocityLaw<N>(parameters, settings), schedule_(parameters.schedule) {}

 private:
  using PremiseArray = std::array<double, kMaxPremises>;

  /// The torque before limits. \param premise z(y, w), not yet clamped to its box.
  virtual JointVector<N> feedback(const StateError<N>& state, PremiseArray& premise, const ModelSample<N>& model,
                                  StepReport& report) noexcept = 0;

  bool feeds_forward() const noexcept final { return false; }

  Command<N> control(const Sample& sample, const ModelSample<N>& model, StepReport& report) noexcept final {
    PremiseArray premise{};
    schedule_.evaluate({sample.angle.data(), sample.speed.data(), nullptr}, premise.data());
    StateError<N> state;
    state << sample.angle - sample.reference.angle, sample.speed - sample.reference.speed;
    return {feedback(state, premise, model, report), JointVector<N>::Zero()};
  }

  Program schedule_;
};

}  // namespace quasilpv
