// Arms and small tools that several tests of the plant library share.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <random>

#include "quasilpv/serial_arm.hpp"

namespace quasilpv::testing {

/// Uniform numbers from a fixed seed.
class Uniform {
 public:
  explicit Uniform(std::uint64_t seed) : generator_(seed) {}
  double operator()(double low, double high) { return std::uniform_real_distribution<double>(low, high)(generator_); }
  Eigen::VectorXd vector(int size, double bound) {
    return Eigen::VectorXd::NullaryExpr(size, [&] { return (*this)(-bound, bound); });
  }

 private:
  std::mt19937_64 generator_;
};

/// The three-link arm of Dehak 2022, Table I.4; moments of inertia about the joint axes.
inline SerialArmParameters three_link_arm(double friction_nm_s = 0.0) {
  return {"arm3",
          9.81,
          {{1.0, 5.0, 0.5, 2.0, friction_nm_s},
           {0.9, 4.9, 0.489, 1.9, friction_nm_s},
           {0.8, 4.2, 0.4, 1.3, friction_nm_s}}};
}

/// A physical arm with `joints` links of random size, some centres of mass beyond the next joint or behind their own.
inline SerialArmParameters random_arm(int joints, Uniform& uniform) {
  SerialArmParameters arm{"random", uniform(-15.0, 15.0), {}};
  for (int k = 0; k < joints; ++k) {
    PlanarLink link;
    link.length_m = uniform(0.2, 1.5);
    link.mass_kg = uniform(0.1, 8.0);
    link.com_m = uniform(-0.3, 1.2) * link.length_m;
    link.inertia_kg_m2 = link.mass_kg * link.com_m * link.com_m + uniform(0.01, 1.0);
    link.friction_nm_s = uniform(0.0, 5.0);
    arm.links.push_back(link);
  }
  return arm;
}

/// One pendulum: a point mass of 1 kg on a massless rod of `length_m`.
inline SerialArmParameters point_pendulum(double length_m, double gravity_m_s2 = 9.81) {
  return {"pendulum", gravity_m_s2, {{length_m, 1.0, length_m, length_m * length_m, 0.0}}};
}

/// Derivative at 0 of a function of one number, by the central difference of fourth order.
template <class Function>
auto derivative_at_zero(const Function& f, double h) {
  using Value = std::decay_t<decltype(f(h))>;
  const Value near = f(h) - f(-h);
  const Value far = f(2.0 * h) - f(-2.0 * h);
  return Value((8.0 * near - far) / (12.0 * h));
}

}  // namespace quasilpv::testing
