// The default law: feedback, disturbance observer and prediction in acceleration coordinates.
#include "laws/common/acceleration_law.hpp"

namespace quasilpv {
namespace {

/// Scalars of the sampled law, the same for every joint. Errors are x - x_r: stabilising kp, kd and ki are negative.
struct DobAccelerationParameters final : ObserverParameters {
  AccelerationFeedback feedback;
  ObserverGains observer{};
  bool disturbance_compensation = true;  ///< false: observed and predicted, but not subtracted
  std::optional<LyapunovBound> bound;    ///< none: not designed for one
  std::optional<MotionLimits> limits;    ///< none: the proof does not depend on the motion
  AngleSide side = AngleSide::kJoint;    ///< of gears whose drives control their torques: the link's

  const LyapunovBound* lyapunov_bound() const noexcept override { return bound ? &*bound : nullptr; }
  const MotionLimits* motion_limits() const noexcept override { return limits ? &*limits : nullptr; }
  AngleSide controlled_side() const noexcept override { return side; }
  std::unique_ptr<ControlLaw> make_law(const LawSettings& settings) const override;
};

/// Per sample, with x_hat = [th, w, a_d, j_d] (angle, speed, disturbance acceleration and its rate):
///
///     M, G   = M_n(z(y)), G(y)
///     x_hat += [l1, l2, l3, l4] (y - th)                                          current estimator
///     d_f    = q d_f + (1 - q) a_d,  q = exp(-T/T_f)                              exact filter
///     a_cmd  = r'' - d_f + kp (th - r) + kd (w - r') + ki e_I
///     Gamma  = M a_cmd + G, limited
///     e_I   += T (y - r)                                                          anti-windup: see integrate_error()
///     a_app  = M^-1 (Gamma_applied - G) + a_d
///     th    += T w + T^2/2 a_app + T^3/6 j_d;  w += T a_app + T^2/2 j_d;  a_d += T j_d     exact zero-order hold
///
/// Start and samples without a measurement: see ObserverLaw. Coriolis torque is part of the disturbance.
/// Source: Dehak 2022, section IV.3, carried over to accelerations and discrete time.
template <int N>
class DobAccelerationLaw final : public AccelerationLaw<N> {
 public:
  DobAccelerationLaw(const DobAccelerationParameters& parameters, const LawSettings& settings)
      : AccelerationLaw<N>(parameters, parameters.observer, settings), parameters_(parameters) {}

 private:
  using typename AccelerationLaw<N>::Motion;

  Command<N> control(const ObserverState<N>& state, const ModelSample<N>& model, const ReferenceVectors<N>& reference,
                     StepReport& /*report*/) noexcept override {
    const JointVector<N> feedback = parameters_.feedback.kp * (state.angle - reference.angle) +
                                    parameters_.feedback.kd * (state.speed - reference.speed) +
                                    parameters_.feedback.ki * state.integral_error;
    if (parameters_.disturbance_compensation) {
      acceleration_ = reference.acceleration - state.filtered_disturbance + feedback;
    } else {
      acceleration_ = reference.acceleration + feedback;
    }
    return {model.torque(acceleration_), JointVector<N>::Constant(parameters_.feedback.ki)};
  }

  // If the model has no finite answer, the commanded acceleration is predicted. A chain of bodies is asked only where a
  // limit acted: elsewhere the acceleration is the commanded one.
  Motion predict(const ObserverState<N>& state, const ModelSample<N>& model, const ReferenceVectors<N>& /*reference*/,
                 StepReport& report) noexcept override {
    const JointVector<N> torque = from_array<N>(report.torque_applied);
    JointVector<N> applied = acceleration_;
    if (model.tree == nullptr || torque != from_array<N>(report.torque_commanded)) {
      applied = model.acceleration(torque - model.gravity_torque());
    }
    if (!applied.allFinite()) {
      applied = acceleration_;
      report.flags |= kModelInvalid;
    }
    applied += state.disturbance;
    return {applied, state.disturbance_rate};
  }

  DobAccelerationParameters parameters_;
  JointVector<N> acceleration_ = JointVector<N>::Zero();  // commanded in this sample
};

std::unique_ptr<ControlLaw> DobAccelerationParameters::make_law(const LawSettings& settings) const {
  return make_law_of_size<DobAccelerationLaw>(*this, settings);
}

MemberTable<LyapunovBound> bound_table() {
  MemberTable<LyapunovBound> bound;
  bound.add({"signals", "matrix"}, [](const Field& field, int /*joints*/, LyapunovBound& target) {
    target.signals = read_lyapunov(field, LyapunovBound::kSignals);
  });
  bound.add({"joints", "matrix"}, [](const Field& field, int joints, LyapunovBound& target) {
    target.joints.setZero();
    target.joints.topLeftCorner(joints, joints) = read_lyapunov(field, joints);
  });
  return bound;
}

MemberTable<MotionLimits> limits_table() {
  MemberTable<MotionLimits> limits;
  limits.add({"angle_rad", "intervals"}, [](const Field& field, int joints, MotionLimits& target) {
    target.angle_rad = read_intervals(field, joints);
  });
  limits.add({"speed_rad_s", "joint-values"}, [](const Field& field, int joints, MotionLimits& target) {
    target.speed_rad_s = read_joint_values(field, joints, [](const Field& value) { return value.positive(); });
  });
  return limits;
}

// The innovation is read off the corrected estimate, y - th = (1 - l1) (y - predicted angle).
void read_innovation_share(const Field& law, DobAccelerationParameters& parameters) {
  if (!parameters.bound) {
    return;
  }
  parameters.bound->innovation_share = 1.0 - parameters.observer[0];
  if (parameters.bound->innovation_share == 0.0) {
    law["observer"].at(0).fail("1", "another number with law.lyapunov_bound");
  }
}

}  // namespace

namespace laws {

LawKind dob_acceleration() {
  using P = DobAccelerationParameters;
  LawTable<P> law("dob-acceleration", Inertia::kTableOrChain);
  law.object("feedback", &P::feedback, feedback_table());
  law.numbers("observer", &P::observer);
  law.positive("filter_time_constant_s", &P::filter_time_constant_s);
  law.boolean("disturbance_compensation", &P::disturbance_compensation);
  law.object("lyapunov_bound", &P::bound, bound_table());
  law.object("motion_limits", &P::limits, limits_table());
  law.add({"angle_side", "angle-side", true}, [](const Field& field, int /*joints*/, P& target) {
    field.expect_text("link");
    target.side = AngleSide::kLink;
  });
  law.finish(read_innovation_share);
  return law.kind();
}

}  // namespace laws
}  // namespace quasilpv
