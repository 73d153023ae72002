// How the friction of a joint is read.
#pragma once

#include "document/field.hpp"
#include "quasilpv/decimal.hpp"
#include "quasilpv/joint_friction.hpp"

namespace quasilpv {

/// The friction of one joint of a scenario's plant. INIT-ONLY. Throws InputError.
inline JointFriction read_friction(const Field& joint) {
  JointFriction friction;
  friction.viscous_nm_s = joint["friction_viscous_nm_s"].non_negative();
  friction.coulomb_nm = joint["friction_coulomb_nm"].non_negative();
  friction.coulomb_speed_rad_s = joint["coulomb_speed_rad_s"].positive();
  if (!joint.has("stick_slip") || joint["stick_slip"].is_null()) {
    return friction;
  }
  const Field sticking = joint["stick_slip"];
  sticking.only({"breakaway_nm", "stribeck_speed_rad_s", "presliding_rad", "presliding_damping_nm_s"});
  if (friction.coulomb_nm <= 0.0) {
    joint["friction_coulomb_nm"].fail("0", "more than 0 with stick_slip");
  }
  friction.breakaway_nm = sticking["breakaway_nm"].positive();
  if (friction.breakaway_nm < friction.coulomb_nm) {
    sticking["breakaway_nm"].fail(format_number(friction.breakaway_nm), "at least friction_coulomb_nm");
  }
  friction.stribeck_speed_rad_s = sticking["stribeck_speed_rad_s"].positive();
  friction.presliding_rad = sticking["presliding_rad"].positive();
  friction.presliding_damping_nm_s = sticking["presliding_damping_nm_s"].non_negative();
  return friction;
}

}  // namespace quasilpv
