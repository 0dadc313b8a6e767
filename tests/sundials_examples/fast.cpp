// SUNDIALS' examples with fast vectors and dense factors, without any projection. At exit the
// number of integrators with fast vectors and that of fast solvers go to the file that
// TETHER_CALLS_FILE names. SPDX-License-Identifier: BSD-3-Clause
#include TETHER_HOST_HEADER
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <tether/ida_projection/fast.hpp>

namespace {

namespace tp = tether::ida_projection;

struct Counts {
  int integrators = 0, solvers = 0;
  ~Counts() {
    const char* name = std::getenv("TETHER_CALLS_FILE");
    std::FILE* file = name ? std::fopen(name, "w") : nullptr;
    if (!file) return;
    std::fprintf(file, "%d\n%d\n", integrators, solvers);
    std::fclose(file);
  }
} counts;

template <class Call>
auto guarded(Call call) {
  try {
    return call();
  } catch (const std::exception& e) {
    std::fprintf(stderr, "fast: %s\n", e.what());
    std::_Exit(70);
  }
}

void make_fast(N_Vector y, N_Vector yp) {
  guarded([&] { tp::fast_vector(y, yp); });
  ++counts.integrators;
}

}  // namespace

extern "C" int tether_init_fast(void* ida_mem, IDAResFn res, sunrealtype t0, N_Vector yy0,
                                N_Vector yp0) {
  make_fast(yy0, yp0);
  return IDAInit(ida_mem, res, t0, yy0, yp0);
}

#ifdef IDA_STAGGERED
extern "C" int tether_init_fast_backwards(void* ida_mem, int which, IDAResFnB res, sunrealtype t0,
                                          N_Vector yy0, N_Vector yp0) {
  make_fast(yy0, yp0);
  return IDAInitB(ida_mem, which, res, t0, yy0, yp0);
}
#endif

extern "C" SUNLinearSolver tether_fast_dense(N_Vector y, SUNMatrix A, SUNContext context) {
  if (SUNDenseMatrix_Rows(A) > tp::kLargestFastDense) return SUNLinSol_Dense(y, A, context);
  ++counts.solvers;
  return guarded([&] { return tp::fast_dense_solver(y, A); });
}
