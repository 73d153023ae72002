// Gain-scheduled tracking with a disturbance observer in torque coordinates: the law of Theorem IV.11.
#include <optional>

#include "laws/common/law_table.hpp"
#include "laws/common/observer_law.hpp"

namespace quasilpv {
namespace {

/// Gains scheduled on the premises of the inertia. Errors are x - x_r. With a premultiplication beta gains and
/// disturbances belong to beta(z) times the equations of motion: a torque x there is beta(z)^-1 x at the joints.
struct DobTorqueParameters final : ObserverParameters {
  BlockPolytope feedback;                          ///< [Kp Kd KI], n x 3n: N m/rad, N m s/rad, N m/(rad s)
  BlockPolytope observer;                          ///< [L1; L2; L3; L4], 4n x n: 1/s, 1/s^2, N m/(rad s), N m/(rad s^2)
  std::optional<BlockPolytope> premultiplication;  ///< beta, n x n; none: the identity

  std::unique_ptr<ControlLaw> make_law(const LawSettings& settings) const override;
};

/// Per sample, with x_hat = [th, w, d, dd] (angle, speed, disturbance torque and its rate), the gains
/// K = [Kp Kd KI] and L = [L1; L2; L3; L4] being evaluated at the same premises as M:
///
///     M, G, K, L = M_n(z(y)), G(y), K(z(y)), L(z(y))
///     innov  = (I + T L1)^-1 (y - th);  x_hat += T L innov                  implicit correction
///     d_f    = q d_f + (1 - q) d,  q = exp(-T/T_f)                          exact filter
///     Gamma  = M r'' + beta^-1 (Kp (th - r) + Kd (w - r') + KI e_I - d_f) + G, limited
///     e_I   += T (y - r)                                                    anti-windup: see integrate_error()
///     a, j   = M^-1 (Gamma_applied - G + beta^-1 d), M^-1 beta^-1 dd
///     th    += T w + T^2/2 a + T^3/6 j;  w += T a + T^2/2 j;  d += T dd     exact zero-order hold
///
/// The correction solves x = x_hat + T L (y - C x) for the x after it: unlike x_hat += T L (y - th) it stays stable
/// when T times the observer's bandwidth is not small. beta(z(y)) is the identity unless the law has a
/// premultiplication: then gains and disturbance are those of beta times the equations of motion. Disturbances are
/// reported as torques at the joints; if beta is singular the torque is not finite. Start and samples without a
/// measurement: see ObserverLaw. Coriolis torque is part of the disturbance. Source: Dehak 2022, Theorem IV.11, in the
/// reduced form with a constant observer matrix.
template <int N>
class DobTorqueLaw final : public ObserverLaw<N> {
 public:
  DobTorqueLaw(const DobTorqueParameters& parameters, const LawSettings& settings)
      : ObserverLaw<N>(parameters, settings),
        feedback_(parameters.feedback),
        observer_(parameters.observer),
        premultiplication_(parameters.premultiplication),
        sample_period_s_(settings.sample_period_s) {}

 private:
  using typename ObserverLaw<N>::Motion;

  void correct(const JointVector<N>& measured, StepReport& report, ObserverState<N>& state) noexcept override {
    Eigen::Matrix<double, 4 * N, N> gain;
    observer_.evaluate(report.premise.data(), gain);
    gain *= sample_period_s_;
    const JointMatrix<N> implicit = JointMatrix<N>::Identity() + gain.template topRows<N>();
    const JointVector<N> innovation = solve_general<N>(implicit, measured - state.angle);
    const Eigen::Matrix<double, 4 * N, 1> correction = gain * innovation;
    state.angle += correction.template segment<N>(0);
    state.speed += correction.template segment<N>(N);
    state.disturbance += correction.template segment<N>(2 * N);
    state.disturbance_rate += correction.template segment<N>(3 * N);
  }

  Command<N> control(const ObserverState<N>& state, const ModelSample<N>& model, const ReferenceVectors<N>& reference,
                     StepReport& report) noexcept override {
    TrackingGain<N> gain;
    feedback_.evaluate(report.premise.data(), gain);
    if (premultiplication_) {
      premultiplication_->evaluate(report.premise.data(), beta_);
      to_array<N>(at_joints(state.disturbance), report.estimated_disturbance);
      to_array<N>(at_joints(state.filtered_disturbance), report.filtered_disturbance);
    }
    TrackingError<N> error;
    error << state.angle - reference.angle, state.speed - reference.speed, state.integral_error;
    const JointVector<N> correction = gain * error - state.filtered_disturbance;
    JointVector<N> integral_gain;
    for (int j = 0; j < N; ++j) {
      integral_gain[j] = at_joints(gain.col(2 * N + j))[j];
    }
    return {model.inertia * reference.acceleration + at_joints(correction) + model.gravity, integral_gain};
  }

  // If the model has no finite answer, the reference acceleration is predicted.
  Motion predict(const ObserverState<N>& state, const ModelSample<N>& model, const ReferenceVectors<N>& reference,
                 StepReport& report) noexcept override {
    const JointVector<N> torque = from_array<N>(report.torque_applied) - model.gravity + at_joints(state.disturbance);
    Motion motion{model.acceleration(torque), model.acceleration(at_joints(state.disturbance_rate))};
    if (!motion.acceleration.allFinite() || !motion.jerk.allFinite()) {
      motion = {reference.acceleration, JointVector<N>::Zero()};
      report.flags |= kModelInvalid;
    }
    return motion;
  }

  /// beta^-1 of the sample times a torque of the premultiplied equations; control() evaluates beta.
  JointVector<N> at_joints(const JointVector<N>& torque) const noexcept {
    return premultiplication_ ? solve_general<N>(beta_, torque) : torque;
  }

  BlockPolytope feedback_;
  BlockPolytope observer_;
  std::optional<BlockPolytope> premultiplication_;
  double sample_period_s_;
  JointMatrix<N> beta_ = JointMatrix<N>::Identity();
};

std::unique_ptr<ControlLaw> DobTorqueParameters::make_law(const LawSettings& settings) const {
  return make_law_of_size<DobTorqueLaw>(*this, settings);
}

}  // namespace

namespace laws {

LawKind dob_torque() {
  using P = DobTorqueParameters;
  LawTable<P> law("dob-torque");
  law.gains("feedback", &P::feedback, 1, 3);
  law.gains("observer", &P::observer, 4, 1);
  law.gains("premultiplication", &P::premultiplication, 1, 1);
  law.positive("filter_time_constant_s", &P::filter_time_constant_s);
  return law.kind();
}

}  // namespace laws
}  // namespace quasilpv
