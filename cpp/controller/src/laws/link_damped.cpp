// The default law on the angles of elastic links, with the inverse dynamics fed forward and the gears damped.
#include "laws/common/acceleration_law.hpp"
#include "laws/common/link_feedforward.hpp"

namespace quasilpv {
namespace {

/// Scalars of the sampled law, the same for every joint. Errors are x - x_r: stabilising kp, kd and ki are negative.
struct LinkDampedParameters final : ObserverParameters {
  AccelerationFeedback feedback;
  ObserverGains observer{};
  double inertia_scale = 1.0;     ///< s: of the chain's inertia, in the feedback
  JointArray rotor_inertia{};     ///< B, kg m^2, reflected to the joints
  JointArray stiffness{};         ///< K of the gears, N m/rad
  JointArray relative_damping{};  ///< D_s of the gears by the motors, N m s/rad
  JointArray viscous{};           ///< of the motors, N m s/rad, as far as it is known
  JointArray coulomb{};           ///< likewise, N m
  JointArray dead_zone{};         ///< at rest errors up to this do not move what compensates the disturbance, rad

  AngleSide controlled_side() const noexcept override { return AngleSide::kLink; }
  std::unique_ptr<ControlLaw> make_law(const LawSettings& settings) const override;
};

/// The measured angles y are the links'; motors' angles th_m beside them tell how far the gears are wound. With ID the
/// inverse dynamics of links and rotors along the reference, M the inertia of both, x_hat = [th, w, a_d, j_d] of the
/// links:
///
///     F      = ID(r, r', r'') + f r' + c tanh(r' / w_0)                        f, c: friction of the motors
///     x_hat += [l1, l2, l3, l4] (y - th)                                          current estimator
///     d_f    = q d_f + (1 - q) a_d,  q = exp(-T/T_f), unless the joint has been near a resting reference for long
///     a      = kp (th - r) + kd (w - r') + ki e_I - d_f
///     u      = th_m - y - K^-1 (ID(r, r', r'') - B r'')                            wound beside what was foreseen
///     Gamma  = F + s M(y) a - D_s (u - u_before) / T, limited
///     a_app  = r'' + a + (s M)^-1 (Gamma_applied - Gamma) + a_d,  then as in DobAccelerationLaw
///
/// Above the resonance with its link a motor feels its rotor alone; what the gears are damped by then takes the place
/// of the phase that the feedback of the link's angle loses. A sample without the motors' angles is not damped.
/// Source: Spong 1987, Modeling and control of elastic joint robots; De Luca and Book 2016, Springer Handbook of
/// Robotics, section 11.1.
template <int N>
class LinkDampedLaw final : public AccelerationLaw<N> {
 public:
  LinkDampedLaw(const LinkDampedParameters& parameters, const LawSettings& settings)
      : AccelerationLaw<N>(parameters, parameters.observer, settings),
        parameters_(parameters),
        feedforward_(parameters.model, parameters.viscous, parameters.coulomb),
        rotor_(from_array<N>(parameters.rotor_inertia)),
        stiffness_(from_array<N>(parameters.stiffness)),
        dead_zone_(from_array<N>(parameters.dead_zone)),
        sample_period_s_(settings.sample_period_s),
        damping_per_sample_(from_array<N>(parameters.relative_damping) / settings.sample_period_s) {}

 private:
  using typename AccelerationLaw<N>::Motion;

  // Before a joint is left alone its loop has that long to settle: stopped earlier, what friction does not hold comes
  // back again and again.
  static constexpr double kSettlingS = 2.0;

  void begin() noexcept override {
    was_wound_ = false;
    near_s_.setZero();
  }

  void sense(const StepInput& input) noexcept override {
    sensed_ = input.valid && input.gears.has(kMotorAngle);
    wound_ = from_array<N>(input.gears.motor_angle_rad) - from_array<N>(input.angle);
  }

