#include "quasilpv/ida_integrator.hpp"

#include <ida/ida.h>
#include <sunmatrix/sunmatrix_dense.h>

#include <algorithm>
#include <cstdlib>
#include <sstream>
#include <string>
#include <type_traits>

#include "ida_kernels.hpp"
#include "quasilpv/errors.hpp"
#include "sundials_compat.hpp"

namespace quasilpv {
namespace {

// First step after a restart, s: the order starts at 1, so the first steps must be short (IDA's own guess is longer and
// is then rejected).
constexpr double kInitialStep = 1e-6;
// A step that must become shorter than this, s, has met a point where the plant is not defined.
constexpr double kShortestStep = 1e-12;
// Relative change of the leading coefficient c_j from which on the iteration matrix is computed anew. The steps double
// after a restart, c_j falls to a half each time: from 1/3 on one matrix serves two step lengths.
constexpr double kStaleMatrix = 0.4;
// Per interval. A 1 ms sample of a three-link arm takes about 16.
constexpr long kMaxSteps = 100000;

using VectorView = Eigen::Map<Eigen::VectorXd>;
using MatrixView = Eigen::Map<Eigen::MatrixXd>;

VectorView view(N_Vector v) { return {N_VGetArrayPointer(v), N_VGetLength(v)}; }

std::string flag_name(int flag) {
  char* name = IDAGetReturnFlagName(flag);  // malloc'ed by SUNDIALS
  std::string copy = name;
  std::free(name);
  return copy;
}

void check(int flag, const char* call) {
  if (flag < 0) {
    throw PlantError(std::string(call) + " failed: " + flag_name(flag));
  }
}

template <class Object>
Object require(Object object, const char* call) {
  if (object == nullptr) {
    throw PlantError(std::string(call) + " failed: out of memory");
  }
  return object;
}

// SUNDIALS has C destructors of three shapes; each owner below knows one.
struct FreeContext {
  void operator()(SUNContext context) const { SUNContext_Free(&context); }
};
struct FreeVector {
  void operator()(N_Vector vector) const { N_VDestroy(vector); }
};
struct FreeMatrix {
  void operator()(SUNMatrix matrix) const { SUNMatDestroy(matrix); }
};
struct FreeLinearSolver {
  void operator()(SUNLinearSolver solver) const { SUNLinSolFree(solver); }
};
struct FreeIda {
  void operator()(void* ida) const { IDAFree(&ida); }
};
template <class Handle, class Free>
using Owner = std::unique_ptr<std::remove_pointer_t<Handle>, Free>;

int residual(sunrealtype t, N_Vector y, N_Vector y_dot, N_Vector result, void* system) {
  VectorView value = view(result);
  static_cast<const ImplicitSystem*>(system)->residual(t, view(y), view(y_dot), value);
  return value.allFinite() ? 0 : 1;  // 1: IDA tries a shorter step first
}

int jacobian(sunrealtype t, sunrealtype c_j, N_Vector y, N_Vector y_dot, N_Vector /*residual*/, SUNMatrix result,
             void* system, N_Vector /*scratch*/, N_Vector /*scratch*/, N_Vector /*scratch*/) {
  MatrixView value(SUNDenseMatrix_Data(result), SUNDenseMatrix_Rows(result), SUNDenseMatrix_Columns(result));
  static_cast<const ImplicitSystem*>(system)->jacobian(t, c_j, view(y), view(y_dot), value);
  return value.allFinite() ? 0 : 1;
}

SUNContext make_context() {
  SUNContext context = nullptr;
  if (SUNContext_Create(SUN_COMM_NULL, &context) != 0) {
    throw PlantError("SUNContext_Create failed");
  }
  return context;
}

}  // namespace

// Members are destroyed in reverse order: the context after all that was created in it, as SUNDIALS demands.
struct IdaIntegrator::Solver {
  Solver(const ImplicitSystem& the_system, const IdaOptions& options);

  const ImplicitSystem& system;
  std::string message;  // IDA's own words about its last failure
  Owner<SUNContext, FreeContext> context;
  Owner<N_Vector, FreeVector> y, y_dot;
  Owner<SUNMatrix, FreeMatrix> matrix;
  Owner<SUNLinearSolver, FreeLinearSolver> linear_solver;
  std::unique_ptr<void, FreeIda> ida;
  IdaStatistics statistics;

