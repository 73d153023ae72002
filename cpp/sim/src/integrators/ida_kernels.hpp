// Vector kernels and a dense solver for SUNDIALS, made for systems of a dozen unknowns.
#pragma once

#include <sundials/sundials_linearsolver.h>
#include <sundials/sundials_matrix.h>
#include <sundials/sundials_nvector.h>

namespace quasilpv {

/// A serial N_Vector of `size` zeros with kernels of our own, which its clones inherit: distributions ship SUNDIALS
/// without optimisation, and most of an integration of a small system is spent in its loops over vectors. Null when out
/// of memory. INIT-ONLY.
N_Vector make_small_vector(sunindextype size, SUNContext context);

/// LU factorisation with partial pivoting of the dense matrix that IDA was given, in place of that of SUNDIALS and for
/// the same reason. `vector` tells the size; null when out of memory. INIT-ONLY.
SUNLinearSolver make_small_linear_solver(N_Vector vector, SUNMatrix matrix, SUNContext context);

}  // namespace quasilpv
