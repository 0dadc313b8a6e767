// Tether: moves of rows with forces among the differential unknowns. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <variant>

#include "host.hpp"
#include "support/catch.hpp"

using namespace tether::test;

namespace {

/// A chain of rods whose joints springs keep straight, from the origin, in index 0: y = (q, v, p),
/// p the rods' forces by length, F keeps the third derivative of their lengths.
class Chain {
 public:
  Chain(int masses, double rod, double spring, double fall = 0.2)
      : N(masses), rod_(rod), spring_(spring), fall_(fall) {}

  /// Released at rest along a line that falls by that angle.
  Problem problem(double t_end) const {
    Problem p;
    p.name = "rods in index 0";
    p.index = 0;
    p.size = 5 * N;
    p.t_end = t_end;
    p.error_components = 4 * N;
    p.y0.assign(static_cast<std::size_t>(p.size), 0.0);
    p.yp0 = p.y0;
    p.id.assign(p.y0.size(), 1.0);
    const double axis[2] = {rod_ * std::cos(fall_), rod_ * -std::sin(fall_)};
    for (int a = 0; a < 2 * N; ++a) p.y0[static_cast<std::size_t>(a)] = (a / 2 + 1) * axis[a % 2];
    set_forces(p.y0);
    std::vector<double> acc(static_cast<std::size_t>(2 * N));
    accelerations(p.y0.data(), acc.data());
    std::copy(acc.begin(), acc.end(), p.yp0.begin() + 2 * N);
    p.residual = [this](double, const double* y, const double* yp, double* r) {
      residual(y, yp, r);
    };
    // Along one unknown F is quadratic: differences about y are exact.
    p.jacobian = [this](double, double cj, const double* y, const double* yp, double* J) {
      const auto n = static_cast<std::size_t>(5 * N);
      std::vector<double> at(y, y + n), rate(yp, yp + n), below(n);
      for (std::size_t j = 0; j < n; ++j, J += n) {
        at[j] = y[j] - 0.5;
        rate[j] = yp[j] - 0.5 * cj;
        residual(at.data(), rate.data(), below.data());
        at[j] = y[j] + 0.5;
        rate[j] = yp[j] + 0.5 * cj;
        residual(at.data(), rate.data(), J);
        for (std::size_t i = 0; i < n; ++i) J[i] -= below[i];
        at[j] = y[j];
        rate[j] = yp[j];
      }
    };
    return p;
  }

  tp::Constraints rows() const {
    tp::Constraints set;
    set.count = 3 * N;
    set.value = [this](double, tp::ConstVector y, tp::Vector g) { values(y.data(), g.data()); };
    set.jacobian = tp::DenseJacobian{[this](double, tp::ConstVector y, tp::Matrix C) {
      std::vector<double> unit(static_cast<std::size_t>(5 * N), 0.0), column(unit);
      for (int j = 0; j < 5 * N; ++j) {
        unit[static_cast<std::size_t>(j)] = 1.0;
        changes(y.data(), unit.data(), column.data());
        for (int i = 0; i < 3 * N; ++i) C(i, j) = column[static_cast<std::size_t>(i)];
        unit[static_cast<std::size_t>(j)] = 0.0;
      }
    }};
    return set;
  }

 private:
  static constexpr double kGravity = 9.81;

  static double along(const double* x, int a) { return a >= 2 ? x[a] - x[a - 2] : x[a]; }

