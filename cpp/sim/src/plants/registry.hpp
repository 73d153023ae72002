// All kinds of plants that a scenario can name.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "document/field.hpp"
#include "quasilpv/plant.hpp"

namespace quasilpv {

/// One kind of plant: its name in scenarios, and what makes it from the member `plant` of one.
struct PlantKind {
  std::string name;
  std::function<PlantFactory(const Field& plant)> read;  ///< INIT-ONLY. Throws InputError.
};

/// In the order of `docs/reference/formats.md`. INIT-ONLY.
const std::vector<PlantKind>& plant_kinds();

/// Strict reading of the member `plant` of a scenario. INIT-ONLY. Throws InputError.
PlantFactory read_plant(const Field& plant);

}  // namespace quasilpv
