// Linear equations whose size is known at load only.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <utility>

namespace quasilpv {

/// Solves A x = b by Gaussian elimination with partial pivoting (Golub and Van Loan 2013, algorithm 3.4.1).
/// RT-SAFE (bounded, no allocation, no lock, no throw).
/// \param A, b are overwritten. \param[out] x entries are NaN or infinite if A is singular or not finite.
inline void eliminate(Eigen::Ref<Eigen::MatrixXd> A, Eigen::Ref<Eigen::VectorXd> b,
                      Eigen::Ref<Eigen::VectorXd> x) noexcept {
  const Eigen::Index size = b.size();
  for (Eigen::Index k = 0; k < size; ++k) {
    Eigen::Index largest = k;
    for (Eigen::Index i = k + 1; i < size; ++i) {
      if (std::abs(A(i, k)) > std::abs(A(largest, k))) {
        largest = i;
      }
    }
    for (Eigen::Index j = k; j < size; ++j) {
      std::swap(A(k, j), A(largest, j));
    }
    std::swap(b[k], b[largest]);
    for (Eigen::Index i = k + 1; i < size; ++i) {
      const double factor = A(i, k) / A(k, k);
      for (Eigen::Index j = k + 1; j < size; ++j) {
        A(i, j) -= factor * A(k, j);
      }
      b[i] -= factor * b[k];
    }
  }
  for (Eigen::Index i = size - 1; i >= 0; --i) {
    x[i] = b[i];
    for (Eigen::Index j = i + 1; j < size; ++j) {
      x[i] -= A(i, j) * x[j];
    }
    x[i] /= A(i, i);
  }
}

}  // namespace quasilpv
