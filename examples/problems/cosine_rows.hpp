// Tether: rows that are sums of coordinates and of cosines of their sums. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <cmath>
#include <vector>

namespace tether::problems {

/// g_i(q) = constant_i + sum linear + sum factor cos or sin(q_a +- q_b): joints of plane
/// bodies and of bodies on a turning axis. Everything that a mechanism wants of its constraints,
/// exactly.
class CosineRows {
 public:
  CosineRows(int rows, int coordinates)
      : n_(coordinates), constants_(static_cast<std::size_t>(rows), 0.0) {}

  void constant(int row, double value) { constants_[static_cast<std::size_t>(row)] += value; }
  void linear(int row, int column, double factor) { linear_.push_back({row, column, factor}); }
  /// factor cos q_a, or factor sin q_a
  void cosine(int row, double factor, int a, bool sine = false) {
    waves_.push_back({row, factor, a, a, 0.0, sine});
  }
  /// factor cos q_a cos q_b, or factor sin q_a cos q_b
  void product(int row, double factor, int a, int b, bool sine = false) {
    for (const double sign : {1.0, -1.0}) waves_.push_back({row, factor / 2.0, a, b, sign, sine});
  }

  int count() const { return static_cast<int>(constants_.size()); }

  void position(const double* q, double* r) const {
    for (std::size_t i = 0; i < constants_.size(); ++i) r[i] = constants_[i];
    for (const Linear& each : linear_) r[each.row] += each.factor * q[each.column];
    for (const Wave& w : waves_) r[w.row] += w.value(q);
  }
  void velocity(const double* q, const double* v, double* r) const {
    rates(v, r);
    for (const Wave& w : waves_) r[w.row] += w.slope(q) * w.along(v);
  }
  void acceleration(const double* q, const double* v, const double* a, double* r) const {
    rates(a, r);
    for (const Wave& w : waves_) {
      const double turn = w.along(v);
      r[w.row] += w.slope(q) * w.along(a) - w.value(q) * turn * turn;
    }
  }
  // m x n row-major, added to what is there.
  void gradient(const double* q, double* G) const {
    for (const Linear& each : linear_) G[each.row * n_ + each.column] += each.factor;
    for (const Wave& w : waves_) spread(w, w.slope(q), G);
  }
  void velocity_gradient(const double* q, const double* v, double* H) const {
    for (const Wave& w : waves_) spread(w, -w.value(q) * w.along(v), H);
  }
  void acceleration_gradient(const double* q, const double* v, const double* a, double* K) const {
    for (const Wave& w : waves_) {
      const double turn = w.along(v);
      spread(w, -w.slope(q) * turn * turn - w.value(q) * w.along(a), K);
    }
  }
  /// Adds sum_i lam_i d^2 g_i / dq^2, n x n.
  void curvature(const double* q, const double* lam, double* D) const {
    for (const Wave& w : waves_) {
      const double second = -lam[w.row] * w.value(q);
      w.each([&](int i, double si) {
        w.each([&](int j, double sj) { D[i * n_ + j] += second * si * sj; });
      });
    }
  }

 private:
  struct Linear {
    int row, column;
    double factor;
  };
  struct Wave {
    int row;
    double factor;
    int a, b;
    double sign;  // 0: no second coordinate
    bool sine;    // sin q_a cos q_b = (sin(q_a + q_b) + sin(q_a - q_b)) / 2
    double value(const double* q) const {
      return factor * (sine ? std::sin(along(q)) : std::cos(along(q)));
    }
    double slope(const double* q) const {
      return factor * (sine ? std::cos(along(q)) : -std::sin(along(q)));
    }
    double along(const double* x) const { return x[a] + sign * x[b]; }
    template <class F>
    void each(F f) const {
      f(a, 1.0);
      if (sign != 0.0) f(b, sign);
    }
  };

  void rates(const double* x, double* r) const {
    for (std::size_t i = 0; i < constants_.size(); ++i) r[i] = 0.0;
    for (const Linear& each : linear_) r[each.row] += each.factor * x[each.column];
  }
  void spread(const Wave& w, double slope, double* out) const {
    w.each([&](int j, double s) { out[w.row * n_ + j] += slope * s; });
  }

  int n_;
  std::vector<double> constants_;
  std::vector<Linear> linear_;
  std::vector<Wave> waves_;
};

}  // namespace tether::problems