  [[noreturn]] void fail(int flag, double from_s, double reached_s, double to_s) const;
  void count();
};

IdaIntegrator::Solver::Solver(const ImplicitSystem& the_system, const IdaOptions& options) : system(the_system) {
  const int n = system.size();
  context.reset(make_context());
  y.reset(require(make_small_vector(n, context.get()), "N_VNew_Serial"));
  y_dot.reset(require(make_small_vector(n, context.get()), "N_VNew_Serial"));
  const Owner<N_Vector, FreeVector> scratch(require(make_small_vector(n, context.get()), "N_VNew_Serial"));
  matrix.reset(require(SUNDenseMatrix(n, n, context.get()), "SUNDenseMatrix"));
  linear_solver.reset(require(make_small_linear_solver(y.get(), matrix.get(), context.get()), "SUNLinSol_Dense"));
  ida.reset(require(IDACreate(context.get()), "IDACreate"));

  check(keep_messages(context.get(), ida.get(), message), "keep_messages");
  check(IDAInit(ida.get(), residual, 0.0, y.get(), y_dot.get()), "IDAInit");
  // IDA hands the pointer back as it got it; the callbacks restore the const.
  check(IDASetUserData(ida.get(), const_cast<ImplicitSystem*>(&system)), "IDASetUserData");
  view(scratch.get()) = system.absolute_tolerance(options.absolute_tolerance);
  check(IDASVtolerances(ida.get(), options.relative_tolerance, scratch.get()), "IDASVtolerances");
  view(scratch.get()) = system.differential();
  check(IDASetId(ida.get(), scratch.get()), "IDASetId");
  check(IDASetSuppressAlg(ida.get(), SUNTRUE), "IDASetSuppressAlg");
  check(IDASetLinearSolver(ida.get(), linear_solver.get(), matrix.get()), "IDASetLinearSolver");
  check(IDASetJacFn(ida.get(), jacobian), "IDASetJacFn");
  check(IDASetDeltaCjLSetup(ida.get(), kStaleMatrix), "IDASetDeltaCjLSetup");
  check(IDASetMinStep(ida.get(), kShortestStep), "IDASetMinStep");
  check(IDASetMaxNumSteps(ida.get(), kMaxSteps), "IDASetMaxNumSteps");
}

void IdaIntegrator::Solver::fail(int flag, double from_s, double reached_s, double to_s) const {
  std::ostringstream out;
  out.precision(9);
  out << "IDA stopped with " << flag_name(flag) << " at t = " << reached_s << " s (interval " << from_s << " to "
      << to_s << " s): " << message;
  std::string line = out.str();
  std::replace(line.begin(), line.end(), '\n', ' ');
  throw PlantError(line);
}

// IDA counts from its last restart.
void IdaIntegrator::Solver::count() {
  long steps = 0;
  long residuals = 0;
  long setups = 0;
  long error_test_failures = 0;
  int last_order = 0;
  int next_order = 0;
  double first_step = 0.0;
  double last_step = 0.0;
  double next_step = 0.0;
  double t = 0.0;
  long jacobians = 0;
  long convergence_failures = 0;
  check(IDAGetIntegratorStats(ida.get(), &steps, &residuals, &setups, &error_test_failures, &last_order, &next_order,
                              &first_step, &last_step, &next_step, &t),
        "IDAGetIntegratorStats");
  check(IDAGetNumJacEvals(ida.get(), &jacobians), "IDAGetNumJacEvals");
  check(IDAGetNumNonlinSolvConvFails(ida.get(), &convergence_failures), "IDAGetNumNonlinSolvConvFails");
  statistics.steps += steps;
  statistics.residuals += residuals;
  statistics.jacobians += jacobians;
  statistics.error_test_failures += error_test_failures;
  statistics.convergence_failures += convergence_failures;
}

IdaIntegrator::IdaIntegrator(const ImplicitSystem& system, const IdaOptions& options)
    : solver_(std::make_unique<Solver>(system, options)) {}

IdaIntegrator::~IdaIntegrator() = default;

void IdaIntegrator::advance(double from_s, double to_s, Eigen::VectorXd& y) {
  Solver& solver = *solver_;
  VectorView state = view(solver.y.get());
  VectorView slope = view(solver.y_dot.get());
  state = y;
  solver.system.make_consistent(from_s, state, slope);
  solver.message.clear();
  check(IDAReInit(solver.ida.get(), from_s, solver.y.get(), solver.y_dot.get()), "IDAReInit");
  check(IDASetInitStep(solver.ida.get(), kInitialStep), "IDASetInitStep");
  check(IDASetStopTime(solver.ida.get(), to_s), "IDASetStopTime");
  double reached_s = from_s;
  const int flag = IDASolve(solver.ida.get(), to_s, &reached_s, solver.y.get(), solver.y_dot.get(), IDA_NORMAL);
  if (flag < 0) {
    solver.fail(flag, from_s, reached_s, to_s);
  }
  solver.count();
  y = state;
}

const IdaStatistics& IdaIntegrator::statistics() const noexcept { return solver_->statistics; }

}  // namespace quasilpv
