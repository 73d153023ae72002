// Five-bars that several tests share.
#pragma once

#include "arm_fixtures.hpp"
#include "quasilpv/five_bar.hpp"

namespace quasilpv::testing {

/// The mechanism of Dehak 2022 (IV.5.2), uniform rods of 0.165 m; unequal legs with another passive length, which show
/// the drift of the constraint that equal ones hide.
inline FiveBarParameters thesis_five_bar(double passive_length_m = 0.165) {
  FiveBarParameters five_bar;
  five_bar.label = "five-bar";
  five_bar.active = {0.165, 0.0825, 0.0825, 0.0011, 0.0};
  five_bar.passive = {passive_length_m, 0.0825, 0.0825, 0.0007, 0.0};
  return five_bar;
}

/// A physical five-bar with friction and springs; the passive links are the longer ones, so that every opening in
/// (0, pi) can be assembled.
inline FiveBarParameters random_five_bar(Uniform& uniform) {
  const SerialArmParameters leg = random_arm(2, uniform);
  FiveBarParameters five_bar;
  five_bar.label = "random";
  five_bar.gravity_m_s2 = leg.gravity_m_s2;
  five_bar.active = leg.links[0];
  five_bar.passive = leg.links[1];
  five_bar.passive.length_m = five_bar.active.length_m * uniform(1.1, 1.5);
  five_bar.spring_nm_rad = uniform(0.0, 10.0);
  five_bar.spring_rest_rad = {uniform(-1.0, 0.0), uniform(0.0, 1.0)};
  five_bar.baumgarte_per_s = uniform(0.0, 100.0);
  return five_bar;
}

/// An assembled state in motion, away from the singular configurations.
inline Eigen::VectorXd random_state(const FiveBar& five_bar, Uniform& uniform) {
  const double direction = uniform(-2.0, 2.0), opening = uniform(0.4, 2.7);
  return five_bar.initial_state({direction - 0.5 * opening, direction + 0.5 * opening},
                                {uniform(-3.0, 3.0), uniform(-3.0, 3.0)});
}

}  // namespace quasilpv::testing
