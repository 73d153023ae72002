// The kernels IDA runs on against those of SUNDIALS, and the linear solver against the systems it solves.
#include "ida_kernels.hpp"

#include <gtest/gtest.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "arm_fixtures.hpp"
#include "sundials_compat.hpp"

namespace quasilpv {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::Uniform;

constexpr int kSize = 7;
constexpr int kVectors = 4;

VectorXd values(N_Vector v) { return Eigen::Map<VectorXd>(N_VGetArrayPointer(v), N_VGetLength(v)); }

class IdaKernels : public ::testing::Test {
 protected:
  IdaKernels() { SUNContext_Create(SUN_COMM_NULL, &context_); }
  ~IdaKernels() override {
    for (const N_Vector v : vectors_) {
      N_VDestroy(v);
    }
    SUNContext_Free(&context_);
  }

  N_Vector keep(N_Vector v) {
    vectors_.push_back(v);
    return v;
  }

  /// Vectors with the same random numbers, those of SUNDIALS or ours and their clones.
  std::vector<N_Vector> random_vectors(bool ours) {
    Uniform uniform(3);
    const N_Vector first = keep(ours ? make_small_vector(kSize, context_) : N_VNew_Serial(kSize, context_));
    std::vector<N_Vector> all;
    for (int k = 0; k < kVectors; ++k) {
      all.push_back(k == 0 ? first : keep(N_VClone(first)));
      Eigen::Map<VectorXd>(N_VGetArrayPointer(all.back()), kSize) = uniform.vector(kSize, 2.0);
    }
    return all;
  }

  /// Applies `operation` to our vectors and to those of SUNDIALS and compares all of them afterwards.
  template <class Operation>
  void expect_same(const Operation& operation) {
    std::vector<N_Vector> ours = random_vectors(true), theirs = random_vectors(false);
    const double my_number = operation(ours), their_number = operation(theirs);
    EXPECT_NEAR(my_number, their_number, 1e-15);
    for (int k = 0; k < kVectors; ++k) {
      EXPECT_LT((values(ours[k]) - values(theirs[k])).cwiseAbs().maxCoeff(), 1e-15) << "vector " << k;
    }
  }

  SUNContext context_ = nullptr;
  std::vector<N_Vector> vectors_;
};

TEST_F(IdaKernels, every_operation_does_what_that_of_sundials_does) {
  using Vectors = std::vector<N_Vector>;
  double factors[] = {0.5, -1.5, 2.5};
  expect_same([](Vectors& v) { return N_VLinearSum(2.0, v[0], -3.0, v[1], v[2]), 0.0; });
  expect_same([](Vectors& v) { return N_VLinearSum(1.0, v[0], 1.0, v[1], v[1]), 0.0; });
  expect_same([](Vectors& v) { return N_VConst(0.3, v[0]), 0.0; });
  expect_same([](Vectors& v) { return N_VProd(v[0], v[1], v[0]), 0.0; });
  expect_same([](Vectors& v) { return N_VScale(-0.7, v[0], v[3]), 0.0; });
  expect_same([](Vectors& v) { return N_VAbs(v[0], v[0]), 0.0; });
  expect_same([](Vectors& v) { return N_VAbs(v[0], v[0]), N_VAddConst(v[0], 0.5, v[0]), N_VInv(v[0], v[1]), 0.0; });
  expect_same([](Vectors& v) { return N_VAddConst(v[2], 0.1, v[0]), 0.0; });
  expect_same([](Vectors& v) { return N_VMin(v[0]); });
  expect_same([](Vectors& v) { return N_VWrmsNorm(v[0], v[1]); });
  expect_same([](Vectors& v) { return N_VWrmsNormMask(v[0], v[1], v[2]); });
  expect_same([&](Vectors& v) { return static_cast<double>(N_VLinearCombination(3, factors, v.data(), v[0])); });
  expect_same([&](Vectors& v) { return static_cast<double>(N_VLinearCombination(3, factors, v.data(), v[3])); });
  expect_same(
      [&](Vectors& v) { return static_cast<double>(N_VScaleAddMulti(3, factors, v[0], v.data() + 1, v.data() + 1)); });
  expect_same([](Vectors& v) {
    return static_cast<double>(N_VLinearSumVectorArray(2, 2.0, v.data(), -1.0, v.data() + 2, v.data()));
  });
  expect_same([&](Vectors& v) { return static_cast<double>(N_VScaleVectorArray(3, factors, v.data(), v.data())); });
}

class SmallLinearSolver : public IdaKernels {
 protected:
  SmallLinearSolver()
      : right_(make_small_vector(kSize, context_)),
        solution_(make_small_vector(kSize, context_)),
        matrix_(SUNDenseMatrix(kSize, kSize, context_)),
        solver_(make_small_linear_solver(right_, matrix_, context_)) {}
  ~SmallLinearSolver() override {
    SUNLinSolFree(solver_);
    SUNMatDestroy(matrix_);
    N_VDestroy(right_);
    N_VDestroy(solution_);
  }

  Eigen::Map<MatrixXd> matrix() { return {SUNDenseMatrix_Data(matrix_), kSize, kSize}; }

  N_Vector right_, solution_;
  SUNMatrix matrix_;
  SUNLinearSolver solver_;
};

TEST_F(SmallLinearSolver, solves_random_systems_and_those_that_need_row_exchanges) {
  Uniform uniform(4);
  for (int i = 0; i < 100; ++i) {
    MatrixXd a = MatrixXd::NullaryExpr(kSize, kSize, [&] { return uniform(-1.0, 1.0); });
    if (i % 2 == 1) {  // a saddle point, like equations of motion with multipliers
      a.bottomRightCorner(3, 3).setZero();
      a(0, 0) = 0.0;
    }
    const VectorXd expected = uniform.vector(kSize, 1.0);
    matrix() = a;
    Eigen::Map<VectorXd>(N_VGetArrayPointer(right_), kSize) = a * expected;
    ASSERT_EQ(SUNLinSolSetup(solver_, matrix_), SUN_SUCCESS);
    ASSERT_EQ(SUNLinSolSolve(solver_, matrix_, solution_, right_, 0.0), SUN_SUCCESS);
    EXPECT_LT((a * values(solution_) - a * expected).cwiseAbs().maxCoeff(), 1e-14);
    EXPECT_LT((values(solution_) - expected).cwiseAbs().maxCoeff(), 1e-9);
  }
}

TEST_F(SmallLinearSolver, when_the_matrix_is_singular_or_not_a_number_expect_a_recoverable_failure) {
  matrix().setOnes();
  EXPECT_EQ(SUNLinSolSetup(solver_, matrix_), SUNLS_LUFACT_FAIL);
  EXPECT_EQ(SUNLinSolLastFlag(solver_), 2);  // the second pivot
  matrix().setConstant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(SUNLinSolSetup(solver_, matrix_), SUNLS_LUFACT_FAIL);
  EXPECT_GT(SUNLS_LUFACT_FAIL, 0);  // what SUNDIALS takes for recoverable
}

TEST_F(SmallLinearSolver, the_matrix_is_cleared_for_ida) {
  matrix().setOnes();
  EXPECT_EQ(SUNMatZero(matrix_), SUN_SUCCESS);
  EXPECT_EQ(matrix().cwiseAbs().maxCoeff(), 0.0);
}

}  // namespace
}  // namespace quasilpv
