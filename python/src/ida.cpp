// Tether: IDA with constraint projection for Python. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <exception>
#include <functional>
#include <ida/ida.h>
#include <optional>
#include <pybind11/stl.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include "bind.hpp"
#include "sundials/ida_session.hpp"

namespace tether::python {

namespace {

namespace tp = tether::ida_projection;

Array vector(const char* argument, const py::object& given, py::ssize_t n) {
  const auto a = numbers(argument, given);
  if (a.ndim() != 1 || a.size() != n)
    refuse(std::string(argument) + " has shape " + shape(a) + ", must be (" + std::to_string(n) +
           ",)");
  for (py::ssize_t i = 0; i < n; ++i)
    if (!std::isfinite(a.at(i)))
      refuse(std::string(argument) + "[" + std::to_string(i) + "] is not finite");
  return a;
}

/// The user's functions. What they raise is kept and raised again once IDA has returned.
class System {
 public:
  System(py::object residual, py::object jacobian, py::ssize_t n)
      : residual_(std::move(residual)), jacobian_(std::move(jacobian)), n_(n) {}

  /// Calls `function` and copies its result into `to`, which has the given shape.
  int call(const char* name, const std::function<py::object()>& function, double* to,
           std::vector<py::ssize_t> lengths) {
    try {
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
      const py::object result = function();
      const auto a = numbers(name, result);
      py::ssize_t size = 1;
      for (const py::ssize_t length : lengths) size *= length;
      const bool fits = a.size() == size && (lengths.size() < 2 || a.ndim() == 2) &&
                        (a.ndim() < 2 || (a.shape(0) == lengths[0] && a.shape(1) == lengths[1]));
      if (!fits)
        refuse(std::string(name) + " returned shape " + shape(a) + ", must be " +
               shape(Array(lengths)));
      std::copy(a.data(), a.data() + size, to);
      return 0;
    } catch (...) {
      if (!raised_) raised_ = std::current_exception();
      return -1;
    }
  }

  static int residual(sunrealtype t, N_Vector y, N_Vector yp, N_Vector r, void* self) {
    auto& system = *static_cast<System*>(self);
    return system.call("residual",
                       [&] { return system.residual_(t, system.copy(y), system.copy(yp)); },
                       N_VGetArrayPointer(r), {system.n_});
  }

  static int jacobian(sunrealtype t, sunrealtype cj, N_Vector y, N_Vector yp, N_Vector, SUNMatrix J,
                      void* self, N_Vector, N_Vector, N_Vector) {
    auto& system = *static_cast<System*>(self);
    system.rows_.resize(static_cast<std::size_t>(system.n_ * system.n_));
    const int flag = system.call(
        "jacobian", [&] { return system.jacobian_(t, system.copy(y), system.copy(yp), cj); },
        system.rows_.data(), {system.n_, system.n_});
    if (flag == 0)
      for (py::ssize_t i = 0; i < system.n_; ++i)
        for (py::ssize_t j = 0; j < system.n_; ++j)
          SM_ELEMENT_D(J, i, j) = system.rows_[static_cast<std::size_t>(i * system.n_ + j)];
    return flag;
  }

  Array copy(N_Vector v) const { return array(N_VGetArrayPointer(v), n_); }
  void rethrow() const {
    if (raised_) std::rethrow_exception(raised_);
  }

 private:
  py::object residual_, jacobian_;
  py::ssize_t n_;
  std::vector<double> rows_;
  std::exception_ptr raised_;
};

tp::Constraints constraints(System& system, const py::object& g, const py::object& C, double t,
                            const Array& y) {
  tp::Constraints set;
  const auto value = numbers("constraints", g(t, y));
  if (value.ndim() > 1) refuse("constraints returned shape " + shape(value) + ", must be a vector");
  set.count = static_cast<int>(value.size());
  if (set.count == 0) refuse("constraints returned no values");
  const py::ssize_t n = y.size();
  set.value = [&system, g, n](double at, tp::ConstVector point, tp::Vector out) {
    return system.call("constraints", [&] { return g(at, array(point.data(), n)); }, out.data(),
                       {out.size()});
  };
  if (!C.is_none())
    set.jacobian =
        tp::DenseJacobian([&system, C, n](double at, tp::ConstVector point, tp::Matrix out) {
          return system.call("constraint_jacobian", [&] { return C(at, array(point.data(), n)); },
                             out.data(), {out.rows(), out.cols()});
        });
  return set;
}

/// IDA for one system, with everything that SUNDIALS wants to be freed.
struct Ida {
  scene::QuietContext context;
  scene::OwnedVector y, yp, id, atol;
  scene::OwnedMatrix matrix;
  scene::OwnedLinearSolver solver;
  struct Memory {
    void* ida = nullptr;
    ~Memory() {
      if (ida) IDAFree(&ida);
    }
  } memory;

