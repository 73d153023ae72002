// What the actuated joints of a plant do at one instant.
#pragma once

#include "quasilpv/step.hpp"

namespace quasilpv {

/// The truth at plant time t, which sensors blur and the controller never sees. Entries from the number of joints on
/// are 0.
struct PlantSample {
  JointArray angle{};            ///< rad
  JointArray speed{};            ///< rad/s
  JointArray acceleration{};     ///< rad/s^2, of the torque in force
  JointArray external_torque{};  ///< N m, at t
};

}  // namespace quasilpv
