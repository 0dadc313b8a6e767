// Tether: what the bindings of contact problems share. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <tether/contact.hpp>

#include "bind.hpp"

namespace tether::python {

namespace tc = tether::contact;

inline constexpr std::array kMethods = {
    tc::Method::automatic,      tc::Method::gauss_seidel,     tc::Method::sor,
    tc::Method::jacobi,         tc::Method::anderson,         tc::Method::proximal_newton,
    tc::Method::interior_point, tc::Method::convex_relaxation};

using View = Eigen::Map<const Eigen::VectorXd>;

inline View vector(const char* argument, const Array& a) {
  if (a.ndim() != 1)
    refuse(std::string(argument) + " has shape " + shape(a) + ", must be a vector");
  return {a.data(), a.size()};
}

inline std::vector<std::string> words_of(const std::vector<tc::Regime>& regimes) {
  std::vector<std::string> words;
  words.reserve(regimes.size());
  for (const tc::Regime regime : regimes) words.emplace_back(name(regime));
  return words;
}

/// An argument that may be None: no change.
inline Eigen::VectorXd entries(const char* argument, const py::object& value) {
  if (value.is_none()) return {};
  return vector(argument, value.cast<Array>());
}

/// Properties of a Derivative or ConeDerivative: its report.
template <class D>
void def_report(py::class_<D>& made) {
  made.def_property_readonly(
          "status", [](const D& d) { return std::string(name(d.report().status)); },
          "unique, or minimum_norm: impulses are not unique, the least change is given")
      .def_property_readonly(
          "strictly_regular", [](const D& d) { return d.report().strictly_regular; },
          "every contact is strictly open, sticking or sliding")
      .def_property_readonly("regimes", [](const D& d) { return words_of(d.report().regimes); })
      .def_property_readonly(
          "kinks",
          [](const D& d) {
            py::list out;
            for (const tc::Kink& k : d.report().kinks)
              out.append(py::make_tuple(k.contact, name(k.branch), name(k.other), k.margin));
            return out;
          },
          "(contact, branch whose derivative is given, other regime, relative margin)")
      .def_property_readonly("rank", [](const D& d) { return d.report().rank; })
      .def_property_readonly("unknowns", [](const D& d) { return d.report().unknowns; })
      .def_property_readonly(
          "not_unique", [](const D& d) { return d.report().not_unique; },
          "contacts whose impulses are not determined")
      .def_property_readonly("velocities_unique",
                             [](const D& d) { return d.report().velocities_unique; })
      .def_property_readonly("error", [](const D& d) { return d.report().error; })
      .def_property_readonly("advice", [](const D& d) { return d.report().advice; });
}

void bind_cones(py::module_& module);

}  // namespace tether::python
