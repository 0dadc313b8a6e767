// Tether: rows whose Jacobian follows from their values. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <problems/rows.hpp>
#include <string>
#include <utility>
#include <vector>

namespace tether::problems {

/// A value and its derivatives along some directions; comparisons use the value.
struct Dual {
  static constexpr int kDirections = 8;  // a sweep over these costs as much as two single ones
  double value = 0.0;
  std::array<double, kDirections> slopes{};
  Dual() = default;
  Dual(double v) : value(v) {}

  friend Dual operator-(Dual a) { return chain(-a.value, -1.0, a); }
  friend Dual operator+(Dual a, Dual b) { return chain(a.value + b.value, 1.0, a, 1.0, b); }
  friend Dual operator-(Dual a, Dual b) { return chain(a.value - b.value, 1.0, a, -1.0, b); }
  friend Dual operator*(Dual a, Dual b) { return chain(a.value * b.value, b.value, a, a.value, b); }
  friend Dual operator/(Dual a, Dual b) {
    const double ratio = a.value / b.value;
    return chain(ratio, 1.0 / b.value, a, -ratio / b.value, b);
  }
  Dual& operator+=(Dual b) { return *this = *this + b; }
  Dual& operator-=(Dual b) { return *this = *this - b; }
  friend bool operator<(Dual a, Dual b) { return a.value < b.value; }
  friend bool operator>(Dual a, Dual b) { return a.value > b.value; }
  friend bool operator<=(Dual a, Dual b) { return a.value <= b.value; }

  friend Dual sin(Dual a) { return chain(std::sin(a.value), std::cos(a.value), a); }
  friend Dual cos(Dual a) { return chain(std::cos(a.value), -std::sin(a.value), a); }
  friend Dual log10(Dual a) {
    return chain(std::log10(a.value), 1.0 / (a.value * 2.302585092994045684), a);
  }
  friend Dual exp(Dual a) {
    const double e = std::exp(a.value);
    return chain(e, e, a);
  }
  friend Dual sqrt(Dual a) {
    const double root = std::sqrt(a.value);
    return chain(root, root > 0.0 ? 1.0 / (2.0 * root) : 0.0, a);
  }
  friend Dual abs(Dual a) { return a.value < 0.0 ? -a : a; }

 private:
  // A function of a, or of a and b, with its derivatives by them.
  static Dual chain(double value, double by_a, const Dual& a) {
    Dual result(value);
    for (std::size_t k = 0; k < kDirections; ++k) result.slopes[k] = by_a * a.slopes[k];
    return result;
  }
  static Dual chain(double value, double by_a, const Dual& a, double by_b, const Dual& b) {
    Dual result(value);
    for (std::size_t k = 0; k < kDirections; ++k)
      result.slopes[k] = by_a * a.slopes[k] + by_b * b.slopes[k];
    return result;
  }
};

/// found(i, j, dg_i/dy_j) for every entry of g(y), m values of n unknowns; value(y, g) takes Dual
/// entries.
template <class Value, class Found>
void derivatives(const double* y, std::size_t n, std::size_t m, Value value, Found found) {
  std::vector<Dual> at(y, y + n), g(m);
  for (std::size_t first = 0; first < n; first += Dual::kDirections) {
    const std::size_t many = std::min<std::size_t>(Dual::kDirections, n - first);
    for (std::size_t k = 0; k < many; ++k) at[first + k].slopes[k] = 1.0;
    value(at.data(), g.data());
    for (std::size_t k = 0; k < many; ++k) at[first + k].slopes[k] = 0.0;
    for (std::size_t i = 0; i < m; ++i)
      for (std::size_t k = 0; k < many; ++k) found(i, first + k, g[i].slopes[k]);
  }
}

/// A group of rows of y with `size` entries; value(t, y, g) takes double and Dual entries alike.
template <class Value>
Rows rows_of_values(std::string name, std::vector<std::string> row_names, int size, Value value) {
  const std::size_t m = row_names.size();
  return make_rows(
      std::move(name), std::move(row_names),
      [value](double t, const double* y, double* g) { value(t, y, g); },
      [value, m, size](double t, const double* y, double* C) {
        const auto n = static_cast<std::size_t>(size);
        derivatives(
            y, n, m, [&](const Dual* at, Dual* g) { value(t, at, g); },
            [C, n](std::size_t i, std::size_t j, double slope) { C[i * n + j] = slope; });
      });
}

}  // namespace tether::problems