  /// The springs' forces for q, or their changes for dq.
  void springs(const double* q, double* f) const {
    for (int a = 0; a + 2 < 2 * N; ++a) {
      const double moment = spring_ * (along(q, a + 2) - along(q, a));
      f[a + 2] -= moment;
      f[a] += 2.0 * moment;
      if (a >= 2) f[a - 2] -= moment;
    }
  }
  void pulls(const double* q, const double* p, double* f) const {
    for (int a = 0; a < 2 * N; ++a) {
      f[a] -= p[a / 2] * along(q, a);
      if (a >= 2) f[a - 2] += p[a / 2] * along(q, a);
    }
  }
  void accelerations(const double* y, double* acc) const {
    for (int a = 0; a < 2 * N; ++a) acc[a] = a % 2 == 1 ? -kGravity : 0.0;
    springs(y, acc);
    pulls(y, y + 4 * N, acc);
  }
  void changes_of_accelerations(const double* y, const double* dy, double* dacc) const {
    std::fill(dacc, dacc + 2 * N, 0.0);
    springs(dy, dacc);
    pulls(y, dy + 4 * N, dacc);
    pulls(dy, y + 4 * N, dacc);
  }
  void values(const double* y, double* g) const {
    std::vector<double> acc(static_cast<std::size_t>(2 * N));
    accelerations(y, acc.data());
    for (int i = 0; i < N; ++i) {
      double length = -rod_ * rod_, rate = 0.0, second = 0.0;
      for (int a = 2 * i; a < 2 * i + 2; ++a) {
        const double d = along(y, a), w = along(y + 2 * N, a);
        length += d * d;
        rate += d * w;
        second += w * w + d * along(acc.data(), a);
      }
      g[i] = 0.5 * length;
      g[N + i] = rate;
      g[2 * N + i] = second;
    }
  }
  void changes(const double* y, const double* dy, double* dg) const {
    std::vector<double> acc(static_cast<std::size_t>(2 * N)), dacc(acc);
    accelerations(y, acc.data());
    changes_of_accelerations(y, dy, dacc.data());
    for (int i = 0; i < N; ++i) {
      dg[i] = dg[N + i] = dg[2 * N + i] = 0.0;
      for (int a = 2 * i; a < 2 * i + 2; ++a) {
        const double d = along(y, a), w = along(y + 2 * N, a);
        const double dd = along(dy, a), dw = along(dy + 2 * N, a);
        dg[i] += d * dd;
        dg[N + i] += d * dw + dd * w;
        dg[2 * N + i] += 2.0 * w * dw + dd * along(acc.data(), a) + d * along(dacc.data(), a);
      }
    }
  }
  void residual(const double* y, const double* yp, double* r) const {
    std::vector<double> acc(static_cast<std::size_t>(2 * N)),
        rates(static_cast<std::size_t>(3 * N));
    accelerations(y, acc.data());
    changes(y, yp, rates.data());
    for (int a = 0; a < 2 * N; ++a) {
      r[a] = yp[a] - y[2 * N + a];
      r[2 * N + a] = yp[2 * N + a] - acc[static_cast<std::size_t>(a)];
    }
    std::copy(rates.begin() + 2 * N, rates.end(), r + 4 * N);
  }
  void set_forces(std::vector<double>& y) const {
    double along_first = 0.0, square = 0.0;
    for (int a = 0; a < 2; ++a) {
      along_first += (a == 1 ? -kGravity : 0.0) * y[static_cast<std::size_t>(a)];
      square += y[static_cast<std::size_t>(a)] * y[static_cast<std::size_t>(a)];
    }
    // Every rod carries what is beyond it.
    for (int i = 0; i < N; ++i)
      y[static_cast<std::size_t>(4 * N + i)] = (N - i) * along_first / square;
  }

  int N;
  double rod_, spring_, fall_;
};

/// The same with two parallel rods at the end that share the last rod's force: their rows are the
/// same, and F determines the sum of the forces by these and their difference, 0, by itself.
class TwoForOne {
 public:
  TwoForOne(int masses, double rod, double spring) : N(masses), chain_(masses, rod, spring) {}

  Problem problem(double t_end) const {
    Problem p = chain_.problem(t_end);
    const Problem one = p;
    const int n = p.size++;
    for (std::vector<double>* start : {&p.y0, &p.yp0}) start->push_back(start->back());
    p.id.push_back(1.0);
    p.residual = [this, one, n](double t, const double* y, const double* yp, double* r) {
      one.residual(t, single(y).data(), single(yp).data(), r);
      r[n] = yp[n] - yp[n - 1];
    };
    p.jacobian = [this, one, n](double t, double cj, const double* y, const double* yp, double* J) {
      std::vector<double> inner(static_cast<std::size_t>(n) * static_cast<std::size_t>(n));
      one.jacobian(t, cj, single(y).data(), single(yp).data(), inner.data());
      for (int j = 0; j <= n; ++j) {
        const double* from = inner.data() + static_cast<std::ptrdiff_t>(std::min(j, n - 1)) * n;
        double* to = J + static_cast<std::ptrdiff_t>(j) * (n + 1);
        for (int i = 0; i < n; ++i) to[i] = (j < n - 1 ? 1.0 : 0.5) * from[i];
        to[n] = j < n - 1 ? 0.0 : j < n ? -cj : cj;
      }
    };
    return p;
  }

