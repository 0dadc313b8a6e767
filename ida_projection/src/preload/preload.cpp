// Tether: IDA's functions with a projection, for programs that are not recompiled.
// SPDX-License-Identifier: BSD-3-Clause
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <dlfcn.h>
#include <link.h>
#include <map>
#include <memory>
#include <mutex>
#include <tether/ida_preload.h>

#include "host/owned_vector.hpp"

namespace {

using tether::ida_projection::Owned;

int complain(const char* what, const char* why) {
  std::fprintf(stderr, "libtether_preload: %s: %s\n", what, why);
  return IDA_ILL_INPUT;
}

// A host's module (as Octave's) may have loaded SUNDIALS for itself alone. IDA and the libraries
// below it become visible to all, which our own calls into SUNDIALS need.
int make_visible(dl_phdr_info* object, std::size_t, void* ida) {
  const char* slash = object->dlpi_name ? std::strrchr(object->dlpi_name, '/') : nullptr;
  const char* file = slash ? slash + 1 : object->dlpi_name;
  if (!file || std::strncmp(file, "libsundials_", 12) != 0) return 0;
  void* handle = dlopen(object->dlpi_name, RTLD_LAZY | RTLD_NOLOAD | RTLD_GLOBAL);
  if (handle && std::strncmp(file, "libsundials_ida", 15) == 0) *static_cast<void**>(ida) = handle;
  return 0;
}

/// The program's own IDA function of this name, which stands behind ours; null: it has none loaded.
template <class Function>
Function* behind(const char* name) noexcept {
  void* next = dlsym(RTLD_NEXT, name);
  if (!next) {
    void* ida = nullptr;
    dl_iterate_phdr(make_visible, &ida);
    next = ida ? dlsym(ida, name) : nullptr;
  }
  if (!next) complain(name, "no SUNDIALS is loaded");
  return reinterpret_cast<Function*>(next);
}

struct Host {
  Owned<N_Vector, N_VDestroy> start;  // IDAInit's y, until the rows are attached
  SUNNonlinearSolver nonlinear_solver = nullptr;
  bool asked = false, refused = false, project_output = false;
  Owned<tether_projection*, tether_projection_free> projection;
};

std::recursive_mutex mutex;
std::map<void*, Host>& hosts() {
  static auto* all = new std::map<void*, Host>();  // outlives every exit handler of the program
  return *all;
}

// The plugin's own calls for this IDA go straight through; a host's F may run another IDA
// meanwhile.
thread_local void* ours = nullptr;
struct Ours {
  explicit Ours(void* ida_mem) : before(ours) { ours = ida_mem; }
  ~Ours() { ours = before; }
  Ours(const Ours&) = delete;
  Ours& operator=(const Ours&) = delete;
  void* before;
};

tether_preload_fn registered = nullptr;

/// The user's function; null without TETHER_CONSTRAINTS, or where it cannot be used (said once).
tether_preload_fn constraints_of_the_user(bool& failed) {
  if (registered) return registered;
  static bool wrong = false;
  static const auto function = []() -> tether_preload_fn {
    const char* path = secure_getenv("TETHER_CONSTRAINTS");
    if (!path || !*path) {
      complain("TETHER_CONSTRAINTS", "not set, IDA runs as it is");
      return nullptr;
    }
    void* object = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    void* symbol = object ? dlsym(object, "tether_preload") : nullptr;
    if (!symbol) {
      const char* why = dlerror();
      complain(path, why ? why : "tether_preload is null");
      wrong = true;
    }
    return reinterpret_cast<tether_preload_fn>(symbol);
  }();
  failed = wrong;
  return function;
}

int attach(void* ida_mem, Host& host) {
  bool failed = false;
  const auto ask = constraints_of_the_user(failed);
  if (failed) return IDA_ILL_INPUT;
  if (!ask || !host.start) return IDA_SUCCESS;
  const Owned<tether_constraints*, tether_constraints_free> rows(tether_constraints_new());
  if (!rows) return complain("no memory", tether_last_error());
  tether_options options;
  tether_options_init(&options, sizeof options);
  options.nonlinear_solver = host.nonlinear_solver;
  const int answer = ask(ida_mem, host.start.get(), rows.get(), &options);
  if (answer < 0) return complain("tether_preload failed", tether_last_error());
  if (answer > 0 || tether_count_rows(rows.get()) == 0) return IDA_SUCCESS;
  int flag = 0;
  const auto unknowns = static_cast<long>(N_VGetLength(host.start.get()));
  host.projection.reset(tether_projection_new(ida_mem, rows.get(), &options, unknowns, &flag));
  if (!host.projection) return complain("the constraints are not attached", tether_last_error());
  return IDA_SUCCESS;
}

/// Once for each IDA object; a refusal stays one.
int prepare(void* ida_mem) noexcept {
  if (!ida_mem || ida_mem == ours) return IDA_SUCCESS;
  try {
    const std::lock_guard<std::recursive_mutex> lock(mutex);
    Host& host = hosts()[ida_mem];
    if (!host.asked) {
      host.asked = true;
      const Ours guard(ida_mem);
      host.refused = attach(ida_mem, host) != IDA_SUCCESS;
      host.start.reset();
    }
    return host.refused ? IDA_ILL_INPUT : IDA_SUCCESS;
  } catch (...) {
    return complain("the constraints are not attached", "out of memory");
  }
}

void remember_start(void* ida_mem, N_Vector yy0) noexcept {
  try {
    const std::lock_guard<std::recursive_mutex> lock(mutex);
    Host& host = hosts()[ida_mem];
    host.start.reset(N_VClone(yy0));
    if (host.start) N_VScale(1.0, yy0, host.start.get());
  } catch (...) {
    complain("IDAInit", "out of memory");
  }
}

tether_projection* projection_of_output(void* ida_mem) noexcept {
  if (ida_mem == ours) return nullptr;
  const std::lock_guard<std::recursive_mutex> lock(mutex);
  const auto host = hosts().find(ida_mem);
  return host != hosts().end() && host->second.project_output ? host->second.projection.get()
                                                              : nullptr;
}

}  // namespace

