#include "quasilpv/planar_link.hpp"

#include <cmath>

#include "plants/plant_table.hpp"
#include "quasilpv/decimal.hpp"
#include "quasilpv/errors.hpp"

namespace quasilpv {

void check_link(const PlanarLink& link, const std::string& source, const std::string& path) {
  const auto require = [&](bool holds, const char* field, double got, const std::string& expected) {
    if (!holds) {
      throw InputError(source, path + "." + field, format_number(got), expected);
    }
  };
  require(std::isfinite(link.length_m) && link.length_m > 0.0, "length_m", link.length_m, "a number > 0");
  require(std::isfinite(link.mass_kg) && link.mass_kg > 0.0, "mass_kg", link.mass_kg, "a number > 0");
  require(std::isfinite(link.com_m), "com_m", link.com_m, "a finite number");
  require(std::isfinite(link.friction_nm_s) && link.friction_nm_s >= 0.0, "friction_nm_s", link.friction_nm_s,
          "a number >= 0 (viscous friction dissipates)");
  require(std::isfinite(link.inertia_kg_m2) && link.inertia_kg_m2 > 0.0, "inertia_kg_m2", link.inertia_kg_m2,
          "a number > 0 (indefinite inertia)");
  // A point mass meets the bound with equality; its decimals may round to just below it.
  const double point_mass_inertia = link.mass_kg * link.com_m * link.com_m;
  require(link.inertia_kg_m2 >= point_mass_inertia * (1.0 - 1e-12), "inertia_kg_m2", link.inertia_kg_m2,
          ">= mass_kg com_m^2 = " + format_number(point_mass_inertia) + " about the joint axis (indefinite inertia)");
}

PlantTable<PlanarLink> planar_link_table() {
  PlantTable<PlanarLink> link;
  link.size("length_m", &PlanarLink::length_m);
  link.size("mass_kg", &PlanarLink::mass_kg);
  link.number("com_m", &PlanarLink::com_m);
  link.size("inertia_kg_m2", &PlanarLink::inertia_kg_m2);
  link.number("friction_nm_s", &PlanarLink::friction_nm_s);
  return link;
}

}  // namespace quasilpv
