// Tether: what the bindings of contact problems share. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <tether/contact.hpp>

#include "bind.hpp"

namespace tether::python {

namespace tc = tether::contact;

using View = Eigen::Map<const Eigen::VectorXd>;

inline View vector(const char* argument, const Array& a) {
  if (a.ndim() != 1)
    refuse(std::string(argument) + " has shape " + shape(a) + ", must be a vector");
  return {a.data(), a.size()};
}

/// A number for each row of the problem.
template <class Problem>
View by_row(const char* argument, const Array& given, const Problem& problem) {
  const View x = vector(argument, given);
  if (x.size() != problem.b().size())
    refuse(std::string(argument) + " has " + std::to_string(x.size()) + " entries, must have " +
           std::to_string(problem.b().size()));
  return x;
}

inline tc::Law law_of(const std::string& word) { return named<tc::Law>("law", word, tc::laws()); }

inline std::vector<std::string> words_of(const std::vector<tc::Regime>& regimes) {
  std::vector<std::string> words;
  words.reserve(regimes.size());
  for (const tc::Regime regime : regimes) words.emplace_back(name(regime));
  return words;
}

/// Getters of members: the name of an enumerator, a copy of a vector.
template <class T, class E>
auto word(E T::*member) {
  return [member](const T& of) { return std::string(name(of.*member)); };
}
template <class T, class Numbers>
auto copied(Numbers T::*member) {
  return [member](const T& of) {
    return array((of.*member).data(), static_cast<py::ssize_t>((of.*member).size()));
  };
}

/// An argument that may be None: no change.
inline Eigen::VectorXd entries(const char* argument, const py::object& value) {
  if (value.is_none()) return {};
  return vector(argument, value.cast<Array>());
}

using Entries = std::vector<tc::MatrixEntry>;

/// Entries of an array or a scipy.sparse matrix with `rows` rows and `columns` columns.
Entries matrix_entries(const char* argument, const py::object& whole, py::ssize_t rows,
                       py::ssize_t columns);

/// By Solver or ConeSolver, without Python's lock.
template <class Solver, class Problem>
auto solve(const Problem& problem, const std::string& law, double tolerance,
           const py::object& start, double max_work, bool strict) {
  tc::Options options;
  options.law = law_of(law);
  options.tolerance = tolerance;
  options.max_work = max_work;
  options.strict = strict;
  Solver solver(options);
  const Array given = start.is_none() ? Array(0) : start.cast<Array>();
  const View x = start.is_none() ? View(nullptr, 0) : by_row("start", given, problem);
  const py::gil_scoped_release others_run;
  return start.is_none() ? solver.solve(problem) : solver.solve(problem, x);
}

/// tc::derivative of these arguments, without Python's lock.
template <class... Of>
tc::Derivative derivative_of(double tolerance, double kink, const Of&... of) {
  tc::DerivativeOptions options;
  options.tolerance = tolerance;
  options.kink = kink;
  const py::gil_scoped_release others_run;
  return tc::derivative(of..., options);
}

/// Solution or ConeSolution, with the members that both have.
template <class S>
py::class_<S> bind_solution(py::module_& module, const char* title, const char* compared) {
  py::class_<S> made(module, title, "An answer and how good it is.");
  made.def_property_readonly(
      "solved", [](const S& s) { return s.status == tc::Status::solved; },
      "whether the error is within the tolerance");
  made.def_property_readonly(
      "status", word(&S::status),
      "solved, unsolved, stalled, cycling, work_limit, round_off or infeasible");
  made.def_property_readonly("impulses", copied(&S::impulses),
                             "x by row, (n,), N s: of a contact normal, then tangents");
  made.def_property_readonly("velocities", copied(&S::velocities), "w = A x - b by row, (n,), m/s");
  made.def_property_readonly("infeasible_direction", copied(&S::infeasible_direction),
                             "(n,) d that proves infeasibility: A d = 0 and b.d > 0; else empty");
  made.def_readonly("error", &S::error, compared);
  made.def_readonly("advice", &S::advice, "what to try when it is not solved");
  made.def_property_readonly(
      "work", [](const S& s) { return s.counts.work; },
      "estimated nanoseconds, counted from operations");
  const std::string shown_as = "<" + std::string(title) + ": ";
  made.def("__repr__", [shown_as](const S& s) {
    return shown_as + name(s.status) + ", error " + shown(s.error) + ">";
  });
  return made;
}

void bind_cones(py::module_& module);
void bind_derivative(py::module_& module);

}  // namespace tether::python
