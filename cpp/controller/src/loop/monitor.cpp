#include "quasilpv/monitor.hpp"

#include <array>

namespace quasilpv {

Monitor::Monitor(const Artifact& artifact)
    : model_(artifact.law().model), sample_period_s_(artifact.sample_period_s()) {
  if (const LyapunovBound* const bound = artifact.law().lyapunov_bound()) {
    bound_ = *bound;
  }
}

MonitorReport Monitor::observe(const StepInput& input, const StepReport& report) const noexcept {
  const bool measured = (report.flags & kMeasurementInvalid) == 0;
  const JointArray& angle = measured ? input.angle : report.estimated_angle;
  MonitorReport seen;
  if (!model_.tree) {
    std::array<double, kMaxPremises> premise{};
    model_.premises.evaluate(ProgramInput{angle.data()}, premise.data());
    seen.premise_excess = model_.inertia.excess(premise.data());
    model_.inertia.clamp(premise.data());
    seen.membership_sum = model_.inertia.weight_sum(premise.data());
  }
  if (bound_ && (report.flags & (kMeasurementInvalid | kReferenceInvalid)) == 0) {
    seen.lyapunov = lyapunov(*bound_, input, report);
  }
  return seen;
}

double Monitor::lyapunov(const LyapunovBound& bound, const StepInput& input, const StepReport& report) const noexcept {
  const double T = sample_period_s_;
  Eigen::Matrix<double, LyapunovBound::kSignals, kMaxJoints> signals;
  for (int joint = 0; joint < kMaxJoints; ++joint) {
    const auto j = static_cast<std::size_t>(joint);
    signals.col(joint) << input.angle[j] - input.reference.angle[j],
        (input.angle[j] - report.estimated_angle[j]) / bound.innovation_share,
        T * (report.estimated_speed[j] - input.reference.speed[j]),
        T * T * (report.estimated_disturbance[j] - report.filtered_disturbance[j]), report.integral_error[j] / T;
  }
  const Eigen::Matrix<double, kMaxJoints, kMaxJoints> energy = signals.transpose() * bound.signals * signals;
  return energy.cwiseProduct(bound.joints).sum();
}

}  // namespace quasilpv
