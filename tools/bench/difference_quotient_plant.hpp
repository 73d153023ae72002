// A plant whose iteration matrix is computed as IDA does when it is given none: the competitor of analytic Jacobians.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "quasilpv/plant.hpp"

namespace quasilpv::bench {

/// The equations of another plant with a difference-quotient Jacobian. Column j of c_j dF/dy' + dF/dy is
/// (F(t, y + s e_j, y' + c_j s e_j) - F(t, y, y')) / s with s = sqrt(eps) max(|y_j|, floor): the formula of IDA's dense
/// difference quotients, with a constant floor in place of its step and error-weight terms. Torques are set on the
/// inner plant, which must outlive this one.
class DifferenceQuotientPlant final : public Plant {
 public:
  explicit DifferenceQuotientPlant(const Plant& inner) : inner_(inner) {
    for (Eigen::VectorXd* vector : {&y_, &y_dot_, &base_, &shifted_}) {
      vector->resize(inner.size());
    }
  }

  int joints() const noexcept override { return inner_.joints(); }
  int size() const noexcept override { return inner_.size(); }
  Eigen::VectorXd differential() const override { return inner_.differential(); }
  Eigen::VectorXd absolute_tolerance(double tolerance) const override { return inner_.absolute_tolerance(tolerance); }
  Eigen::VectorXd initial_state(const JointArray& angle, const JointArray& speed) const override {
    return inner_.initial_state(angle, speed);
  }
  void residual(double t, ConstVector y, ConstVector y_dot, Vector residual) const noexcept override {
    inner_.residual(t, y, y_dot, residual);
  }
  void derivative(double t, ConstVector y, Vector y_dot) const override { inner_.derivative(t, y, y_dot); }
  void make_consistent(double t, Vector y, Vector y_dot) const override { inner_.make_consistent(t, y, y_dot); }
  PlantSample sample(double t, ConstVector y) const override { return inner_.sample(t, y); }

  void jacobian(double t, double c_j, ConstVector y, ConstVector y_dot, Matrix jacobian) const noexcept override {
    constexpr double kFloor = 1e-2;
    y_ = y;
    y_dot_ = y_dot;
    inner_.residual(t, y_, y_dot_, base_);
    for (Eigen::Index j = 0; j < y_.size(); ++j) {
      const double shift = std::sqrt(std::numeric_limits<double>::epsilon()) * std::max(std::abs(y[j]), kFloor);
      y_[j] = y[j] + shift;
      y_dot_[j] = y_dot[j] + c_j * shift;
      inner_.residual(t, y_, y_dot_, shifted_);
      jacobian.col(j) = (shifted_ - base_) / shift;
      y_[j] = y[j];
      y_dot_[j] = y_dot[j];
    }
  }

 private:
  const Plant& inner_;
  mutable Eigen::VectorXd y_, y_dot_, base_, shifted_;
};

}  // namespace quasilpv::bench