  scene::OwnedVector owned(const Array& values) {
    scene::OwnedVector v(N_VNew_Serial(values.size(), context));
    if (!v) throw std::bad_alloc();
    std::copy(values.data(), values.data() + values.size(), N_VGetArrayPointer(v.get()));
    return v;
  }

  void need(int flag, const char* function) const {
    if (flag >= 0) return;
    char* word = IDAGetReturnFlagName(flag);
    const std::string text = std::string(function) + ": " + word + ". " + context.message();
    std::free(word);
    throw std::runtime_error(text);
  }

  /// From y and yp on, with the tolerances and a dense solver.
  void set_up(System& system, double begin, double rtol, const py::object& tolerances,
              long max_steps, bool has_jacobian) {
    const auto n = static_cast<py::ssize_t>(N_VGetLength(y.get()));
    tp::fast_vector(y.get(), yp.get());
    memory.ida = IDACreate(context);
    void* const mem = memory.ida;
    if (!mem) throw std::bad_alloc();
    context.keep_messages_of(mem);
    need(IDAInit(mem, System::residual, begin, y.get(), yp.get()), "IDAInit");
    if (py::isinstance<py::float_>(tolerances) || py::isinstance<py::int_>(tolerances)) {
      need(IDASStolerances(mem, rtol, tolerances.cast<double>()), "tolerances");
    } else {
      atol = owned(vector("atol", tolerances, n));
      need(IDASVtolerances(mem, rtol, atol.get()), "tolerances");
    }
    need(IDASetUserData(mem, &system), "IDASetUserData");
    need(IDASetMaxNumSteps(mem, max_steps), "IDASetMaxNumSteps");
    matrix.reset(SUNDenseMatrix(n, n, context));
    if (!matrix) throw std::bad_alloc();
    solver.reset(SUNLinSol_Dense(y.get(), matrix.get(), context));
    if (!solver) throw std::bad_alloc();
    need(IDASetLinearSolver(mem, solver.get(), matrix.get()), "IDASetLinearSolver");
    if (has_jacobian) need(IDASetJacFn(mem, System::jacobian), "IDASetJacFn");
  }
};

struct Result {
  std::vector<double> t, y, yp;
  py::ssize_t unknowns = 0;
  long steps = 0, residuals = 0;
  std::string message, statistics;
  std::string status = "plain";

