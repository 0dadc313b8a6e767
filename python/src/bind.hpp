// Tether: what the parts of the Python module share. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <charconv>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <stdexcept>
#include <string>
#include <vector>

namespace tether::python {

namespace py = pybind11;

/// Any array-like of real numbers, as contiguous rows.
using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;

inline std::string shape(const Array& a) {
  std::string text = "(";
  for (py::ssize_t i = 0; i < a.ndim(); ++i) text += (i ? ", " : "") + std::to_string(a.shape(i));
  return text + ")";
}

/// A number of a message, the same in every locale.
inline std::string shown(double value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

[[noreturn]] inline void refuse(const std::string& what) { throw std::invalid_argument(what); }

/// An array of the given shape that owns a copy of the values.
inline Array array(const std::vector<double>& values, std::vector<py::ssize_t> lengths) {
  Array a(std::move(lengths));
  std::copy(values.begin(), values.end(), a.mutable_data());
  return a;
}
inline Array array(const double* values, py::ssize_t n) {
  Array a(n);
  std::copy(values, values + n, a.mutable_data());
  return a;
}

/// `given` as an array of doubles. Checked here, since numpy would cast other types silently.
template <class Numbers = Array>
Numbers numbers(const char* name, const py::object& given) {
  const py::array any = py::array::ensure(given);
  const bool real = any && any.dtype().kind() != 'c';
  Numbers out = real ? Numbers::ensure(any) : py::reinterpret_steal<Numbers>(py::handle());
  if (!out)
    refuse(std::string(name) + " has entries of type " +
           std::string(any ? py::str(any.dtype()) : py::str(py::type::of(given).attr("__name__"))) +
           ", must be real numbers");
  return out;
}

template <class Matrix = Array>
Matrix matrix(const char* name, const py::object& given) {
  Matrix out = numbers<Matrix>(name, given);
  if (out.ndim() != 2)
    refuse(std::string(name) + " has " + std::to_string(out.ndim()) + " axes, must be a matrix");
  return out;
}

/// The value of an enumeration that has this name.
template <class E, class List>
E named(const char* argument, const std::string& word, const List& all) {
  std::string allowed;
  for (const E value : all) {
    if (word == name(value)) return value;
    allowed += (allowed.empty() ? "" : ", ") + std::string(name(value));
  }
  refuse(std::string(argument) + " = \"" + word + "\", must be one of " + allowed);
}

void bind_contact(py::module_& module);
void bind_ida(py::module_& module);
void bind_scene(py::module_& module);

}  // namespace tether::python