  ReferenceVectors<N> shape(const ReferenceVectors<N>& reference) noexcept override {
    fed_forward_ = feedforward_.dynamics(reference);
    const JointVector<N> foreseen =
        (fed_forward_ - rotor_.cwiseProduct(reference.acceleration)).cwiseQuotient(stiffness_);
    damping_.setZero();
    if (sensed_) {
      const JointVector<N> unforeseen = wound_ - foreseen;
      if (was_wound_) {
        damping_ = damping_per_sample_.cwiseProduct(unforeseen - before_);
      }
      before_ = unforeseen;
    }
    was_wound_ = sensed_;
    fed_forward_ += feedforward_.friction(reference.speed);
    return reference;
  }

  JointMask<N> compensated(const JointVector<N>& y, const ReferenceVectors<N>& reference) noexcept override {
    const JointMask<N> away = moving_or_outside<N>(dead_zone_, y - reference.angle, reference.speed);
    near_s_ = away.select(JointVector<N>::Zero(), (near_s_.array() + sample_period_s_).min(kSettlingS).matrix());
    return near_s_.array() < kSettlingS;
  }

  Command<N> control(const ObserverState<N>& state, const ModelSample<N>& model, const ReferenceVectors<N>& reference,
                     StepReport& /*report*/) noexcept override {
    fed_back_ = parameters_.feedback.kp * (state.angle - reference.angle) +
                parameters_.feedback.kd * (state.speed - reference.speed) +
                parameters_.feedback.ki * state.integral_error - state.filtered_disturbance;
    const JointVector<N> inertial = model.torque(fed_back_) - model.gravity_torque();
    return {fed_forward_ + parameters_.inertia_scale * inertial - damping_,
            JointVector<N>::Constant(parameters_.feedback.ki)};
  }

  // The inverse of the inertia is asked for only where a limit acted.
  Motion predict(const ObserverState<N>& state, const ModelSample<N>& model, const ReferenceVectors<N>& reference,
                 StepReport& report) noexcept override {
    JointVector<N> applied = reference.acceleration + fed_back_;
    const JointVector<N> limited = from_array<N>(report.torque_applied) - from_array<N>(report.torque_commanded);
    if (!limited.isZero(0.0)) {
      const JointVector<N> lost = model.acceleration(limited) / parameters_.inertia_scale;
      if (lost.allFinite()) {
        applied += lost;
      } else {
        report.flags |= kModelInvalid;
      }
    }
    return {applied + state.disturbance, state.disturbance_rate};
  }

  LinkDampedParameters parameters_;
  LinkFeedforward<N> feedforward_;
  JointVector<N> rotor_;
  JointVector<N> stiffness_;
  JointVector<N> dead_zone_;
  double sample_period_s_;
  JointVector<N> damping_per_sample_;                    // D_s / T
  JointVector<N> fed_forward_ = JointVector<N>::Zero();  // F
  JointVector<N> fed_back_ = JointVector<N>::Zero();     // a
  JointVector<N> damping_ = JointVector<N>::Zero();      // torque of this sample
  JointVector<N> wound_ = JointVector<N>::Zero();
  JointVector<N> before_ = JointVector<N>::Zero();  // u of the sample before
  JointVector<N> near_s_ = JointVector<N>::Zero();  // for how long the joint has been near a reference that rests
  bool sensed_ = false;
  bool was_wound_ = false;
};

std::unique_ptr<ControlLaw> LinkDampedParameters::make_law(const LawSettings& settings) const {
  return make_law_of_size<LinkDampedLaw>(*this, settings);
}

}  // namespace

namespace laws {

LawKind link_damped() {
  using P = LinkDampedParameters;
  LawTable<P> law("link-damped", Inertia::kTableOrChain);
  law.object("feedback", &P::feedback, feedback_table());
  law.numbers("observer", &P::observer);
  law.positive("filter_time_constant_s", &P::filter_time_constant_s);
  law.positive("inertia_scale", &P::inertia_scale);
  law.positive_joint_values("rotor_inertia_kg_m2", &P::rotor_inertia);
  law.positive_joint_values("stiffness_nm_rad", &P::stiffness);
  law.joint_values("relative_damping_nm_s", &P::relative_damping);
  law.joint_values("friction_viscous_nm_s", &P::viscous);
  law.joint_values("friction_coulomb_nm", &P::coulomb);
  law.optional_non_negative_joint_values("dead_zone_rad", &P::dead_zone);
  law.finish(require_chain<P>);
  return law.kind();
}

}  // namespace laws
}  // namespace quasilpv
