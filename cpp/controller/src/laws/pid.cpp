// PID with feedforward: the baseline of industry.
#include "laws/common/law_table.hpp"
#include "laws/common/velocity_law.hpp"

namespace quasilpv {
namespace {

/// Gains in N m/rad, N m s/rad, N m/(rad s), acting on r - y.
struct PidParameters final : VelocityParameters {
  Program coriolis_reference;  ///< N(y, w) r'
  JointArray kp{};
  JointArray kd{};
  JointArray ki{};

  const Program* coriolis() const noexcept override { return model.tree ? nullptr : &coriolis_reference; }
  std::unique_ptr<ControlLaw> make_law(const LawSettings& settings) const override;
};

/// With e = r - y, w the filtered measured speed:
///
///     Gamma = kp e + kd (r' - w) + ki e_I + M(z) r'' + N(y, w) r' + G(y), limited;   e_I += T e
///
/// With a chain of bodies as design inertia only gravity is fed forward, Gamma = kp e + kd (r' - w) + ki e_I + G(y):
/// PID with gravity compensation, and PD for ki = 0.
///
/// Anti-windup: see integrate_error(). Without a valid measurement the last one is held and e_I is frozen.
/// Source: Dehak 2022, (III.54), with the sign of e that makes the printed gains stabilising.
template <int N>
class PidLaw final : public VelocityLaw<N> {
 public:
  PidLaw(const PidParameters& parameters, const LawSettings& settings)
      : VelocityLaw<N>(parameters, settings),
        coriolis_reference_(parameters.coriolis_reference),
        kp_(from_array<N>(parameters.kp)),
        kd_(from_array<N>(parameters.kd)),
        ki_(from_array<N>(parameters.ki)) {}

 private:
  using typename VelocityLaw<N>::Sample;

  bool feeds_forward() const noexcept override { return true; }

  Command<N> control(const Sample& sample, const ModelSample<N>& model, StepReport& /*report*/) noexcept override {
    const auto& [reference, y, w, integral] = sample;
    const JointVector<N> feedback =
        kp_.cwiseProduct(reference.angle - y) + kd_.cwiseProduct(reference.speed - w) + ki_.cwiseProduct(integral);
    if (model.tree != nullptr) {
      return {feedback + model.gravity_torque(), ki_};
    }
    JointVector<N> coriolis;
    coriolis_reference_.evaluate({y.data(), w.data(), reference.speed.data()}, coriolis.data());
    return {feedback + model.inertia * reference.acceleration + coriolis + model.gravity, ki_};
  }

  Program coriolis_reference_;
  JointVector<N> kp_;
  JointVector<N> kd_;
  JointVector<N> ki_;
};

std::unique_ptr<ControlLaw> PidParameters::make_law(const LawSettings& settings) const {
  return make_law_of_size<PidLaw>(*this, settings);
}

}  // namespace

namespace laws {

LawKind pid() {
  using P = PidParameters;
  LawTable<P> law("pid", Inertia::kTableOrChain);
  law.joint_values("kp", &P::kp);
  law.joint_values("kd", &P::kd);
  law.joint_values("ki", &P::ki);
  law.non_negative("velocity_filter_time_constant_s", &P::velocity_filter_time_constant_s);
  law.optional_non_negative_joint_values("dead_zone_rad", &P::dead_zone);
  law.torque_program("coriolis_reference", &P::coriolis_reference, {0, true, true});
  return law.kind();
}

}  // namespace laws
}  // namespace quasilpv
