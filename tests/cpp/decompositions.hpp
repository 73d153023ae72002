// Decompositions of matrices for tests, compiled once: each costs the compiler seconds wherever it is written out.
#pragma once

#include <Eigen/Core>

namespace quasilpv::testing {

Eigen::MatrixXd inverse(const Eigen::MatrixXd& matrix);

/// x of A x = b, A square and regular.
Eigen::VectorXd solution(const Eigen::MatrixXd& A, const Eigen::VectorXd& b);

/// Of a symmetric matrix.
double least_eigenvalue(const Eigen::MatrixXd& symmetric);

/// The undamped modes of mass x'' + stiffness x = 0, slowest first.
struct Modes {
  Eigen::VectorXd squared_frequency;  ///< rad^2/s^2
  Eigen::MatrixXd shape;              ///< one column each
};

Modes modes_of(const Eigen::MatrixXd& stiffness, const Eigen::MatrixXd& mass);

/// The rotation that takes the direction of `from` into that of `to`, which is not the opposite one, on the short way.
Eigen::Matrix3d rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

}  // namespace quasilpv::testing
