// IDAInit, then a projection without constraints. At exit the number of calls of each decorated
// solver goes to the file that TETHER_CALLS_FILE names, a line for each integrator.
// SPDX-License-Identifier: BSD-3-Clause
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <tether/ida_projection.hpp>
#include <utility>
#include <vector>

namespace {

namespace tp = tether::ida_projection;

/// Keeps every projection until the program ends, after its IDAFree and SUNContext_Free.
class Registry {
 public:
  /// A solver that is handed over replaces the one that was attached at IDAInit.
  int attach(void* ida_mem, SUNNonlinearSolver solver) {
    try {
      tp::Options options;
      options.nonlinear_solver = solver;
      auto projection = std::make_unique<tp::Projection>(ida_mem, tp::Constraints{}, options);
      if (solver) projections_.pop_back();
      projections_.push_back(std::move(projection));
      return IDA_SUCCESS;
    } catch (const std::exception& e) {
      std::fprintf(stderr, "attach: %s\n", e.what());
      std::_Exit(70);
    }
  }

  ~Registry() {
    const char* name = std::getenv("TETHER_CALLS_FILE");
    std::FILE* file = name ? std::fopen(name, "w") : nullptr;
    if (!file) return;
    for (const auto& projection : projections_)
      std::fprintf(file, "%ld\n", projection->statistics().solver_calls);
    std::fclose(file);
  }

 private:
  std::vector<std::unique_ptr<tp::Projection>> projections_;
};

Registry registry;

}  // namespace

extern "C" int tether_init_and_attach(void* ida_mem, IDAResFn res, sunrealtype t0, N_Vector yy0,
                                      N_Vector yp0) {
  const int flag = IDAInit(ida_mem, res, t0, yy0, yp0);
  return flag == IDA_SUCCESS ? registry.attach(ida_mem, nullptr) : flag;
}

extern "C" int tether_attach_with_solver(void* ida_mem, SUNNonlinearSolver solver) {
  return registry.attach(ida_mem, solver);
}
