// Tether: point masses on rods, with their rows sparse and dense. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "host.hpp"

namespace tether::test {

/// N point masses (1 kg) in the plane on rods from the origin, y = (q, v), q' = v, v' = a with the
/// rods' forces from a tridiagonal system; released at rest along the x axis.
class RodChain {
 public:
  RodChain(int masses, double rod) : N(masses), l(rod) {}

  Problem problem(double t_end) const {
    std::vector<double> y0(static_cast<std::size_t>(4 * N), 0.0);
    for (int i = 0; i < N; ++i) y0[static_cast<std::size_t>(2 * i)] = (i + 1) * l;
    return ode(y0, t_end, [*this](double, const double* y, double* f) { derivative(y, f); });
  }

  tp::Constraints sparse_rows() const {
    tp::Constraints set = values();
    tp::SparseJacobian given;
    const std::vector<double> any(static_cast<std::size_t>(4 * N), 1.0);
    int row = -1;
    entries(any.data(), [&](int i, int j, double) {
      if (i > row) given.starts.push_back(static_cast<int>(given.columns.size()));
      row = i;
      given.columns.push_back(j);
    });
    given.starts.push_back(static_cast<int>(given.columns.size()));
    given.fill = [*this](double, tp::ConstVector y, tp::Vector out) {
      int e = 0;
      entries(y.data(), [&](int, int, double entry) { out[e++] = entry; });
    };
    set.jacobian = std::move(given);
    return set;
  }

  tp::Constraints dense_rows() const {
    tp::Constraints set = values();
    set.jacobian = tp::DenseJacobian{[*this](double, tp::ConstVector y, tp::Matrix C) {
      C.setZero();
      entries(y.data(), [&](int i, int j, double entry) { C(i, j) = entry; });
    }};
    return set;
  }

  tp::Constraints energy_row() const {
    return row(
        "energy",
        [*this](double, const double* y) {
          double sum = 0.0;
          for (int i = 0; i < 2 * N; ++i) sum += 0.5 * y[2 * N + i] * y[2 * N + i];
          for (int i = 0; i < N; ++i) sum += kGravity * y[2 * i + 1];
          return sum;
        },
        [*this](double, const double* y, double* gradient) {
          std::fill(gradient, gradient + 2 * N, 0.0);
          for (int i = 0; i < N; ++i) gradient[2 * i + 1] = kGravity;
          std::copy(y + 2 * N, y + 4 * N, gradient + 2 * N);
        });
  }

 private:
  static constexpr double kGravity = 9.81;

  /// From mass i - 1 to mass i, of q or of v.
  static std::array<double, 2> along(const double* x, int i) {
    if (i == 0) return {x[0], x[1]};
    return {x[2 * i] - x[2 * i - 2], x[2 * i + 1] - x[2 * i - 1]};
  }

  void derivative(const double* y, double* f) const {
    const double *q = y, *v = y + 2 * N;
    Eigen::VectorXd diagonal(N), force(N), beside = Eigen::VectorXd::Zero(N);
    for (int i = 0; i < N; ++i) {
      const auto d = along(q, i), w = along(v, i);
      diagonal[i] = (i > 0 ? 2.0 : 1.0) * (d[0] * d[0] + d[1] * d[1]);
      force[i] = w[0] * w[0] + w[1] * w[1] - (i > 0 ? 0.0 : kGravity * d[1]);
      if (i == 0) continue;
      const auto before = along(q, i - 1);
      beside[i] = -(d[0] * before[0] + d[1] * before[1]);
      const double share = beside[i] / diagonal[i - 1];
      diagonal[i] -= share * beside[i];
      force[i] -= share * force[i - 1];
    }
    for (int i = N - 1; i >= 0; --i)
      force[i] = (force[i] - (i + 1 < N ? beside[i + 1] * force[i + 1] : 0.0)) / diagonal[i];
    std::copy(v, v + 2 * N, f);
    for (int i = 0; i < N; ++i)
      for (int k = 0; k < 2; ++k) {
        const auto axis = static_cast<std::size_t>(k);
        double pull = -force[i] * along(q, i)[axis];
        if (i + 1 < N) pull += force[i + 1] * along(q, i + 1)[axis];
        f[2 * N + 2 * i + k] = pull - (k == 1 ? kGravity : 0.0);
      }
  }

  tp::Constraints values() const {
    tp::Constraints set;
    set.count = 2 * N;
    set.value = [*this](double, tp::ConstVector y, tp::Vector g) {
      for (int i = 0; i < N; ++i) {
        const auto d = along(y.data(), i), w = along(y.data() + 2 * N, i);
        g[i] = 0.5 * (d[0] * d[0] + d[1] * d[1] - l * l);
        g[N + i] = d[0] * w[0] + d[1] * w[1];
      }
    };
    return set;
  }

  /// add(row, column, entry), columns ascending in each row.
  template <class Add>
  void entries(const double* y, Add add) const {
    for (int i = 0; i < 2 * N; ++i) {
      const int mass = i % N;
      const auto d = along(y, mass), w = along(y + 2 * N, mass);
      const auto pair = [&](int first, const std::array<double, 2>& entry) {
        for (const int end : {mass - 1, mass})
          for (int k = 0; k < 2 && end >= 0; ++k)
            add(i, first + 2 * end + k,
                (end < mass ? -1.0 : 1.0) * entry[static_cast<std::size_t>(k)]);
      };
      pair(0, i < N ? d : w);
      if (i >= N) pair(2 * N, d);
    }
  }

  int N;
  double l;
};

}  // namespace tether::test