extern "C" {
#pragma GCC visibility push(default)

int tether_preload_project_output(void* ida_mem) {
  const std::lock_guard<std::recursive_mutex> lock(mutex);
  const auto host = hosts().find(ida_mem);
  if (host == hosts().end()) return TETHER_MEM_NULL;
  host->second.project_output = true;
  return 0;
}

void tether_preload_ask(tether_preload_fn ask) {
  const std::lock_guard<std::recursive_mutex> lock(mutex);
  registered = ask;
}

int IDAInit(void* ida_mem, IDAResFn res, sunrealtype t0, N_Vector yy0, N_Vector yp0) {
  const auto next = behind<decltype(IDAInit)>("IDAInit");
  if (!next) return IDA_ILL_INPUT;
  const int flag = next(ida_mem, res, t0, yy0, yp0);
  if (flag == IDA_SUCCESS) remember_start(ida_mem, yy0);
  return flag;
}

int IDASetNonlinearSolver(void* ida_mem, SUNNonlinearSolver solver) {
  const auto next = behind<decltype(IDASetNonlinearSolver)>("IDASetNonlinearSolver");
  if (!next) return IDA_ILL_INPUT;
  const int flag = next(ida_mem, solver);
  if (flag == IDA_SUCCESS && ida_mem != ours) {
    const std::lock_guard<std::recursive_mutex> lock(mutex);
    const auto host = hosts().find(ida_mem);
    if (host != hosts().end()) host->second.nonlinear_solver = solver;
  }
  return flag;
}

int IDACalcIC(void* ida_mem, int icopt, sunrealtype tout1) {
  const auto next = behind<decltype(IDACalcIC)>("IDACalcIC");
  if (!next) return IDA_ILL_INPUT;
  const int flag = prepare(ida_mem);
  return flag == IDA_SUCCESS ? next(ida_mem, icopt, tout1) : flag;
}

int IDASolve(void* ida_mem, sunrealtype tout, sunrealtype* tret, N_Vector yret, N_Vector ypret,
             int itask) {
  const auto next = behind<decltype(IDASolve)>("IDASolve");
  if (!next) return IDA_ILL_INPUT;
  const int flag = prepare(ida_mem);
  if (flag != IDA_SUCCESS) return flag;
  tether_projection* projection = projection_of_output(ida_mem);
  if (!projection) return next(ida_mem, tout, tret, yret, ypret, itask);
  const Ours guard(ida_mem);
  return tether_solve(projection, tout, tret, yret, ypret, itask);
}

int IDAGetDky(void* ida_mem, sunrealtype t, int k, N_Vector dky) {
  const auto next = behind<decltype(IDAGetDky)>("IDAGetDky");
  if (!next) return IDA_ILL_INPUT;
  const int flag = next(ida_mem, t, k, dky);
  if (flag != IDA_SUCCESS || k != 0) return flag;
  tether_projection* projection = projection_of_output(ida_mem);
  if (!projection) return flag;
  const Ours guard(ida_mem);
  if (tether_project(projection, t, dky, nullptr, nullptr) == 0) return flag;
  return complain("the output is not on the constraints", tether_last_error());
}

void IDAFree(void** ida_mem) {
  const auto next = behind<decltype(IDAFree)>("IDAFree");
  if (!next) return;
  Host host;
  if (ida_mem && *ida_mem) {
    const std::lock_guard<std::recursive_mutex> lock(mutex);
    const auto found = hosts().find(*ida_mem);
    if (found != hosts().end()) {
      host = std::move(found->second);
      hosts().erase(found);
    }
  }
  if (host.projection && std::getenv("TETHER_STATISTICS")) {
    const char* table = tether_get_statistics_table(host.projection.get());
    if (table) std::fputs(table, stderr);
  }
  next(ida_mem);
}

#pragma GCC visibility pop
}
