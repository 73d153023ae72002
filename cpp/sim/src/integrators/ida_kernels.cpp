#include "ida_kernels.hpp"

#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include <Eigen/Core>
#include <cmath>

#include "sundials_compat.hpp"

namespace quasilpv {
namespace {

using VectorView = Eigen::Map<Eigen::ArrayXd>;

double* data(N_Vector v) { return static_cast<N_VectorContent_Serial>(v->content)->data; }
sunindextype size(N_Vector v) { return static_cast<N_VectorContent_Serial>(v->content)->length; }
VectorView view(N_Vector v) { return {data(v), size(v)}; }

// Kernels of one line: the names are those of the operations in the SUNDIALS manual, z is always the result and may be
// one of the arguments.
void linear_sum(double a, N_Vector x, double b, N_Vector y, N_Vector z) { view(z) = a * view(x) + b * view(y); }
void constant(double c, N_Vector z) { view(z).setConstant(c); }
void product(N_Vector x, N_Vector y, N_Vector z) { view(z) = view(x) * view(y); }
void scale(double c, N_Vector x, N_Vector z) { view(z) = c * view(x); }
void absolute(N_Vector x, N_Vector z) { view(z) = view(x).abs(); }
void inverse(N_Vector x, N_Vector z) { view(z) = view(x).inverse(); }
void add_constant(N_Vector x, double b, N_Vector z) { view(z) = view(x) + b; }
double minimum(N_Vector x) { return view(x).minCoeff(); }

double weighted_norm(N_Vector x, N_Vector weights) {
  return std::sqrt((view(x) * view(weights)).square().sum() / static_cast<double>(size(x)));
}

double masked_weighted_norm(N_Vector x, N_Vector weights, N_Vector mask) {
  const auto counted = (view(mask) > 0.0).select(view(x) * view(weights), 0.0);
  return std::sqrt(counted.square().sum() / static_cast<double>(size(x)));
}

// z = sum of c[k] x[k]; z may be x[0].
int linear_combination(int count, double* c, N_Vector* x, N_Vector z) {
  view(z) = c[0] * view(x[0]);
  for (int k = 1; k < count; ++k) {
    view(z) += c[k] * view(x[k]);
  }
  return 0;
}

// z[k] = a[k] x + y[k].
int scale_add_multi(int count, double* a, N_Vector x, N_Vector* y, N_Vector* z) {
  for (int k = 0; k < count; ++k) {
    linear_sum(a[k], x, 1.0, y[k], z[k]);
  }
  return 0;
}

int linear_sum_array(int count, double a, N_Vector* x, double b, N_Vector* y, N_Vector* z) {
  for (int k = 0; k < count; ++k) {
    linear_sum(a, x[k], b, y[k], z[k]);
  }
  return 0;
}

int scale_array(int count, double* c, N_Vector* x, N_Vector* z) {
  for (int k = 0; k < count; ++k) {
    scale(c[k], x[k], z[k]);
  }
  return 0;
}

using MatrixView = Eigen::Map<Eigen::MatrixXd>;
MatrixView view(SUNMatrix matrix) {
  const auto* content = static_cast<SUNMatrixContent_Dense>(matrix->content);
  return {content->data, content->M, content->N};
}

int zero(SUNMatrix matrix) {
  view(matrix).setZero();
  return SUN_SUCCESS;
}

// Gaussian elimination, L (without its unit diagonal) and U in place of the matrix.
int factorise(SUNLinearSolver solver, SUNMatrix matrix) {
  auto* content = static_cast<SUNLinearSolverContent_Dense>(solver->content);
  MatrixView a = view(matrix);
  const Eigen::Index n = a.rows();
  for (Eigen::Index k = 0; k < n; ++k) {
    const Eigen::Index below = n - k - 1;
    Eigen::Index pivot = 0;
    const double largest = a.col(k).tail(below + 1).cwiseAbs().maxCoeff(&pivot);
    pivot += k;
    if (!(largest > 0.0)) {
      content->last_flag = static_cast<sunindextype>(k + 1);
      return SUNLS_LUFACT_FAIL;
    }
    content->pivots[k] = static_cast<sunindextype>(pivot);
    if (pivot != k) {
      a.row(k).swap(a.row(pivot));
    }
    a.col(k).tail(below) /= a(k, k);
    for (Eigen::Index j = k + 1; j < n; ++j) {
      if (a(k, j) != 0.0) {
        a.col(j).tail(below) -= a(k, j) * a.col(k).tail(below);
      }
    }
  }
  content->last_flag = SUN_SUCCESS;
  return SUN_SUCCESS;
}

int solve(SUNLinearSolver solver, SUNMatrix matrix, N_Vector solution, N_Vector right_side, double /*tolerance*/) {
  const auto* content = static_cast<SUNLinearSolverContent_Dense>(solver->content);
  const MatrixView lu = view(matrix);
  const Eigen::Index n = lu.rows();
  Eigen::Map<Eigen::VectorXd> x(data(solution), n);
  x = Eigen::Map<Eigen::VectorXd>(data(right_side), n);
  for (Eigen::Index k = 0; k < n; ++k) {
    std::swap(x[k], x[content->pivots[k]]);
  }
  for (Eigen::Index k = 0; k < n - 1; ++k) {
    x.tail(n - k - 1) -= x[k] * lu.col(k).tail(n - k - 1);
  }
  for (Eigen::Index k = n - 1; k >= 0; --k) {
    x[k] /= lu(k, k);
    x.head(k) -= x[k] * lu.col(k).head(k);
  }
  return SUN_SUCCESS;
}

}  // namespace

N_Vector make_small_vector(sunindextype size, SUNContext context) {
  N_Vector vector = N_VNew_Serial(size, context);
  if (vector == nullptr) {
    return nullptr;
  }
  N_Vector_Ops operations = vector->ops;
  operations->nvgetarraypointer = data;
  operations->nvgetlength = quasilpv::size;
  operations->nvlinearsum = linear_sum;
  operations->nvconst = constant;
  operations->nvprod = product;
  operations->nvscale = scale;
  operations->nvabs = absolute;
  operations->nvinv = inverse;
  operations->nvaddconst = add_constant;
  operations->nvmin = minimum;
  operations->nvwrmsnorm = weighted_norm;
  operations->nvwrmsnormmask = masked_weighted_norm;
  operations->nvlinearcombination = linear_combination;
  operations->nvscaleaddmulti = scale_add_multi;
  operations->nvlinearsumvectorarray = linear_sum_array;
  operations->nvscalevectorarray = scale_array;
  constant(0.0, vector);
  return vector;
}

SUNLinearSolver make_small_linear_solver(N_Vector vector, SUNMatrix matrix, SUNContext context) {
  SUNLinearSolver solver = SUNLinSol_Dense(vector, matrix, context);
  if (solver == nullptr) {
    return nullptr;
  }
  solver->ops->setup = factorise;
  solver->ops->solve = solve;
  matrix->ops->zero = zero;
  return solver;
}

}  // namespace quasilpv
