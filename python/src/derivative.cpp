// Tether: derivatives of solutions of contact problems for Python. SPDX-License-Identifier:
// BSD-3-Clause
#include <functional>

#include "contact_parts.hpp"

namespace tether::python {

Entries matrix_entries(const char* argument, const py::object& whole, py::ssize_t rows,
                       py::ssize_t columns) {
  const auto check = [&](py::ssize_t r, py::ssize_t c) {
    if (r != rows || c != columns)
      refuse(std::string(argument) + " is " + std::to_string(r) + " x " + std::to_string(c) +
             ", must be " + std::to_string(rows) + " x " + std::to_string(columns));
  };
  Entries out;
  if (py::hasattr(whole, "tocoo")) {
    const py::object given = whole.attr("tocoo")();
    const auto size = given.attr("shape").cast<std::array<py::ssize_t, 2>>();
    check(size[0], size[1]);
    const auto i = given.attr("row").cast<py::array_t<int, py::array::forcecast>>();
    const auto j = given.attr("col").cast<py::array_t<int, py::array::forcecast>>();
    const auto values = given.attr("data").cast<Array>();
    out.reserve(static_cast<std::size_t>(values.size()));
    for (py::ssize_t k = 0; k < values.size(); ++k) out.push_back({i.at(k), j.at(k), values.at(k)});
    return out;
  }
  const auto dense = matrix(argument, whole);
  check(dense.shape(0), dense.shape(1));
  const auto value = dense.unchecked<2>();
  for (py::ssize_t i = 0; i < rows; ++i)
    for (py::ssize_t j = 0; j < columns; ++j)
      if (value(i, j) != 0) out.push_back({static_cast<int>(i), static_cast<int>(j), value(i, j)});
  return out;
}

namespace {

py::tuple forward(const tc::Derivative& d, const py::object& A, const py::object& b,
                  const py::object& mu, const py::object& rolling, const py::object& torsional,
                  const py::object& bound) {
  tc::ProblemDirection v;
  v.b = entries("b", b);
  v.mu = entries("mu", mu);
  v.rolling = entries("rolling", rolling);
  v.torsional = entries("torsional", torsional);
  v.bound = entries("bound", bound);
  const auto rows = static_cast<py::ssize_t>(d.impulses().size());
  if (!A.is_none()) v.A = matrix_entries("A", A, rows, rows);
  const tc::SolutionDirection found = d.forward(v);
  return py::make_tuple(Eigen::VectorXd(found.impulses), Eigen::VectorXd(found.velocities),
                        found.residual);
}

py::dict adjoint(const tc::Derivative& d, const py::object& impulses,
                 const py::object& velocities) {
  using namespace py::literals;
  const tc::ProblemDirection g =
      d.adjoint(entries("impulses", impulses), entries("velocities", velocities));
  const auto count = static_cast<py::ssize_t>(g.A.size());
  py::array_t<int> rows(count), columns(count);
  Array values(count);
  for (py::ssize_t k = 0; k < count; ++k) {
    const tc::MatrixEntry& entry = g.A[static_cast<std::size_t>(k)];
    rows.mutable_at(k) = entry.row;
    columns.mutable_at(k) = entry.column;
    values.mutable_at(k) = entry.value;
  }
  return py::dict("b"_a = Eigen::VectorXd(g.b), "mu"_a = Eigen::VectorXd(g.mu),
                  "rolling"_a = Eigen::VectorXd(g.rolling),
                  "torsional"_a = Eigen::VectorXd(g.torsional),
                  "bound"_a = Eigen::VectorXd(g.bound), "rows"_a = rows, "columns"_a = columns,
                  "values"_a = values);
}

}  // namespace

void bind_derivative(py::module_& module) {
  using namespace py::literals;
  py::class_<tc::Derivative> made(module, "Derivative", R"(Derivative of a solution.

By implicit differentiation on the branch of the present regimes; factors are kept. Made by
Problem.derivative and ConeProblem.derivative; contacts of the latter are its cones.)");
  made.def("forward", &forward, py::kw_only(), "A"_a = py::none(), "b"_a = py::none(),
           "mu"_a = py::none(), "rolling"_a = py::none(), "torsional"_a = py::none(),
           "bound"_a = py::none(),
           R"(J v: (dx, dw, residual) for changes of the data.

A: (n, n) array or scipy.sparse matrix (a change of a compliance is one of its diagonal), b: (n,);
the others by contact or cone, of those that have none ignored; None: no change. dx: of the
impulses, dw: of the velocities. residual is not small where the direction leaves the range of a
hyperstatic problem: the solution then jumps.)")
      .def("adjoint", &adjoint, "impulses"_a = py::none(), "velocities"_a = py::none(),
           R"(J' v: the gradient of impulses.x + velocities.w, a dict.

b by row; mu, rolling, torsional and bound by contact or cone; of the entries of A values[k] at
rows[k], columns[k].)");
  const auto told = [&](const char* title, auto get, const char* what) {
    made.def_property_readonly(
        title, [get](const tc::Derivative& d) { return std::invoke(get, d.report()); }, what);
  };
  using Report = tc::DerivativeReport;
  told("status", word(&Report::status),
       "unique, or minimum_norm: impulses are not unique, the least change is given");
  told("strictly_regular", &Report::strictly_regular,
       "every contact is strictly open, sticking or sliding");
  told(
      "regimes", [](const Report& r) { return words_of(r.regimes); },
      "separating, sticking or sliding: the branch of each contact");
  told(
      "kinks",
      [](const Report& r) {
        py::list out;
        for (const tc::Kink& k : r.kinks)
          out.append(py::make_tuple(k.contact, name(k.branch), name(k.other), k.margin));
        return out;
      },
      "(contact, branch whose derivative is given, other regime, relative margin)");
  told("rank", &Report::rank, "how many of `unknowns` are determined");
  told("unknowns", &Report::unknowns, "components of touching contacts");
  told("not_unique", &Report::not_unique, "contacts whose impulses are not determined");
  told("velocities_unique", &Report::velocities_unique,
       "velocities are determined even where impulses are not");
  told("error", &Report::error, "relative error of the impulses as a solution");
  told("advice", &Report::advice, "what the report means for the use of the derivative");
}

}  // namespace tether::python