  Array rows(const std::vector<double>& values) const {
    return array(values, {static_cast<py::ssize_t>(t.size()), unknowns});
  }
};

void check_times(const Array& times) {
  if (times.ndim() != 1 || times.size() < 2)
    refuse("times has shape " + shape(times) + ", must be a vector of at least two");
  for (py::ssize_t i = 0; i < times.size(); ++i)
    if (!std::isfinite(times.at(i)) || (i > 0 && !(times.at(i) > times.at(i - 1))))
      refuse("times[" + std::to_string(i) + "] = " + shown(times.at(i)) +
             ", must be finite and rise");
}

void make_start_consistent(tp::Projection& projection, System& system, Ida& ida, double begin) {
  tp::Consistency how;
  how.residual = System::residual;
  how.user_data = &system;
  const tp::ConsistencyReport report =
      projection.make_consistent(begin, ida.y.get(), ida.yp.get(), how);
  system.rethrow();
  if (!report)
    throw std::runtime_error(std::string("make_consistent: ") + to_string(report.status) + ": " +
                             report.message);
}

/// Goes from time to time, as far as IDA comes.
void advance(Ida& ida, System& system, tp::Projection* projection, const Array& times,
             Result& result) {
  void* const memory = ida.memory.ida;
  const auto keep = [&](double t) {
    result.t.push_back(t);
    const double *y = N_VGetArrayPointer(ida.y.get()), *yp = N_VGetArrayPointer(ida.yp.get());
    result.y.insert(result.y.end(), y, y + result.unknowns);
    result.yp.insert(result.yp.end(), yp, yp + result.unknowns);
  };
  keep(times.at(0));
  for (py::ssize_t i = 1; i < times.size(); ++i) {
    double t = 0;
    const int flag = projection
                         ? projection->solve(times.at(i), &t, ida.y.get(), ida.yp.get(), IDA_NORMAL)
                         : IDASolve(memory, times.at(i), &t, ida.y.get(), ida.yp.get(), IDA_NORMAL);
    system.rethrow();
    if (flag < 0) {
      char* word = IDAGetReturnFlagName(flag);
      result.message = std::string(word) + ". " + ida.context.message();
      std::free(word);
      break;
    }
    keep(t);
  }
  IDAGetNumSteps(memory, &result.steps);
  IDAGetNumResEvals(memory, &result.residuals);
}

Result solve_equations(const py::object& residual, const Array& times, const py::object& y0,
                       const py::object& yp0, const py::object& g, const py::object& C,
                       const py::object& jacobian, double rtol, const py::object& atol,
                       const py::object& algebraic, long max_steps, bool make_consistent) {
  check_times(times);
  const auto begin = numbers("y0", y0);
  const py::ssize_t n = begin.size();
  if (n == 0) refuse("y0 is empty");
  if (!(rtol >= 0) || !std::isfinite(rtol)) refuse("rtol = " + shown(rtol) + ", must be >= 0");
  if (max_steps < 1) refuse("max_steps = " + std::to_string(max_steps) + ", must be at least 1");
  const Array start = vector("y0", y0, n);

  Result result;
  result.unknowns = n;
  System system(residual, jacobian, n);
  std::optional<tp::Projection> projection;  // after IDA is freed
  Ida ida;
  ida.y = ida.owned(start);
  ida.yp = ida.owned(vector("yp0", yp0, n));
  ida.set_up(system, times.at(0), rtol, atol, max_steps, !jacobian.is_none());

  tp::Options options;
  options.print = false;
  if (!algebraic.is_none()) {
    const Array marks = vector("algebraic", algebraic, n);
    Array id(n);
    for (py::ssize_t i = 0; i < n; ++i) id.mutable_at(i) = marks.at(i) != 0 ? 0.0 : 1.0;
    ida.id = ida.owned(id);
    ida.need(IDASetId(ida.memory.ida, ida.id.get()), "IDASetId");
    options.id = ida.id.get();
  }
  if (!g.is_none()) {
    projection.emplace(ida.memory.ida, constraints(system, g, C, times.at(0), start), options);
    if (make_consistent) make_start_consistent(*projection, system, ida, times.at(0));
  } else if (make_consistent) {
    refuse("make_consistent = True needs constraints");
  }
  advance(ida, system, projection ? &*projection : nullptr, times, result);
  if (projection) {
    result.status = to_string(projection->status());
    if (!projection->message().empty())
      result.message += (result.message.empty() ? "" : " ") + projection->message();
    result.statistics = projection->statistics().table();
  }
  return result;
}

}  // namespace

void bind_ida(py::module_& module) {
  using namespace py::literals;
  module.doc() = "F(t, y, y') = 0 by SUNDIALS IDA, kept on constraints g(t, y) = 0.";

  py::class_<Result>(module, "Result", "t: (T,), y and yp: (T, N), up to where IDA came.")
      .def_property_readonly(
          "t", [](const Result& r) { return array(r.t, {static_cast<py::ssize_t>(r.t.size())}); },
          "times reached, (T,)")
      .def_property_readonly(
          "y", [](const Result& r) { return r.rows(r.y); }, "unknowns, (T, N)")
      .def_property_readonly(
          "yp", [](const Result& r) { return r.rows(r.yp); }, "(T, N): y'")
      .def_readonly("steps", &Result::steps, "steps of IDA")
      .def_readonly("residuals", &Result::residuals, "evaluations of F by IDA")
      .def_readonly("status", &Result::status, "of the projection, \"plain\" without")
      .def_readonly("message", &Result::message, "what went wrong; empty when all is well")
      .def_readonly("statistics", &Result::statistics, "of the projection, as a table");

  module.def("solve", &solve_equations, "residual"_a, "times"_a, "y0"_a, "yp0"_a, py::kw_only(),
             "constraints"_a = py::none(), "constraint_jacobian"_a = py::none(),
             "jacobian"_a = py::none(), "rtol"_a = 1e-6, "atol"_a = 1e-6,
             "algebraic"_a = py::none(), "max_steps"_a = 1000000, "make_consistent"_a = false,
             R"(Integrates residual(t, y, yp) = 0 over times[0] .. times[-1]: a Result.

y0, yp0: consistent initial values (N,); make_consistent: move them there first.
constraints(t, y): m values that the solution keeps at zero; each step is moved onto them by a
shortest move before it is accepted, and so is what is returned.
constraint_jacobian(t, y): their (m, N) matrix dg/dy; without it, differences.
jacobian(t, y, yp, cj): the (N, N) matrix dF/dy + cj dF/dyp; without it, differences.
algebraic: (N,) true where y' does not enter F; found by itself where it is not given.
What a function raises is raised; where IDA gives up, `message` of the Result says why.)");
}

}  // namespace tether::python
