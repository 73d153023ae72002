// PID of the motors of elastic joints, with the inverse dynamics of the links fed forward.
#include "laws/common/acceleration_law.hpp"
#include "laws/common/link_feedforward.hpp"

namespace quasilpv {
namespace {

/// What the correction of the motors' reference is told by.
enum class CorrectionSource : std::uint8_t {
  kMotorTorque,  ///< what the motor's torque is beside that which was foreseen
  kJointTorque,  ///< the same of the joint's torque, by its sensor
  kDeflection    ///< how far the gear is wound, by encoders on both sides
};

/// Scalars of the sampled law, the same for every joint. Errors are x - x_r: stabilising kp, kd and ki are negative.
struct MotorPidParameters final : ObserverParameters {
  MotorPidParameters() { filter_time_constant_s = 1.0; }  // of a disturbance that nothing feeds back

  AccelerationFeedback feedback;
  ObserverGains observer{};
  JointArray rotor_inertia{};         ///< B, kg m^2, reflected to the joints
  JointArray stiffness{};             ///< K of the gears, N m/rad
  double correction_bandwidth = 0.0;  ///< of the reference's correction, rad/s; 0: none
  CorrectionSource correction_source = CorrectionSource::kMotorTorque;
  JointArray viscous{};    ///< of the motors, N m s/rad, as far as it is known
  JointArray coulomb{};    ///< likewise, N m
  double dead_zone = 0.0;  ///< of integral and correction: errors up to this are left alone, rad

  AngleSide controlled_side() const noexcept override { return AngleSide::kMotor; }
  std::unique_ptr<ControlLaw> make_law(const LawSettings& settings) const override;
};

/// The measured angles y are the motors', reflected to the joints. With the inverse dynamics ID of the links along the
/// reference, and x_hat = [th, w, a_d, j_d] of the motors:
///
///     tau_r  = ID(r, r', r'');   r_m = r + K^-1 tau_r + c_2,   r_m' = r',   r_m'' = r''  the reference of the motors
///     x_hat += [l1, l2, l3, l4] (y - th)                                                current estimator
///     a_cmd  = r'' + kp (th - r_m) + kd (w - r') + ki e_I
///     Gamma  = B a_cmd + tau_r + f r' + c tanh(r' / w_0), limited                       f, c: friction of the motors
///     where |y - r_m| is beyond the dead zone, joint by joint, or there is none:
///     e_I   += T (y - r_m)                                        anti-windup: see integrate_error()
///     c_1   += (1 - p) (u - c_1);  c_2 += (1 - p) (c_1 - c_2),                      p = exp(-w_c T)
///     everywhere:
///     a_app  = B^-1 (Gamma_applied - fed forward) + a_d,  then as in DobAccelerationLaw
///
/// What the spring is wound beside what was foreseen is u: from the motor's torque K^-1 (Gamma_applied - fed forward -
/// B r''), from a sensor of the joint's torque K^-1 (tau_J - tau_r), from encoders on both sides y - q - K^-1 tau_r.
/// Slowly, through two lags, the reference of the motors follows, so that the link comes back. Without the sensor's
/// reading of a sample c_1 and c_2 stay.
/// The observer tells the speed; its disturbance is not fed back: the spring's torque is most of it.
/// Source: Spong 1987, Modeling and control of elastic joint robots; De Luca and Book 2016, Springer Handbook of
/// Robotics, section 11.1 (feedforward by the rigid inverse dynamics, elastic reference of the motors).
template <int N>
class MotorPidLaw final : public AccelerationLaw<N> {
 public:
  MotorPidLaw(const MotorPidParameters& parameters, const LawSettings& settings)
      : AccelerationLaw<N>(parameters, parameters.observer, settings),
        parameters_(parameters),
        feedforward_(parameters.model, parameters.viscous, parameters.coulomb),
        rotor_(from_array<N>(parameters.rotor_inertia)),
        stiffness_(from_array<N>(parameters.stiffness)),
        dead_zone_(JointVector<N>::Constant(parameters.dead_zone)),
        correction_pole_(std::exp(-parameters.correction_bandwidth * settings.sample_period_s)) {}

 private:
  using typename AccelerationLaw<N>::Motion;

  /// Which motors are away from their reference.
  JointMask<N> away(const ModelSample<N>& model, const ReferenceVectors<N>& reference) const noexcept {
    return outside<N>(dead_zone_, model.angle - reference.angle);
  }

  void sense(const StepInput& input) noexcept override {
    sensed_ = input.valid;
    if (parameters_.correction_source == CorrectionSource::kJointTorque) {
      sensed_ = sensed_ && input.gears.has(kJointTorque);
      wound_ = from_array<N>(input.gears.joint_torque_nm).cwiseQuotient(stiffness_);
    } else if (parameters_.correction_source == CorrectionSource::kDeflection) {
      sensed_ = sensed_ && input.gears.has(kLinkAngle);
      wound_ = from_array<N>(input.angle) - from_array<N>(input.gears.link_angle_rad);
    }
  }

