#include "quasilpv/joint_friction.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace quasilpv {
namespace {

constexpr double kElasticShare = 0.8;
constexpr double kPi = 3.14159265358979323846;

double sign(double value) noexcept { return static_cast<double>(value > 0.0) - static_cast<double>(value < 0.0); }

/// a(r) r and its derivative.
struct Plastic {
  double share = 0.0;
  double slope = 0.0;
};

Plastic plastic(double ratio) noexcept {
  if (!(ratio > kElasticShare)) {
    return {};
  }
  if (ratio >= 1.0) {
    return {ratio, 1.0};
  }
  const double phase = kPi * (ratio - 0.5 * (1.0 + kElasticShare)) / (1.0 - kElasticShare);
  const double blend = 0.5 * (1.0 + std::sin(phase));
  return {blend * ratio, blend + ratio * 0.5 * std::cos(phase) * kPi / (1.0 - kElasticShare)};
}

/// What follows from speed and bristle.
struct Contact {
  double level = 0.0;        // g(w)
  double level_slope = 0.0;  // g'(w)
  double ratio = 0.0;        // r
  double damping = 0.0;      // d(w)
  Plastic plastic;
};

Contact contact(const JointFriction& own, double speed, double bristle) noexcept {
  const double relative = speed / own.stribeck_speed_rad_s;
  const double excess = (own.breakaway_nm - own.coulomb_nm) * std::exp(-relative * relative);
  Contact found;
  found.level = own.coulomb_nm + excess;
  found.level_slope = -2.0 * relative / own.stribeck_speed_rad_s * excess;
  found.ratio = own.breakaway_nm * bristle * sign(speed) / found.level;
  found.damping =
      own.presliding_damping_nm_s / (1.0 + own.presliding_damping_nm_s * std::abs(speed) / (4.0 * own.coulomb_nm));
  found.plastic = plastic(found.ratio);
  return found;
}

}  // namespace

double JointFriction::torque(double speed, double bristle) const noexcept {
  if (!sticks()) {
    return viscous_nm_s * speed + coulomb_nm * std::tanh(speed / coulomb_speed_rad_s);
  }
  const Contact now = contact(*this, speed, bristle);
  return breakaway_nm * bristle + now.damping * speed * (1.0 - now.plastic.share) + viscous_nm_s * speed;
}

double JointFriction::bristle_rate(double speed, double bristle) const noexcept {
  return sticks() ? speed * (1.0 - contact(*this, speed, bristle).plastic.share) / presliding_rad : 0.0;
}

double JointFriction::bristle_energy(double bristle) const noexcept {
  return 0.5 * breakaway_nm * presliding_rad * bristle * bristle;
}

JointFriction::Slopes JointFriction::slopes(double speed, double bristle) const noexcept {
  Slopes found;
  if (!sticks()) {
    const double slope = 1.0 / std::cosh(std::min(std::abs(speed) / coulomb_speed_rad_s, 300.0));
    found.torque_by_speed = viscous_nm_s + coulomb_nm / coulomb_speed_rad_s * slope * slope;
    return found;
  }
  const Contact now = contact(*this, speed, bristle);
  const double slip = 1.0 - now.plastic.share;  // z0 b' / w
  const double slip_by_speed = now.plastic.slope * now.ratio * now.level_slope / now.level;
  const double slip_by_bristle = -now.plastic.slope * breakaway_nm * sign(speed) / now.level;
  const double damping_by_speed = -now.damping * now.damping * sign(speed) / (4.0 * coulomb_nm);
  found.torque_by_speed = viscous_nm_s + damping_by_speed * speed * slip + now.damping * (slip + speed * slip_by_speed);
  found.torque_by_bristle = breakaway_nm + now.damping * speed * slip_by_bristle;
  found.rate_by_speed = (slip + speed * slip_by_speed) / presliding_rad;
  found.rate_by_bristle = speed * slip_by_bristle / presliding_rad;
  return found;
}

PlantFriction::PlantFriction(std::vector<JointFriction> friction, int speed, int bristle)
    : friction_(std::move(friction)),
      speed_(speed),
      bristle_(bristle),
      sticks_(std::any_of(friction_.begin(), friction_.end(), [](const JointFriction& own) { return own.sticks(); })) {}

TreeVector PlantFriction::torque(Plant::ConstVector y) const noexcept {
  TreeVector torque(joints());
  for (int k = 0; k < joints(); ++k) {
    torque[k] = own(k).torque(y[speed_ + k], bristle_of(y, k));
  }
  return torque;
}

void PlantFriction::bristle_rates(Plant::ConstVector y, Plant::Vector rates) const noexcept {
  for (int k = 0; k < bristles(); ++k) {
    rates[k] = own(k).bristle_rate(y[speed_ + k], y[bristle_ + k]);
  }
}

void PlantFriction::add_jacobian(Plant::ConstVector y, double c_j, Eigen::Index force,
                                 Plant::Matrix jacobian) const noexcept {
  for (int k = 0; k < joints(); ++k) {
    const JointFriction::Slopes slopes = own(k).slopes(y[speed_ + k], bristle_of(y, k));
    jacobian(force + k, speed_ + k) += slopes.torque_by_speed;
    if (sticks_) {
      jacobian(force + k, bristle_ + k) += slopes.torque_by_bristle;
      jacobian(bristle_ + k, speed_ + k) -= slopes.rate_by_speed;
      jacobian(bristle_ + k, bristle_ + k) += c_j - slopes.rate_by_bristle;
    }
  }
}

double PlantFriction::energy(Plant::ConstVector y) const noexcept {
  double sum = 0.0;
  for (int k = 0; k < bristles(); ++k) {
    sum += own(k).bristle_energy(y[bristle_ + k]);
  }
  return sum;
}

void PlantFriction::loosen(Eigen::VectorXd& tolerance) const noexcept {
  constexpr double kCoarser = 1e4;
  tolerance.segment(bristle_, bristles()) *= kCoarser;
}

}  // namespace quasilpv