  /// Those of the chain, and the last rod's once more.
  tp::Constraints rows() const {
    const tp::Constraints one = chain_.rows();
    tp::Constraints set;
    set.count = one.count + 3;
    set.value = [this, one](double t, tp::ConstVector y, tp::Vector g) {
      const std::vector<double> inner = single(y.data());
      one.value(t, tp::ConstVector(inner.data(), 5 * N), tp::Vector(g.data(), one.count));
      for (int level = 0; level < 3; ++level) g[3 * N + level] = g[(level + 1) * N - 1];
    };
    set.jacobian = tp::DenseJacobian{[this, one](double t, tp::ConstVector y, tp::Matrix C) {
      const std::vector<double> inner = single(y.data());
      std::vector<double> entries(static_cast<std::size_t>(3 * N) *
                                  static_cast<std::size_t>(5 * N));
      tp::Matrix from(entries.data(), 3 * N, 5 * N);
      std::get<tp::DenseJacobian>(one.jacobian).fill(t, tp::ConstVector(inner.data(), 5 * N), from);
      C.topLeftCorner(3 * N, 5 * N) = from;
      C.block(0, 5 * N - 1, 3 * N, 1) *= 0.5;
      C.block(0, 5 * N, 3 * N, 1) = C.block(0, 5 * N - 1, 3 * N, 1);
      for (int level = 0; level < 3; ++level) C.row(3 * N + level) = C.row((level + 1) * N - 1);
    }};
    return set;
  }

 private:
  /// With the mean of both forces in place of one.
  std::vector<double> single(const double* y) const {
    std::vector<double> one(y, y + 5 * N);
    one.back() = 0.5 * (y[5 * N - 1] + y[5 * N]);
    return one;
  }

  int N;
  Chain chain_;
};

}  // namespace

TEST_CASE("rods in index 0: forces that answer to every move are no stiff component") {
  const Chain chain(60, 0.1, 1e6);
  const Problem problem = chain.problem(0.1);
  for (const double tolerance : {5e-4, 1.6e-4, 6e-5}) {
    INFO("tolerance " << tolerance);
    const Run run = integrate(problem, tolerance, chain.rows(), {}, false);
    const Run plain = integrate_plain(problem, tolerance);
    REQUIRE(run.flag >= 0);
    CHECK(static_cast<double>(run.steps) <= 1.2 * static_cast<double>(plain.steps));
  }
}

TEST_CASE("rods in index 0: all unknowns share what rows of forces ask for") {
  const Chain chain(60, 0.1, 1e6);
  const Problem problem = chain.problem(0.1);
  double mean = 0.0;
  for (const double tolerance : {1e-3, 4e-4, 3.25e-4}) {
    INFO("tolerance " << tolerance);
    const Run run = integrate(problem, tolerance, chain.rows(), {}, false);
    const Run plain = integrate_plain(problem, tolerance);
    REQUIRE(run.flag >= 0);
    mean += std::log(static_cast<double>(run.steps) / static_cast<double>(plain.steps)) / 3.0;
    CHECK(static_cast<double>(run.steps) <= 1.7 * static_cast<double>(plain.steps));
    // Forces are a million times as large.
    CHECK(run.statistics.largest_drift_after <= 1.3 * tolerance);
  }
  CHECK(std::exp(mean) <= 0.5);
}

TEST_CASE("rods in index 0: forces that their rows do not determine move together with the rest") {
  const TwoForOne chain(20, 0.1, 1e4);
  const Problem problem = chain.problem(0.3);
  for (const double tolerance : {1e-3, 1e-4, 1e-5}) {
    INFO("tolerance " << tolerance);
    const Run run = integrate(problem, tolerance, chain.rows(), {}, false);
    const Run plain = integrate_plain(problem, tolerance);
    REQUIRE(run.flag >= 0);
    CHECK(run.statistics.rank_drops >= 1);
    CHECK(static_cast<double>(run.steps) <= 1.2 * static_cast<double>(plain.steps));
    CHECK(run.statistics.largest_drift_after <= 1e-3 * tolerance);
  }
}

TEST_CASE("rods in index 0, level at rest: many dense rows, half of whose entries are zero there") {
  struct Case {
    double rod, tolerance;
  };
  // Masses beside the pin repair what all share at first.
  for (const Case& c : {Case{0.04, 1e-3}, Case{0.06, 3e-4}, Case{0.08, 1e-3}}) {
    INFO("rods of " << c.rod << ", tolerance " << c.tolerance);
    const Chain chain(100, c.rod, 0.0, 0.0);
    const Problem problem = chain.problem(0.1);
    const Run run = integrate(problem, c.tolerance, chain.rows(), {}, false);
    const Run plain = integrate_plain(problem, c.tolerance);
    REQUIRE(run.flag >= 0);
    CHECK(static_cast<double>(run.steps) <= 1.4 * static_cast<double>(plain.steps));
  }
}
