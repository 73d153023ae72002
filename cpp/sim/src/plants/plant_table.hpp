// How a kind of plant describes itself: one line per parameter of its document.
#pragma once

#include <memory>
#include <string>

#include "document/member_table.hpp"
#include "plants/registry.hpp"
#include "quasilpv/planar_link.hpp"

namespace quasilpv {

/// The parameters of a plant, or of a part of one, in the order in which they are read. INIT-ONLY.
template <class Parameters>
class PlantTable : public MemberTable<Parameters> {
 public:
  /// What must be positive; a number that is not is left to the plant's own check, which says why.
  void size(const char* name, double Parameters::*at) {
    this->add({name, "positive"}, [at](const Field& field, int /*joints*/, Parameters& parameters) {
      const double value = field.number();
      parameters.*at = value > 0.0 ? field.positive() : value;
    });
  }

  /// The kind of this name, whose plant is a `PlantOfKind`. \param check of the parameters; source and path name their
  /// origin in errors.
  template <class PlantOfKind>
  PlantKind kind(const char* name,
                 void (*check)(const Parameters&, const std::string& source, const std::string& path)) const {
    return {name, [table = *this, check](const Field& plant) -> PlantFactory {
              Parameters parameters;
              table.read(plant, 0, parameters, {"kind"});
              check(parameters, plant.source(), plant.path());
              return [parameters] { return std::make_unique<PlantOfKind>(parameters); };
            }};
  }
};

/// Of one link.
PlantTable<PlanarLink> planar_link_table();

}  // namespace quasilpv
