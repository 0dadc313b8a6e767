// Tether: constraints of Octave's ode15i and ode15s. SPDX-License-Identifier: BSD-3-Clause
//
// Octave loads SUNDIALS with its own __ode15__. libtether_preload is loaded before it, so that
// IDA's functions are found there, and asks this module for the rows.
#include <dlfcn.h>
#include <memory>
#include <octave/interpreter.h>
#include <octave/oct.h>
#include <octave/parse.h>
#include <stdexcept>
#include <string>
#include <tether/ida_preload.h>
#include <vector>

#include "preload_path.h"  // TETHER_PRELOAD

namespace {

// A run of a solver; within its functions another may be started.
struct Run {
  octave_value g, C;
  octave_idx_type count = 0, unknowns = 0;
  bool attached = false;
  std::string error;
};
std::vector<std::unique_ptr<Run>> runs;

struct Library {
  decltype(&tether_preload_ask) ask = nullptr;
  decltype(&tether_preload_project_output) project_output = nullptr;
  decltype(&tether_add_rows) add_rows = nullptr;
} library;

template <class Function>
void find(void* object, const char* name, Function& function) {
  function = reinterpret_cast<Function>(dlsym(object, name));
  if (!function) error("tether: %s has no %s", TETHER_PRELOAD, name);
}

/// f(t, y) as rows x columns; what Octave throws stays here and becomes the error of the run.
int call(Run& run, const octave_value& f, double t, const double* y, octave_idx_type rows,
         octave_idx_type columns, NDArray& result) {
  try {
    ColumnVector point(run.unknowns);
    std::copy(y, y + run.unknowns, point.fortran_vec());
    octave_value_list arguments;
    arguments(0) = t;
    arguments(1) = point;
    const octave_value_list values = octave::feval(f, arguments, 1);
    if (values.empty() || !values(0).isnumeric() || values(0).iscomplex())
      throw std::runtime_error("a function of the constraints did not return real numbers");
    result = values(0).full_value().array_value();
    if (result.numel() != rows * columns || (columns > 1 && result.rows() != rows))
      throw std::runtime_error("a function of the constraints returned another size than at first");
    return 0;
  } catch (const octave::execution_exception& exception) {
    run.error = exception.message();
    octave::interpreter::the_interpreter()->recover_from_exception();
  } catch (const octave::interrupt_exception&) {
    run.error = "interrupted";
  } catch (const std::exception& exception) {
    run.error = exception.what();
  }
  return -1;
}

int value(sunrealtype t, const sunrealtype* y, sunrealtype* g, void* data) {
  auto& run = *static_cast<Run*>(data);
  NDArray result;
  if (call(run, run.g, t, y, run.count, 1, result) != 0) return -1;
  std::copy_n(result.data(), run.count, g);
  return 0;
}

int jacobian(sunrealtype t, const sunrealtype* y, sunrealtype* C, void* data) {
  auto& run = *static_cast<Run*>(data);
  NDArray result;
  if (call(run, run.C, t, y, run.count, run.unknowns, result) != 0) return -1;
  for (octave_idx_type i = 0; i < run.count; ++i)
    for (octave_idx_type j = 0; j < run.unknowns; ++j)
      C[i * run.unknowns + j] = result.xelem(i + run.count * j);
  return 0;
}

int add_constraints(void* ida, N_Vector y, tether_constraints* constraints, tether_options*) {
  if (runs.empty() || runs.back()->attached) return 1;  // another integration, of a function's own
  Run& run = *runs.back();
  run.attached = true;
  run.unknowns = y->ops->nvgetlength(y);
  library.project_output(ida);
  return library.add_rows(constraints, static_cast<int>(run.count), value,
                          run.C.isempty() ? nullptr : jacobian, &run);
}

void load() {
  void* object = dlopen(TETHER_PRELOAD, RTLD_LAZY | RTLD_GLOBAL);
  if (!object) error("tether: %s", dlerror());
  find(object, "tether_preload_ask", library.ask);
  find(object, "tether_preload_project_output", library.project_output);
  find(object, "tether_add_rows", library.add_rows);
  library.ask(add_constraints);  // in sessions without constraints, too: nothing else is asked then
}

Run& current() {
  if (runs.empty()) error("__tether__: no run has begun");
  return *runs.back();
}

}  // namespace

DEFUN_DLD(__tether__, args, ,
          "Undocumented internal function: __tether__ (\"load\"), (\"begin\", g, C, count), "
          "(\"end\"), (\"error\"), (\"attached\").") {
  const std::string command = args.empty() ? "" : args(0).xstring_value("__tether__: a command");
  if (command == "load") {
    load();
  } else if (command == "begin" && args.length() == 4) {
    if (!library.ask) load();
    auto run = std::make_unique<Run>();
    run->g = args(1);
    run->C = args(2);
    run->count = args(3).idx_type_value();
    runs.push_back(std::move(run));
  } else if (command == "end") {
    if (!runs.empty()) runs.pop_back();
  } else if (command == "error") {
    return octave_value(current().error);
  } else if (command == "attached") {
    return octave_value(current().attached);
  } else {
    error("__tether__: no command \"%s\"", command.c_str());
  }
  return octave_value_list();
}
