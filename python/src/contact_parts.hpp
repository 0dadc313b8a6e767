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

using Entries = std::vector<tc::MatrixEntry>;

/// Entries of an array or a scipy.sparse matrix with `rows` rows and `columns` columns.
Entries matrix_entries(const char* argument, const py::object& whole, py::ssize_t rows,
                       py::ssize_t columns);

void bind_cones(py::module_& module);
void bind_derivative(py::module_& module);

}  // namespace tether::python
