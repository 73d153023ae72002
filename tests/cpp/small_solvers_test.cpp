// The small direct solvers against Eigen's decompositions, and on matrices they must refuse.
#include "laws/common/small_solvers.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <limits>

namespace quasilpv {
namespace {

template <int N>
void expect_the_solution_of_eigen() {
  for (int sample = 0; sample < 200; ++sample) {
    const Eigen::Matrix<double, N, N> general = Eigen::Matrix<double, N, N>::Random();
    const Eigen::Matrix<double, N, 1> b = Eigen::Matrix<double, N, 1>::Random();
    const Eigen::Matrix<double, N, N> definite =
        general * general.transpose() + 0.1 * Eigen::Matrix<double, N, N>::Identity();
    const Eigen::Matrix<double, N, 1> by_cholesky = definite.ldlt().solve(b);
    const double size = by_cholesky.cwiseAbs().maxCoeff();
    EXPECT_LT((solve_positive_definite<N>(definite, b) - by_cholesky).cwiseAbs().maxCoeff(), 1e-11 * size);
    const Eigen::Matrix<double, N, 1> x = solve_general<N>(general, b);
    EXPECT_LT((general * x - b).cwiseAbs().maxCoeff(), 1e-12 * (1.0 + x.cwiseAbs().maxCoeff()));
  }
}

TEST(SmallSolvers, when_matrices_are_regular_expect_the_solution_of_eigen) {
  expect_the_solution_of_eigen<1>();
  expect_the_solution_of_eigen<2>();
  expect_the_solution_of_eigen<3>();
  expect_the_solution_of_eigen<7>();
}

TEST(SmallSolvers, when_a_leading_entry_is_zero_expect_pivoting) {
  Eigen::Matrix2d A;
  A << 0.0, 2.0, 4.0, 0.0;
  const Eigen::Vector2d x = solve_general<2>(A, Eigen::Vector2d(2.0, 8.0));
  EXPECT_EQ(x[0], 2.0);
  EXPECT_EQ(x[1], 1.0);
}

TEST(SmallSolvers, when_the_matrix_is_not_positive_definite_expect_nan) {
  Eigen::Matrix2d indefinite;
  indefinite << 1.0, 2.0, 2.0, 1.0;
  EXPECT_TRUE(solve_positive_definite<2>(indefinite, Eigen::Vector2d(1.0, 1.0)).array().isNaN().all());
  const Eigen::Matrix2d broken = Eigen::Matrix2d::Constant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_TRUE(solve_positive_definite<2>(broken, Eigen::Vector2d(1.0, 1.0)).array().isNaN().all());
  const Eigen::Matrix2d infinite = std::numeric_limits<double>::infinity() * Eigen::Matrix2d::Identity();
  EXPECT_TRUE(solve_positive_definite<2>(infinite, Eigen::Vector2d(1.0, 1.0)).array().isNaN().all());
}

TEST(SmallSolvers, when_the_matrix_is_singular_expect_a_result_that_is_not_finite) {
  EXPECT_FALSE(solve_general<2>(Eigen::Matrix2d::Ones(), Eigen::Vector2d(1.0, 2.0)).allFinite());
}

}  // namespace
}  // namespace quasilpv
