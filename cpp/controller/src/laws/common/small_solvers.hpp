// Direct solvers for the n x n systems of one step, n <= 7. Eigen's own decompositions carry blocked kernels for large
// matrices: instantiating them for seven sizes and every law quadruples the time to compile this library, for the same
// arithmetic.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <utility>

namespace quasilpv {

/// Solves A x = b for a symmetric positive definite A by Cholesky factorisation A = L L' (Golub and Van Loan 2013,
/// algorithm 4.2.1); only the lower triangle of A is read. RT-SAFE (bounded, no allocation, no lock, no throw).
/// \returns x, or NaN in every entry if A is not positive definite or not finite.
template <int N>
Eigen::Matrix<double, N, 1> solve_positive_definite(Eigen::Matrix<double, N, N> A,
                                                    Eigen::Matrix<double, N, 1> b) noexcept {
  for (int j = 0; j < N; ++j) {
    for (int k = 0; k < j; ++k) {
      for (int i = j; i < N; ++i) {
        A(i, j) -= A(i, k) * A(j, k);
      }
    }
    if (!(A(j, j) > 0.0) || !std::isfinite(A(j, j))) {
      return Eigen::Matrix<double, N, 1>::Constant(std::numeric_limits<double>::quiet_NaN());
    }
    const double pivot = std::sqrt(A(j, j));
    for (int i = j; i < N; ++i) {
      A(i, j) /= pivot;
    }
  }
  for (int i = 0; i < N; ++i) {
    for (int k = 0; k < i; ++k) {
      b[i] -= A(i, k) * b[k];
    }
    b[i] /= A(i, i);
  }
  for (int i = N - 1; i >= 0; --i) {
    for (int k = i + 1; k < N; ++k) {
      b[i] -= A(k, i) * b[k];
    }
    b[i] /= A(i, i);
  }
  return b;
}

/// Solves A x = b by Gaussian elimination with partial pivoting (Golub and Van Loan 2013, algorithm 3.4.1).
/// RT-SAFE (bounded, no allocation, no lock, no throw).
/// \returns x; entries are NaN or infinite if A is singular or not finite.
template <int N>
Eigen::Matrix<double, N, 1> solve_general(Eigen::Matrix<double, N, N> A, Eigen::Matrix<double, N, 1> b) noexcept {
  for (int k = 0; k < N; ++k) {
    int largest = k;
    for (int i = k + 1; i < N; ++i) {
      if (std::abs(A(i, k)) > std::abs(A(largest, k))) {
        largest = i;
      }
    }
    for (int j = k; j < N; ++j) {
      std::swap(A(k, j), A(largest, j));
    }
    std::swap(b[k], b[largest]);
    for (int i = k + 1; i < N; ++i) {
      const double factor = A(i, k) / A(k, k);
      for (int j = k + 1; j < N; ++j) {
        A(i, j) -= factor * A(k, j);
      }
      b[i] -= factor * b[k];
    }
  }
  for (int i = N - 1; i >= 0; --i) {
    for (int j = i + 1; j < N; ++j) {
      b[i] -= A(i, j) * b[j];
    }
    b[i] /= A(i, i);
  }
  return b;
}

}  // namespace quasilpv