  void begin() noexcept override {
    lagging_.setZero();
    correction_.setZero();
  }

  ReferenceVectors<N> shape(const ReferenceVectors<N>& reference) noexcept override {
    fed_forward_ = feedforward_.dynamics(reference);
    ReferenceVectors<N> motors = reference;
    foreseen_ = fed_forward_.cwiseQuotient(stiffness_);
    motors.angle += foreseen_ + correction_;
    fed_forward_ += feedforward_.friction(reference.speed);
    return motors;
  }

  Command<N> control(const ObserverState<N>& state, const ModelSample<N>& model, const ReferenceVectors<N>& reference,
                     StepReport& /*report*/) noexcept override {
    const JointVector<N> acceleration =
        reference.acceleration + parameters_.feedback.kp * (state.angle - reference.angle) +
        parameters_.feedback.kd * (state.speed - reference.speed) + parameters_.feedback.ki * state.integral_error;
    // A joint without a gain is not integrated.
    const JointVector<N> gain = away(model, reference).select(JointVector<N>::Constant(parameters_.feedback.ki), 0.0);
    return {rotor_.cwiseProduct(acceleration) + fed_forward_, gain};
  }

  Motion predict(const ObserverState<N>& state, const ModelSample<N>& model, const ReferenceVectors<N>& reference,
                 StepReport& report) noexcept override {
    const JointVector<N> torque = from_array<N>(report.torque_applied);
    if (parameters_.correction_source == CorrectionSource::kMotorTorque) {
      const JointVector<N> inertial = rotor_.cwiseProduct(reference.acceleration);
      follow((torque - fed_forward_ - inertial).cwiseQuotient(stiffness_), away(model, reference));
    } else if (sensed_) {
      follow(wound_ - foreseen_, away(model, reference));
    }
    return {(torque - fed_forward_).cwiseQuotient(rotor_) + state.disturbance, state.disturbance_rate};
  }

  /// Of motors that are away: otherwise it drags the reference out from under a motor that sticks.
  void follow(const JointVector<N>& unforeseen, const JointMask<N>& away) noexcept {
    const JointVector<N> share = away.select(JointVector<N>::Constant(1.0 - correction_pole_), 0.0);
    lagging_ += share.cwiseProduct(unforeseen - lagging_);
    correction_ += share.cwiseProduct(lagging_ - correction_);
  }

  MotorPidParameters parameters_;
  LinkFeedforward<N> feedforward_;
  JointVector<N> rotor_;
  JointVector<N> stiffness_;
  JointVector<N> dead_zone_;
  double correction_pole_;
  JointVector<N> fed_forward_ = JointVector<N>::Zero();  // tau_r and friction
  JointVector<N> foreseen_ = JointVector<N>::Zero();     // K^-1 tau_r
  JointVector<N> wound_ = JointVector<N>::Zero();        // by a sensor, in this sample
  bool sensed_ = false;
  JointVector<N> lagging_ = JointVector<N>::Zero();     // c_1
  JointVector<N> correction_ = JointVector<N>::Zero();  // c_2
};

std::unique_ptr<ControlLaw> MotorPidParameters::make_law(const LawSettings& settings) const {
  return make_law_of_size<MotorPidLaw>(*this, settings);
}

CorrectionSource read_source(const Field& field) {
  const std::string name = field.text();
  if (name == "motor-torque") {
    return CorrectionSource::kMotorTorque;
  }
  if (name == "joint-torque") {
    return CorrectionSource::kJointTorque;
  }
  if (name != "deflection") {
    field.fail_choice({"motor-torque", "joint-torque", "deflection"});
  }
  return CorrectionSource::kDeflection;
}

}  // namespace

namespace laws {

LawKind motor_pid() {
  using P = MotorPidParameters;
  LawTable<P> law("motor-pid", Inertia::kTableOrChain);
  law.object("feedback", &P::feedback, feedback_table());
  law.numbers("observer", &P::observer);
  law.positive_joint_values("rotor_inertia_kg_m2", &P::rotor_inertia);
  law.positive_joint_values("stiffness_nm_rad", &P::stiffness);
  law.non_negative("correction_bandwidth_rad_s", &P::correction_bandwidth);
  law.add({"correction_source", "correction-source"},
          [](const Field& field, int /*joints*/, P& target) { target.correction_source = read_source(field); });
  law.joint_values("friction_viscous_nm_s", &P::viscous);
  law.joint_values("friction_coulomb_nm", &P::coulomb);
  law.non_negative("dead_zone_rad", &P::dead_zone);
  law.finish(require_chain<P>);
  return law.kind();
}

}  // namespace laws
}  // namespace quasilpv
