#include "quasilpv/monitor.hpp"

#include <array>

namespace quasilpv {

Monitor::Monitor(const Artifact& artifact)
    : model_(std::visit([](const auto& law) { return law.model; }, artifact.law())) {}

MonitorReport Monitor::observe(const JointArray& angle) const noexcept {
  std::array<double, kMaxPremises> premise{};
  model_.premises.evaluate(ProgramInput{angle.data()}, premise.data());
  MonitorReport report;
  report.premise_excess = model_.inertia.excess(premise.data());
  model_.inertia.clamp(premise.data());
  report.membership_sum = model_.inertia.weight_sum(premise.data());
  return report;
}

}  // namespace quasilpv
