#include "quasilpv/plant_parameters.hpp"

#include <algorithm>
#include <vector>

namespace quasilpv {
namespace {

/// What must be positive: check_link() and its like say so, and why.
double size(const Field& field) {
  const double value = field.number();
  return value > 0.0 ? field.positive() : value;
}

PlanarLink link(const Field& field) {
  field.only({"length_m", "mass_kg", "com_m", "inertia_kg_m2", "friction_nm_s"});
  return {size(field["length_m"]), size(field["mass_kg"]), field["com_m"].number(), size(field["inertia_kg_m2"]),
          field["friction_nm_s"].number()};
}

SerialArmParameters serial_arm(const Field& field, const std::string& source) {
  field.only({"kind", "label", "gravity_m_s2", "links"});
  SerialArmParameters arm;
  arm.label = field["label"].text();
  arm.gravity_m_s2 = field["gravity_m_s2"].number();
  const Field links = field["links"];
  for (std::size_t k = 0; k < links.size(); ++k) {
    arm.links.push_back(link(links.at(k)));
  }
  check_serial_arm(arm, source, field.path());
  return arm;
}

FiveBarFormulation formulation(const Field& field) {
  const std::string name = field.text();
  if (name == "index1") {
    return FiveBarFormulation::kIndex1;
  }
  if (name == "ggl") {
    return FiveBarFormulation::kGgl;
  }
  field.fail("\"" + name + "\"", "\"index1\" or \"ggl\"");
}

FiveBarParameters five_bar(const Field& field, const std::string& source) {
  field.only({"kind", "label", "gravity_m_s2", "active", "passive", "spring_nm_rad", "spring_rest_rad", "formulation",
              "baumgarte_per_s"});
  FiveBarParameters five_bar;
  five_bar.label = field["label"].text();
  five_bar.gravity_m_s2 = field["gravity_m_s2"].number();
  five_bar.active = link(field["active"]);
  five_bar.passive = link(field["passive"]);
  five_bar.spring_nm_rad = field["spring_nm_rad"].number();
  const std::vector<double> rest = field["spring_rest_rad"].numbers(five_bar.spring_rest_rad.size());
  std::copy(rest.begin(), rest.end(), five_bar.spring_rest_rad.begin());
  five_bar.formulation = formulation(field["formulation"]);
  five_bar.baumgarte_per_s = field["baumgarte_per_s"].number();
  check_five_bar(five_bar, source, field.path());
  return five_bar;
}

SpringDiscParameters spring_disc(const Field& field, const std::string& source) {
  field.only({"kind", "label", "mass_kg", "radius_m", "inertia_kg_m2", "inertia_uncertainty_per_kg", "stiffness_n_m",
              "cubic_stiffness_n_m3", "damping_n_s_m"});
  SpringDiscParameters disc;
  disc.label = field["label"].text();
  disc.mass_kg = size(field["mass_kg"]);
  disc.radius_m = size(field["radius_m"]);
  disc.inertia_kg_m2 = size(field["inertia_kg_m2"]);
  disc.inertia_uncertainty_per_kg = field["inertia_uncertainty_per_kg"].number();
  disc.stiffness_n_m = field["stiffness_n_m"].number();
  disc.cubic_stiffness_n_m3 = field["cubic_stiffness_n_m3"].number();
  disc.damping_n_s_m = field["damping_n_s_m"].number();
  check_spring_disc(disc, source, field.path());
  return disc;
}

std::unique_ptr<Plant> make(const SerialArmParameters& arm) { return std::make_unique<SerialArm>(arm); }
std::unique_ptr<Plant> make(const FiveBarParameters& five_bar) { return std::make_unique<FiveBar>(five_bar); }
std::unique_ptr<Plant> make(const SpringDiscParameters& disc) { return std::make_unique<SpringDisc>(disc); }
std::unique_ptr<Plant> make(const TreePlantParameters& tree) { return std::make_unique<TreePlant>(tree); }

}  // namespace

PlantParameters read_plant(const Field& field, const std::string& source) {
  const std::string kind = field["kind"].text();
  if (kind == "serial-arm") {
    return serial_arm(field, source);
  }
  if (kind == "five-bar") {
    return five_bar(field, source);
  }
  if (kind == "spring-disc") {
    return spring_disc(field, source);
  }
  if (kind == "tree") {
    return read_tree_plant(field);
  }
  field["kind"].fail("\"" + kind + "\"", "\"serial-arm\", \"five-bar\", \"spring-disc\" or \"tree\"");
}

std::unique_ptr<Plant> make_plant(const PlantParameters& parameters) {
  return std::visit([](const auto& of_this_kind) { return make(of_this_kind); }, parameters);
}

}  // namespace quasilpv
