// Computed torque, with or without a disturbance observer: the baseline of the literature.
#include <cmath>

#include "document/document.hpp"
#include "laws/common/law_table.hpp"
#include "laws/common/velocity_law.hpp"

namespace quasilpv {
namespace {

/// Gains in 1/s^2, 1/s, 1/s^3, acting on r - y.
struct ComputedTorqueParameters final : VelocityParameters {
  Program bias;  ///< N(y, w) w
  JointArray gp{};
  JointArray gd{};
  JointArray gi{};
  double observer_bandwidth_rad_s = 0.0;  ///< 0: without observer

  const Program* coriolis() const noexcept override { return model.tree ? nullptr : &bias; }
  std::unique_ptr<ControlLaw> make_law(const LawSettings& settings) const override;
};

/// With e = r - y, w the filtered measured speed, a_hat the estimated disturbance acceleration (zero without observer):
///
///     Gamma = M (r'' + gp e + gd (r' - w) + gi e_I - a_hat) + N(y, w) w + G(y), limited;   e_I += T e
///
/// The observer is a_hat = zeta + c w, zeta' = -c zeta - c (f + c w) with f = M^-1 (Gamma_applied - N w - G), so that
/// a_hat' = c (a - a_hat) on the plant w' = f + a. Sampled exactly for f and a held over a period, that is
///
///     a_hat = zeta + kappa w,   zeta+ = q zeta - (1 - q) (f + kappa w),   q = exp(-c T),   kappa = (1 - q) / T
///
/// which gives a_hat+ = q a_hat + (1 - q) a whatever the speed does (holding w as well, kappa = c, would leave the
/// error (c T / (1 - q) - 1) w' in steady acceleration). It starts at a_hat = 0, or, under a torque in force, at what
/// that torque leaves of the reference's acceleration. Anti-windup: see integrate_error(). Without a valid measurement
/// the last one is held and e_I is frozen. Source: Dehak 2022, (III.56), with the sign of the estimate corrected;
/// Mohammadi, Tavakoli, Marquez and Hashemzadeh 2013 for the observer, here in acceleration coordinates with one
/// bandwidth.
template <int N>
class ComputedTorqueLaw final : public VelocityLaw<N> {
 public:
  ComputedTorqueLaw(const ComputedTorqueParameters& parameters, const LawSettings& settings)
      : VelocityLaw<N>(parameters, settings),
        coriolis_(parameters.bias),
        gp_(from_array<N>(parameters.gp)),
        gd_(from_array<N>(parameters.gd)),
        gi_(from_array<N>(parameters.gi)),
        observer_pole_(std::exp(-parameters.observer_bandwidth_rad_s * settings.sample_period_s)),
        observer_gain_((1.0 - observer_pole_) / settings.sample_period_s) {}

 private:
  using typename VelocityLaw<N>::Sample;

  // Who has held the arm up to now has known the disturbance: what of the reference's acceleration its torque does not
  // explain. An observer that begins at zero there lets the arm go for as long as it takes to learn.
  void start(const Sample& sample, const ModelSample<N>& model, const JointVector<N>& in_force) noexcept override {
    observer_state_ = -observer_gain_ * sample.speed;
    if (observer_gain_ == 0.0 || in_force.isZero(0.0)) {
      return;
    }
    coriolis_.evaluate({sample.angle.data(), sample.speed.data(), nullptr}, bias_.data());
    const JointVector<N> known = model.acceleration(in_force - bias_ - model.gravity);
    if (known.allFinite()) {
      observer_state_ += sample.reference.acceleration - known;
    }
  }

  bool feeds_forward() const noexcept override { return true; }

  Command<N> control(const Sample& sample, const ModelSample<N>& model, StepReport& report) noexcept override {
    const auto& [reference, y, w, integral] = sample;
    const JointVector<N> disturbance = observer_state_ + observer_gain_ * w;
    if (model.tree == nullptr) {
      coriolis_.evaluate({y.data(), w.data(), nullptr}, bias_.data());
      bias_ += model.gravity;
      to_array<N>(model.inertia * disturbance, report.estimated_disturbance);
    } else {
      model.tree->inverse_dynamics(y.data(), w.data(), JointVector<N>::Zero().eval().data(), bias_.data());
      to_array<N>(model.torque(disturbance) - model.gravity_torque(), report.estimated_disturbance);
    }
    report.filtered_disturbance = report.estimated_disturbance;
    const JointVector<N> acceleration = reference.acceleration + gp_.cwiseProduct(reference.angle - y) +
                                        gd_.cwiseProduct(reference.speed - w) + gi_.cwiseProduct(integral) -
                                        disturbance;
    if (model.tree == nullptr) {
      return {model.inertia * acceleration + bias_, gi_};
    }
    return {model.torque(acceleration) - model.gravity_torque() + bias_, gi_};
  }

  // The observer. With bandwidth 0 the pole is 1 and the gain 0: the estimate stays zero. If the model has no finite
  // answer, the estimate is held.
  void applied(const Sample& sample, const ModelSample<N>& model, StepReport& report) noexcept override {
    const JointVector<N> known = model.acceleration(from_array<N>(report.torque_applied) - bias_);
    if (!known.allFinite()) {
      report.flags |= kModelInvalid;
      return;
    }
    observer_state_ =
        observer_pole_ * observer_state_ - (1.0 - observer_pole_) * (known + observer_gain_ * sample.speed);
  }

  Program coriolis_;
  JointVector<N> gp_;
  JointVector<N> gd_;
  JointVector<N> gi_;
  double observer_pole_;
  double observer_gain_;
  JointVector<N> bias_ = JointVector<N>::Zero();  // N(y, w) w + G(y) of the sample
  JointVector<N> observer_state_ = JointVector<N>::Zero();
};

std::unique_ptr<ControlLaw> ComputedTorqueParameters::make_law(const LawSettings& settings) const {
  return make_law_of_size<ComputedTorqueLaw>(*this, settings);
}

constexpr const char* kBandwidth = "disturbance_observer_bandwidth_rad_s";

/// The two kinds have one document and differ in whether the bandwidth is zero.
LawTable<ComputedTorqueParameters> table_of(const char* kind) {
  using P = ComputedTorqueParameters;
  LawTable<P> law(kind, Inertia::kTableOrChain);
  law.joint_values("gp", &P::gp);
  law.joint_values("gd", &P::gd);
  law.joint_values("gi", &P::gi);
  law.non_negative("velocity_filter_time_constant_s", &P::velocity_filter_time_constant_s);
  law.optional_non_negative_joint_values("dead_zone_rad", &P::dead_zone);
  law.non_negative(kBandwidth, &P::observer_bandwidth_rad_s);
  law.torque_program("coriolis", &P::bias, {0, true, false});
  return law;
}

}  // namespace

namespace laws {

LawKind computed_torque() {
  LawTable<ComputedTorqueParameters> law = table_of("ctc");
  law.finish([](const Field& document, const ComputedTorqueParameters& parameters) {
    if (parameters.observer_bandwidth_rad_s != 0.0) {
      document[kBandwidth].fail(canonical_number(parameters.observer_bandwidth_rad_s), "0 for kind ctc");
    }
  });
  return law.kind();
}

LawKind computed_torque_observer() {
  LawTable<ComputedTorqueParameters> law = table_of("ctc-dob");
  law.finish([](const Field& document, const ComputedTorqueParameters& parameters) {
    if (parameters.observer_bandwidth_rad_s == 0.0) {
      document[kBandwidth].fail("0", "more than 0 for kind ctc-dob");
    }
  });
  return law.kind();
}

}  // namespace laws
}  // namespace quasilpv
