// Tether: contact problems for Python. SPDX-License-Identifier: BSD-3-Clause
#include <map>
#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <tether/contact.hpp>
#include <tether/contact/files.hpp>

#include "contact_parts.hpp"

namespace tether::python {

namespace {

int dimension(const Array& b, const Array& mu) {
  for (const int d : {2, 3})
    if (mu.size() > 0 && b.size() == d * mu.size()) return d;
  refuse("b has " + std::to_string(b.size()) + " entries and mu " + std::to_string(mu.size()) +
         ": must be two (plane) or three (space) for each contact");
}

using Columns = py::array_t<double, py::array::f_style | py::array::forcecast>;

/// The entries of a scipy.sparse matrix, in 2 x 2 or 3 x 3 blocks.
tc::Problem sparse(const py::object& A, const Array& b, const Array& mu) {
  const int d = dimension(b, mu);
  std::map<std::pair<int, int>, tc::MatrixBlock> blocks;
  for (const tc::MatrixEntry& each : matrix_entries("A", A, b.size(), b.size())) {
    tc::MatrixBlock& block = blocks[{each.row / d, each.column / d}];
    block.row = each.row / d;
    block.column = each.column / d;
    block.value(each.row % d, each.column % d) += each.value;
  }
  std::vector<tc::MatrixBlock> list;
  for (const auto& [place, block] : blocks) list.push_back(block);
  return tc::Problem::sparse(d, std::move(list), vector("b", b), vector("mu", mu));
}

tc::Problem make_problem(const py::object& A, const Array& b, const Array& mu) {
  vector("b", b), vector("mu", mu);
  if (py::hasattr(A, "tocoo")) return sparse(A, b, mu);
  const auto dense = matrix<Columns>("A", A);
  return tc::Problem::dense(
      Eigen::Map<const Eigen::MatrixXd>(dense.data(), dense.shape(0), dense.shape(1)),
      vector("b", b), vector("mu", mu));
}

py::dict residuals(const tc::Problem& problem, const Array& impulses, const std::string& law) {
  using namespace py::literals;
  const tc::Residuals r = tc::evaluate(problem, law_of(law), by_row("impulses", impulses, problem));
  return py::dict("signorini"_a = r.signorini, "cone"_a = r.cone, "alignment"_a = r.alignment,
                  "dissipation"_a = r.dissipation, "energy_change"_a = r.energy_change,
                  "fixed_point"_a = r.fixed_point, "natural_map"_a = r.natural_map);
}

py::dict prove(const tc::Problem& problem, const Array& impulses, double allowed) {
  const View x = vector("impulses", impulses);
  const tc::Proof p = [&] {
    const py::gil_scoped_release others_run;
    return tc::prove(problem, x, allowed);
  }();
  using namespace py::literals;
  return py::dict("status"_a = std::string(name(p.status)), "radius"_a = p.radius,
                  "relative_radius"_a = p.relative_radius, "change"_a = p.change,
                  "relative_change"_a = p.relative_change, "regimes"_a = words_of(p.regimes),
                  "contact"_a = p.contact, "reason"_a = p.reason);
}

void bind_matrix_problem(py::module_& module) {
  using namespace py::literals;
  py::class_<tc::Problem>(module, "Problem", R"(A contact problem (A, b, mu).

A: (d n, d n) array or scipy.sparse matrix in 1/kg, b: (d n,) in m/s, mu: (n,), with d = 3
(normal, tangent, tangent) or d = 2 in the plane. Relative velocities after the impulses x are
w = A x - b. Raises ValueError on sizes that do not match and values that are not finite.)")
      .def(py::init(&make_problem), "A"_a, "b"_a, "mu"_a)
      .def_property_readonly("contacts", &tc::Problem::contacts, "number of contacts n")
      .def_property_readonly("dimension", &tc::Problem::dimension, "3, or 2 in the plane: d")
      .def_property_readonly(
          "A", [](const tc::Problem& p) { return Eigen::MatrixXd(p.dense_matrix()); },
          "(d n, d n), 1/kg")
      .def_property_readonly(
          "b", [](const tc::Problem& p) { return Eigen::VectorXd(p.b()); }, "(d n,), m/s")
      .def_property_readonly(
          "mu",
          [](const tc::Problem& p) {
            Eigen::VectorXd mu(p.contacts());
            for (int i = 0; i < p.contacts(); ++i) mu[i] = p.mu(i);
            return mu;
          },
          "(n,), coefficients of friction")
      .def("residuals", &residuals, "impulses"_a, "law"_a = "maximum_dissipation",
           "How far any impulses are from a solution: velocities in m/s; fixed_point has no unit.")
      .def("prove", &prove, "impulses"_a, py::kw_only(), "allowed"_a = 1e-9,
           R"(Proof in interval arithmetic that an exact solution of Coulomb's law is near.

status: proven (every |x*_i - x_i| <= radius, N s), proven_nearby (the same, x* solves a problem
whose b differs by at most change in m/s; relative_change, at most `allowed`, is over the largest b
of its island) or not_proven. contact and reason: what prevents more.)")
      .def(
          "derivative",
          [](const tc::Problem& p, const tc::Solution& solution, const std::string& law,
             double tolerance,
             double kink) { return derivative_of(tolerance, kink, p, law_of(law), solution); },
          "solution"_a, "law"_a = "maximum_dissipation", py::kw_only(), "tolerance"_a = 1e-5,
          "kink"_a = 1e-6,
          R"(The derivative of a Solution of this problem under `law`: a Derivative.

tolerance: largest error of a solution that is taken; kink: contacts nearer to another regime than
this (relative) are listed. Raises ValueError where the impulses are no solution.)")
      .def("solve", &solve<tc::Solver, tc::Problem>, "law"_a = "maximum_dissipation", py::kw_only(),
           "tolerance"_a = 1e-9, "start"_a = py::none(), "max_work"_a = 1e10, "strict"_a = false,
           R"(The impulses that obey the law: a Solution.

law: maximum_dissipation (Preclik and Ruede), coulomb or frictionless. tolerance: of the relative
error in velocity. start: impulses to begin with. max_work: about nanoseconds. strict: never
replace the law at single contacts. What cannot be solved is a status, with advice.)");
}

}  // namespace

void bind_contact(py::module_& module) {
  using namespace py::literals;
  module.doc() =
      "Frictional contact: w = A x - b, impulses x in the friction cones, A = J M^-1 J'.";
  bind_matrix_problem(module);
  bind_solution<tc::Solution>(module, "Solution",
                              "residuals[\"fixed_point\"], which is compared with the tolerance")
      .def_property_readonly(
          "regimes", [](const tc::Solution& s) { return words_of(s.regimes); },
          "separating, sticking or sliding")
      .def_readonly("replaced", &tc::Solution::replaced,
                    "contacts with Coulomb's law instead of maximum_dissipation")
      .def_property_readonly(
          "sweeps", [](const tc::Solution& s) { return s.counts.sweeps; },
          "sweeps over all contacts")
      .def_property_readonly(
          "factorisations", [](const tc::Solution& s) { return s.counts.factorisations; },
          "factorisations of sparse matrices");

  bind_derivative(module);
  bind_cones(module);

  module.def("read", &tc::read_problem, "path"_a,
             "A problem from a Siconos .dat or fclib .hdf5 file.");
  module.def(
      "laws",
      [] {
        std::vector<std::string> words;
        for (const tc::Law law : tc::laws()) words.emplace_back(name(law));
        return words;
      },
      "Names of the friction laws.");
}

}  // namespace tether::python
