// Tether: rows whose Jacobian follows from their values. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <problems/rows.hpp>
#include <random>
#include <stdexcept>
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

/// The unknowns on which a value may depend. Comparisons are decided at random: every branch
/// counts.
struct Depends {
  static constexpr std::size_t kUnknowns = 512;
  std::bitset<kUnknowns> on;
  Depends() = default;
  Depends(double) {}

  friend Depends operator-(Depends a) { return a; }
  friend Depends operator+(Depends a, const Depends& b) { return a += b; }
  friend Depends operator-(Depends a, const Depends& b) { return a += b; }
  friend Depends operator*(Depends a, const Depends& b) { return a += b; }
  friend Depends operator/(Depends a, const Depends& b) { return a += b; }
  Depends& operator+=(const Depends& b) {
    on |= b.on;
    return *this;
  }
  Depends& operator-=(const Depends& b) { return *this += b; }
  friend bool operator<(const Depends&, const Depends&) { return either(); }
  friend bool operator>(const Depends&, const Depends&) { return either(); }
  friend bool operator<=(const Depends&, const Depends&) { return either(); }

  friend Depends sin(Depends a) { return a; }
  friend Depends cos(Depends a) { return a; }
  friend Depends log10(Depends a) { return a; }
  friend Depends exp(Depends a) { return a; }
  friend Depends sqrt(Depends a) { return a; }
  friend Depends abs(Depends a) { return a; }

 private:
  static bool either() {
    static std::minstd_rand random;
    return random() % 2 == 0;
  }
};

/// The entries of the Jacobian of m values g(y) of n unknowns, in compressed rows.
class Dependence {
 public:
  std::vector<int> starts, columns;

  /// value(y, g) takes Depends entries.
  template <class Value>
  Dependence(std::size_t n, std::size_t m, Value value) : starts{0}, direction_(n, 0) {
    constexpr int kTrials = 512;  // three comparisons lead to a branch in one of eight
    if (n > Depends::kUnknowns) throw std::invalid_argument("Dependence: too many unknowns");
    std::vector<Depends> at(n), g(m), rows(m);
    for (std::size_t j = 0; j < n; ++j) at[j].on.set(j);
    for (int trial = 0; trial < kTrials; ++trial) {
      value(at.data(), g.data());
      for (std::size_t i = 0; i < m; ++i) rows[i] += g[i];
    }
    for (const Depends& row : rows) {
      for (std::size_t j = 0; j < n; ++j)
        if (row.on[j]) columns.push_back(static_cast<int>(j));
      starts.push_back(static_cast<int>(columns.size()));
    }
    for (std::size_t j = 0; j < n; ++j) choose_direction(j, rows);
  }

  /// found(i, e, slope) for every entry e of row i at y; value(y, g) takes Dual entries. Returns g.
  template <class Value, class Found>
  std::vector<Dual> derivatives(const double* y, Value value, Found found) const {
    std::vector<Dual> at(y, y + direction_.size()), g(starts.size() - 1);
    for (int first = 0; first < directions_; first += Dual::kDirections) {
      for (std::size_t j = 0; j < at.size(); ++j)
        for (int k = 0; k < Dual::kDirections; ++k)
          at[j].slopes[static_cast<std::size_t>(k)] = direction_[j] == first + k ? 1.0 : 0.0;
      value(at.data(), g.data());
      for (std::size_t i = 0; i < g.size(); ++i)
        for (int e = starts[i]; e < starts[i + 1]; ++e) {
          const int k =
              direction_[static_cast<std::size_t>(columns[static_cast<std::size_t>(e)])] - first;
          if (k >= 0 && k < Dual::kDirections)
            found(i, e, g[i].slopes[static_cast<std::size_t>(k)]);
        }
    }
    return g;
  }

 private:
  // The first direction that no unknown before j has in the rows that contain it.
  void choose_direction(std::size_t j, const std::vector<Depends>& rows) {
    Depends beside;
    for (const Depends& row : rows)
      if (row.on[j]) beside += row;
    std::vector<char> taken(j + 1, 0);
    for (std::size_t other = 0; other < j; ++other)
      if (beside.on[other]) taken[static_cast<std::size_t>(direction_[other])] = 1;
    direction_[j] = static_cast<int>(std::find(taken.begin(), taken.end(), 0) - taken.begin());
    directions_ = std::max(directions_, direction_[j] + 1);
  }

  std::vector<int> direction_;  // of each unknown: those of one direction share no row
  int directions_ = 0;
};

/// A group of rows of y with `size` entries; value(t, y, g) takes double, Dual and Depends entries.
template <class Value>
Rows rows_of_values(std::string name, std::vector<std::string> row_names, int size, Value value) {
  const Dependence rows(static_cast<std::size_t>(size), row_names.size(),
                        [&](const Depends* at, Depends* g) { value(0.0, at, g); });
  ida_projection::SparseJacobian sparse;
  sparse.starts = rows.starts;
  sparse.columns = rows.columns;
  const auto derive = [value, rows](double t, const double* y, double* entries) {
    return rows.derivatives(
        y, [&](const Dual* at, Dual* g) { value(t, at, g); },
        [entries](std::size_t, int e, double slope) { entries[e] = slope; });
  };
  sparse.fill = [derive](double t, ida_projection::ConstVector y, ida_projection::Vector entries) {
    derive(t, y.data(), entries.data());
  };
  sparse.fill_with_value = [derive](double t, ida_projection::ConstVector y,
                                    ida_projection::Vector g, ida_projection::Vector entries) {
    const std::vector<Dual> values = derive(t, y.data(), entries.data());
    for (std::size_t i = 0; i < values.size(); ++i)
      g[static_cast<std::ptrdiff_t>(i)] = values[i].value;
  };
  Rows group = make_rows(
      std::move(name), std::move(row_names),
      [value](double t, const double* y, double* g) { value(t, y, g); },
      [](double, const double*, double*) {});
  group.constraints.jacobian = std::move(sparse);
  return group;
}

/// C of a set of dense or sparse rows without those joined to it, row-major; C is zero on entry.
inline void write_jacobian(const ida_projection::Constraints& rows, double t,
                           ida_projection::ConstVector y, double* C) {
  if (const auto* dense = std::get_if<ida_projection::DenseJacobian>(&rows.jacobian)) {
    dense->fill(t, y, ida_projection::Matrix(C, rows.count, y.size()));
    return;
  }
  const auto& sparse = std::get<ida_projection::SparseJacobian>(rows.jacobian);
  std::vector<double> entries(sparse.columns.size(), 0.0);
  sparse.fill(t, y, ida_projection::Vector(entries.data(), std::ptrdiff_t(entries.size())));
  for (std::size_t i = 0; i + 1 < sparse.starts.size(); ++i, C += y.size())
    for (int e = sparse.starts[i]; e < sparse.starts[i + 1]; ++e)
      C[sparse.columns[static_cast<std::size_t>(e)]] = entries[static_cast<std::size_t>(e)];
}

}  // namespace tether::problems
