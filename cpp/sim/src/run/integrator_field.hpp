// The integrator that a scenario names.
#pragma once

#include "document/field.hpp"
#include "quasilpv/integrator.hpp"

namespace quasilpv {

/// Reads `{kind, ...}`. INIT-ONLY. Throws InputError.
IntegratorOptions read_integrator(const Field& field);

/// `value`, which was read from `field`. Throws InputError if it is above `limit`.
double at_most(double limit, const Field& field, double value);

}  // namespace quasilpv
