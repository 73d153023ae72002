#include "quasilpv/integrator.hpp"

#include "quasilpv/ida_integrator.hpp"
#include "quasilpv/rk4_integrator.hpp"

namespace quasilpv {

std::unique_ptr<Integrator> make_integrator(const IntegratorOptions& options, const Plant& plant,
                                            double sample_period_s) {
  if (const auto* ida = std::get_if<IdaOptions>(&options)) {
    return std::make_unique<IdaIntegrator>(plant, *ida);
  }
  return std::make_unique<Rk4Integrator>(plant, sample_period_s / std::get<Rk4Options>(options).steps_per_sample);
}

}  // namespace quasilpv
