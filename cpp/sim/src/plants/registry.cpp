#include "plants/registry.hpp"

#include "document/kinds.hpp"

namespace quasilpv {

// One line per kind of plant: the function of its file that describes it.
#define QUASILPV_PLANTS(PLANT) \
  PLANT(serial_arm)            \
  PLANT(five_bar)              \
  PLANT(spring_disc)           \
  PLANT(tree)                  \
  PLANT(elastic_tree)

namespace plants {
#define DECLARE(plant) PlantKind plant();
QUASILPV_PLANTS(DECLARE)
#undef DECLARE
}  // namespace plants

const std::vector<PlantKind>& plant_kinds() {
#define CALL(plant) plants::plant(),
  static const std::vector<PlantKind> kinds{QUASILPV_PLANTS(CALL)};
#undef CALL
  return kinds;
}

PlantFactory read_plant(const Field& plant) { return find_kind(plant_kinds(), plant["kind"]).read(plant); }

}  // namespace quasilpv
