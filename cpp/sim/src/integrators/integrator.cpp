#include "quasilpv/integrator.hpp"

#include "quasilpv/errors.hpp"
#include "quasilpv/ida_integrator.hpp"
#include "quasilpv/rk4_integrator.hpp"

namespace quasilpv {

std::unique_ptr<Integrator> make_integrator(const IntegratorOptions& options, const ImplicitSystem& system,
                                            double sample_period_s) {
  if (const auto* ida = std::get_if<IdaOptions>(&options)) {
    return std::make_unique<IdaIntegrator>(system, *ida);
  }
  if (const auto* rk4 = std::get_if<Rk4Options>(&options)) {
    return std::make_unique<Rk4Integrator>(system, sample_period_s / rk4->steps_per_sample);
  }
  throw InputError("scenario", "integrator.kind", "mujoco", "ida or rk4: MuJoCo runs in the process of design track");
}

}  // namespace quasilpv
