// Friction with stick and slip: what no motion gets out of it, where it sticks, and its slopes.
#include "quasilpv/joint_friction.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace quasilpv {
namespace {

JointFriction sticking(double breakaway = 3.6) {
  JointFriction friction;
  friction.viscous_nm_s = 0.4;
  friction.coulomb_nm = 2.0;
  friction.breakaway_nm = breakaway;
  friction.stribeck_speed_rad_s = 1e-2;
  friction.presliding_rad = 2e-5;
  friction.presliding_damping_nm_s = 150.0;
  return friction;
}

/// Log-uniform in magnitude, either sign.
double spread(std::mt19937_64& generator, double low, double high) {
  std::uniform_real_distribution<double> exponent(std::log(low), std::log(high));
  return (generator() % 2 == 0 ? 1.0 : -1.0) * std::exp(exponent(generator));
}

// The power that goes in, less what the bristle stores, is never negative: pointwise, so for every motion.
TEST(JointFriction, no_state_gives_more_power_than_the_bristle_loses) {
  std::mt19937_64 generator(3);
  double least = 1.0;
  for (const double breakaway : {2.0, 2.4, 3.6, 8.0, 40.0}) {
    for (const double damping : {0.0, 1.0, 150.0, 1e5}) {
      JointFriction friction = sticking(breakaway);
      friction.viscous_nm_s = 0.0;
      friction.presliding_damping_nm_s = damping;
      for (int i = 0; i < 10000; ++i) {
        const double w = spread(generator, 1e-9, 1e2);
        const double b = spread(generator, 1e-6, 1.5);
        const double stored = friction.breakaway_nm * friction.presliding_rad * b * friction.bristle_rate(w, b);
        const double taken = friction.torque(w, b) * w;
        EXPECT_GE(taken - stored, -1e-12 * (std::abs(taken) + std::abs(stored))) << w << ' ' << b << ' ' << damping;
        least = std::min(least, (taken - stored) / std::abs(taken + stored));
      }
    }
  }
  EXPECT_LT(least, 1e-9);  // the bound is reached: a bristle that sticks without damping keeps all
}

TEST(JointFriction, slides_at_coulombs_torque_and_falls_to_it_from_the_break_away_torque) {
  const JointFriction friction = sticking();
  for (const double w : {1e-7, 1e-3, 5e-3, 0.1, 3.0}) {
    double b = 0.0;
    for (int i = 0; i < 200000; ++i) {  // to its equilibrium, at this speed
      b += 0.05 * friction.presliding_rad / w * friction.bristle_rate(w, b);
    }
    const double excess = 1.6 * std::exp(-(w / 1e-2) * (w / 1e-2));
    EXPECT_NEAR(friction.torque(w, b), 2.0 + excess + 0.4 * w, 1e-3) << w;
    EXPECT_NEAR(friction.torque(-w, -b), -friction.torque(w, b), 1e-12);
  }
}

TEST(JointFriction, a_bristle_below_its_elastic_share_comes_back) {
  const JointFriction friction = sticking();
  for (const double w : {1e-6, 1e-4}) {
    for (const double b : {-0.79, -0.2, 0.3, 0.79}) {
      EXPECT_EQ(friction.bristle_rate(w, b) * friction.presliding_rad, w);
      EXPECT_EQ(friction.bristle_rate(-w, b) * friction.presliding_rad, -w);
    }
  }
}

TEST(JointFriction, has_the_slopes_of_its_torque_and_its_rate) {
  std::mt19937_64 generator(5);
  for (const JointFriction& friction : {sticking(), JointFriction{0.4, 2.0, 1e-2}}) {
    for (int i = 0; i < 2000; ++i) {
      const double w = spread(generator, 1e-4, 1.0);
      const double b = spread(generator, 1e-2, 1.2);
      const double dw = 1e-6 * std::abs(w);
      const double db = 1e-7;
      const JointFriction::Slopes slopes = friction.slopes(w, b);
      const auto near = [&](double slope, double ahead, double behind, double step) {
        const double expected = (ahead - behind) / (2.0 * step);
        const double size = std::max(std::abs(ahead), std::abs(behind)) / step;
        EXPECT_NEAR(slope, expected, 2e-4 * std::abs(expected) + 1e-8 * size) << w << ' ' << b;
      };
      near(slopes.torque_by_speed, friction.torque(w + dw, b), friction.torque(w - dw, b), dw);
      near(slopes.torque_by_bristle, friction.torque(w, b + db), friction.torque(w, b - db), db);
      near(slopes.rate_by_speed, friction.bristle_rate(w + dw, b), friction.bristle_rate(w - dw, b), dw);
      near(slopes.rate_by_bristle, friction.bristle_rate(w, b + db), friction.bristle_rate(w, b - db), db);
    }
  }
}

}  // namespace
}  // namespace quasilpv
