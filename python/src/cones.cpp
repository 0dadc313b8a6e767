// Tether: contact problems over products of cones for Python. SPDX-License-Identifier: BSD-3-Clause
#include <optional>
#include <tether/contact/cones.hpp>
#include <tether/contact/files.hpp>
#include <utility>

#include "contact_parts.hpp"

namespace tether::python {

namespace {

tc::ConeProblem make_cone_problem(const py::object& A, const Array& b, std::vector<tc::Cone> cones,
                                  const py::object& compliance) {
  const View rows = vector("b", b);
  return tc::ConeProblem::sparse(matrix_entries("A", A, b.size(), b.size()), rows, std::move(cones),
                                 entries("compliance", compliance));
}

tc::ConeProblem make_saddle(const py::object& M, const py::object& J, const Array& f,
                            const Array& bias, std::vector<tc::Cone> cones,
                            const py::object& compliance) {
  const View force = vector("f", f), rate = vector("bias", bias);
  return tc::ConeProblem::saddle(matrix_entries("M", M, f.size(), f.size()),
                                 matrix_entries("J", J, bias.size(), f.size()), force, rate,
                                 std::move(cones), entries("compliance", compliance));
}

py::dict residuals_of(const tc::ConeResiduals& r) {
  using namespace py::literals;
  return py::dict("error"_a = r.error, "worst"_a = r.worst,
                  "blocks"_a = array(r.blocks.data(), static_cast<py::ssize_t>(r.blocks.size())));
}

void bind_cone(py::module_& module) {
  using namespace py::literals;
  py::class_<tc::Cone>(module, "Cone", R"(A factor of the cone K of a ConeProblem.

What its rows of the impulse x may be, and what that asks of their velocities w. Made by the
functions below.)")
      .def_static("free", py::overload_cast<int>(&tc::Cone::free), "rows"_a = 1,
                  "x of any sign, w = 0: joints. The only one with any number of rows.")
      .def_static("nonnegative", &tc::Cone::nonnegative,
                  "1 row: x >= 0 complementary to w >= 0: limits, contacts without friction.")
      .def_static("bounded", py::overload_cast<double>(&tc::Cone::bounded), "bound"_a,
                  "1 row: |x| <= bound; where w is not 0, x = -bound sign w: motors, dry joints.")
      .def_static("planar", &tc::Cone::planar, "mu"_a, "2 rows: normal, tangent.")
      .def_static("friction", &tc::Cone::friction, "mu"_a,
                  "3 rows: normal, tangent, tangent; |x_t| <= mu x_n.")
      .def_static("with_torsional", &tc::Cone::with_torsional, "mu"_a, "torsional"_a,
                  "4 rows: friction's, and the moment about the normal, at most torsional x_n.")
      .def_static(
          "with_rolling",
          [](double mu, double rolling, const std::optional<double>& torsional) {
            return torsional ? tc::Cone::with_rolling(mu, rolling, *torsional)
                             : tc::Cone::with_rolling(mu, rolling);
          },
          "mu"_a, "rolling"_a, "torsional"_a = py::none(),
          R"(5 rows: friction's and two moments across the normal, |y_t| <= rolling x_n.

With torsional 6: normal, tangents, moment about the normal, two across it.)")
      .def_property_readonly(
          "kind", word(&tc::Cone::kind),
          "the law: free, nonnegative, bounded, planar, friction, torsional, rolling or "
          "rolling_torsional")
      .def_readonly("rows", &tc::Cone::rows, "number of rows of x, w and b")
      .def_readonly("mu", &tc::Cone::mu, "coefficient of friction")
      .def_readonly("rolling", &tc::Cone::rolling, "length of rolling friction, m")
      .def_readonly("torsional", &tc::Cone::torsional, "length of torsional friction, m")
      .def_readonly("bound", &tc::Cone::bound, "largest impulse of a bounded row")
      .def("__repr__", [](const tc::Cone& c) {
        return "<Cone: " + std::string(name(c.kind)) + ", rows " + std::to_string(c.rows) + ">";
      });
}

py::class_<tc::ConeProblem> bind_problem(py::module_& module) {
  using namespace py::literals;
  return py::class_<tc::ConeProblem>(module, "ConeProblem", R"(w = A x - b over a product of cones.

A: (n, n) array or scipy.sparse matrix, b: (n,), cones: list of Cone whose rows add up to n, in
their order; compliance: (n,) velocity over impulse of each row, >= 0, added to the diagonal of A.
Rows of any units. A may be singular (redundant joints, many contacts). Raises ValueError on sizes
that do not match, values that are not finite or out of range and contacts that nothing moves.)")
      .def(py::init(&make_cone_problem), "A"_a, "b"_a, "cones"_a, "compliance"_a = py::none())
      .def_static("saddle", &make_saddle, "M"_a, "J"_a, "f"_a, "bias"_a, "cones"_a,
                  "compliance"_a = py::none(),
                  R"(M v = J' x + f, w = J v + bias.

M: (m, m) positive definite, one of its halves or both; J: (n, m); arrays or scipy.sparse; f: (m,),
bias: (n,).)")
      .def_property_readonly("rows", &tc::ConeProblem::rows, "rows of all cones: n")
      .def_property_readonly("cones", &tc::ConeProblem::cones,
                             "list of Cone, in the order of their rows")
      .def_property_readonly(
          "first_rows",
          [](const tc::ConeProblem& p) {
            std::vector<int> rows;
            for (int k = 0; k < static_cast<int>(p.cones().size()); ++k)
              rows.push_back(p.first_row(k));
            return rows;
          },
          "the first row of each cone")
      .def_property_readonly(
          "A", [](const tc::ConeProblem& p) { return Eigen::MatrixXd(p.dense_matrix()); },
          "with the compliance")
      .def_property_readonly(
          "b", [](const tc::ConeProblem& p) { return Eigen::VectorXd(p.b()); }, "(n,), by row");
}

void bind_laws(py::class_<tc::ConeProblem>& problem) {
  using namespace py::literals;
  problem
      .def(
          "residuals",
          [](const tc::ConeProblem& p, const Array& impulses, const std::string& law) {
            return residuals_of(tc::evaluate(p, law_of(law), by_row("impulses", impulses, p)));
          },
          "impulses"_a, "law"_a = "coulomb",
          R"(How far any impulses are from the law, without units: a dict.

blocks: error in velocity of each cone, over what its island needs; error: the largest; worst: the
cone that has it.)")
      .def(
          "derivative",
          [](const tc::ConeProblem& p, const Array& impulses, double tolerance, double kink) {
            return derivative_of(tolerance, kink, p, by_row("impulses", impulses, p));
          },
          "impulses"_a, py::kw_only(), "tolerance"_a = 1e-5, "kink"_a = 1e-6,
          R"(The derivative of the solution `impulses` under "coulomb": a Derivative.

tolerance: largest error of a solution that is taken; kink: cones nearer to another regime than
this (relative) are listed. Raises ValueError where the impulses are no solution.)")
      .def(
          "solve",
          [](const tc::ConeProblem& p, const std::string& law, double tolerance,
             const py::object& start, double max_work) {
            return solve<tc::ConeSolver>(p, law, tolerance, start, max_work, false);
          },
          "law"_a = "coulomb", py::kw_only(), "tolerance"_a = 1e-9, "start"_a = py::none(),
          "max_work"_a = 1e10,
          R"(The impulses that obey the law: a ConeSolution.

law: coulomb takes every cone, frictionless no bounds and moments, maximum_dissipation no free rows
either. start: impulses to begin with. max_work: about nanoseconds. What cannot be solved is a
status, with advice.)");
}

}  // namespace

void bind_cones(py::module_& module) {
  bind_cone(module);
  py::class_<tc::ConeProblem> problem = bind_problem(module);
  bind_laws(problem);
  using namespace py::literals;
  bind_solution<tc::ConeSolution>(module, "ConeSolution",
                                  "residuals[\"error\"], which is compared with the tolerance")
      .def_property_readonly(
          "residuals", [](const tc::ConeSolution& s) { return residuals_of(s.residuals); },
          "of the impulses, as ConeProblem.residuals gives them")
      .def_readonly("contradicting", &tc::ConeSolution::contradicting,
                    "free rows that nothing satisfies together")
      .def_readonly("blocked", &tc::ConeSolution::blocked,
                    "cones that approach though free rows hold their normal");
  module.def("read_cones", &tc::read_cones, "path"_a,
             "A ConeProblem from a .dat of Siconos or an fclib file: with joints, rolling friction "
             "or in global form (M, H), too.");
}

}  // namespace tether::python
