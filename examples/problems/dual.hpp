// Tether: rows whose Jacobian follows from their values. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <problems/rows.hpp>
#include <string>
#include <utility>
#include <vector>

namespace tether::problems {

/// A value and its derivative along one direction; comparisons look at the value.
struct Dual {
  double value = 0.0, slope = 0.0;
  Dual() = default;
  Dual(double v, double d = 0.0) : value(v), slope(d) {}

  friend Dual operator-(Dual a) { return {-a.value, -a.slope}; }
  friend Dual operator+(Dual a, Dual b) { return {a.value + b.value, a.slope + b.slope}; }
  friend Dual operator-(Dual a, Dual b) { return {a.value - b.value, a.slope - b.slope}; }
  friend Dual operator*(Dual a, Dual b) {
    return {a.value * b.value, a.slope * b.value + a.value * b.slope};
  }
  friend Dual operator/(Dual a, Dual b) {
    const double ratio = a.value / b.value;
    return {ratio, (a.slope - ratio * b.slope) / b.value};
  }
  Dual& operator+=(Dual b) { return *this = *this + b; }
  Dual& operator-=(Dual b) { return *this = *this - b; }
  friend bool operator<(Dual a, Dual b) { return a.value < b.value; }
  friend bool operator>(Dual a, Dual b) { return a.value > b.value; }
  friend bool operator<=(Dual a, Dual b) { return a.value <= b.value; }

  friend Dual sin(Dual a) { return {std::sin(a.value), std::cos(a.value) * a.slope}; }
  friend Dual cos(Dual a) { return {std::cos(a.value), -std::sin(a.value) * a.slope}; }
  friend Dual log10(Dual a) {
    return {std::log10(a.value), a.slope / (a.value * 2.302585092994045684)};
  }
  friend Dual exp(Dual a) {
    const double e = std::exp(a.value);
    return {e, e * a.slope};
  }
  friend Dual sqrt(Dual a) {
    const double root = std::sqrt(a.value);
    return {root, root > 0.0 ? a.slope / (2.0 * root) : 0.0};
  }
  friend Dual abs(Dual a) { return a.value < 0.0 ? -a : a; }
};

/// A group of rows of y with `size` entries; value(t, y, g) takes double and Dual entries alike.
template <class Value>
Rows rows_of_values(std::string name, std::vector<std::string> row_names, int size, Value value) {
  const std::size_t m = row_names.size();
  return make_rows(
      std::move(name), std::move(row_names),
      [value](double t, const double* y, double* g) { value(t, y, g); },
      [value, m, size](double t, const double* y, double* C) {
        const auto N = static_cast<std::size_t>(size);
        std::vector<Dual> at(y, y + size), g(m);
        for (std::size_t j = 0; j < N; ++j) {
          at[j].slope = 1.0;
          value(t, at.data(), g.data());
          at[j].slope = 0.0;
          for (std::size_t i = 0; i < m; ++i) C[i * N + j] = g[i].slope;
        }
      });
}

}  // namespace tether::problems
