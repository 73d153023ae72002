// The plant kinds a scenario can name. A new plant is one alternative here and one case in plant_parameters.cpp.
#pragma once

#include <memory>
#include <string>
#include <variant>

#include "quasilpv/document.hpp"
#include "quasilpv/five_bar.hpp"
#include "quasilpv/plant.hpp"
#include "quasilpv/serial_arm.hpp"
#include "quasilpv/spring_disc.hpp"
#include "quasilpv/tree_plant.hpp"

namespace quasilpv {

/// One alternative per plant kind of the scenario format.
using PlantParameters = std::variant<SerialArmParameters, FiveBarParameters, SpringDiscParameters, TreePlantParameters>;

/// Strict reading of the member `plant` of a scenario; `source` names the file in errors. INIT-ONLY. Throws InputError.
PlantParameters read_plant(const Field& field, const std::string& source);

/// The plant, at rest under no torque. INIT-ONLY. Throws InputError.
std::unique_ptr<Plant> make_plant(const PlantParameters& parameters);

}  // namespace quasilpv
