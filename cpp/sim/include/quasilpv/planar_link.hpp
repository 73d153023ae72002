// One link of a planar mechanism, as every plant made of links describes it.
#pragma once

#include <string>

namespace quasilpv {

/// Length, mass distribution and joint friction of a link.
struct PlanarLink {
  double length_m = 0.0;       ///< L > 0, from its joint to the next one (or to the tool)
  double mass_kg = 0.0;        ///< m > 0
  double com_m = 0.0;          ///< r, centre of mass from the joint, along the link
  double inertia_kg_m2 = 0.0;  ///< I > 0 about the *joint axis*, at least m r^2 (parallel axis theorem)
  double friction_nm_s = 0.0;  ///< f >= 0, viscous friction torque per joint speed
};

/// Checks a link and names the first wrong parameter; `source` and `path` name the origin in the error. INIT-ONLY.
/// Throws InputError; an inertia below m r^2, which would make mass matrices indefinite, among its causes.
void check_link(const PlanarLink& link, const std::string& source, const std::string& path);

}  // namespace quasilpv
