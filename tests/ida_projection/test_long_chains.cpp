// Tether: chains of hundreds of rods. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <ida/ida.h>
#include <sunlinsol/sunlinsol_band.h>
#include <sunmatrix/sunmatrix_band.h>

#include "host.hpp"
#include "support/catch.hpp"

using namespace tether::test;

namespace {

/// N point masses (1 kg) on rods from the origin, in a form of index 1 or 2 whose matrix is a band:
/// (x, y, vx, vy, the rod's force by length) of one mass after the other. Released at rest along
/// the x axis.
class LongChain {
 public:
  LongChain(int masses, double rod, int index = 1) : N(masses), rod_(rod), index_(index) {}

  Problem problem(double t_end) const {
    Problem p;
    p.name = "long chain";
    p.index = index_;
    p.size = kEach * N;
    p.t_end = t_end;
    p.y0.assign(static_cast<std::size_t>(p.size), 0.0);
    p.yp0 = p.y0;
    p.id.assign(p.y0.size(), 1.0);
    for (int i = 0; i < N; ++i) {
      p.y0[at(i, 0)] = (i + 1) * rod_;
      p.yp0[at(i, 3)] = -kGravity;
      p.id[at(i, 4)] = 0.0;
    }
    p.residual = [this](double, const double* y, const double* yp, double* r) {
      residual(y, yp, r);
    };
    return p;
  }

  tp::Constraints rows() const {
    tp::Constraints set;
    set.count = 2 * N;
    set.value = [this](double, tp::ConstVector y, tp::Vector g) {
      for (int i = 0; i < N; ++i) {
        g[i] = -0.5 * rod_ * rod_;
        g[N + i] = 0.0;
        for (int k = 0; k < 2; ++k) {
          const double d = along(y.data(), i, k);
          g[i] += 0.5 * d * d;
          g[N + i] += d * along(y.data(), i, 2 + k);
        }
      }
    };
    tp::SparseJacobian given;
    given.starts = {0};
    each_entry(nullptr, [&](int row, int column, double) {
      given.columns.push_back(column);
      given.starts.resize(static_cast<std::size_t>(row + 2));
      given.starts.back() = static_cast<int>(given.columns.size());
    });
    given.fill = [this](double, tp::ConstVector y, tp::Vector out) {
      int e = 0;
      each_entry(y.data(), [&](int, int, double entry) { out[e++] = entry; });
    };
    set.jacobian = std::move(given);
    return set;
  }

  /// Largest error of positions and velocities.
  double error(const double* y, const double* reference) const {
    double most = 0.0;
    for (int i = 0; i < N; ++i)
      for (int k = 0; k < 4; ++k)
        most = std::max(most, std::abs(y[at(i, k)] - reference[at(i, k)]) /
                                  (1.0 + std::abs(reference[at(i, k)])));
    return most;
  }

  static constexpr int kEach = 5;  // unknowns of a mass

 private:
  static constexpr double kGravity = 9.81;

  static std::size_t at(int mass, int k) { return static_cast<std::size_t>(kEach * mass + k); }
  static double along(const double* x, int i, int k) {
    return x[at(i, k)] - (i > 0 ? x[at(i - 1, k)] : 0.0);
  }

  /// add(row, column, entry), lengths first; y null: entries are 0.
  template <class Add>
  void each_entry(const double* y, Add add) const {
    for (int row = 0; row < 2 * N; ++row) {
      const int i = row % N, kinds = row < N ? 2 : 4;
      for (int end = i > 0 ? i - 1 : i; end <= i; ++end)
        for (int k = 0; k < kinds; ++k) {
          const int other = row < N ? k : k ^ 2;  // positions by velocities and the other way
          const double entry = y != nullptr ? along(y, i, other) : 0.0;
          add(row, static_cast<int>(at(end, k)), end < i ? -entry : entry);
        }
    }
  }

  void residual(const double* y, const double* yp, double* r) const {
    for (int i = 0; i < N; ++i) {
      double rate = 0.0, second = 0.0;  // derivatives of the rod's length
      for (int k = 0; k < 2; ++k) {
        const double d = along(y, i, k), w = along(y, i, 2 + k);
        double force = -d * y[at(i, 4)];
        if (i + 1 < N) force += along(y, i + 1, k) * y[at(i + 1, 4)];
        r[at(i, k)] = yp[at(i, k)] - y[at(i, 2 + k)];
        r[at(i, 2 + k)] = yp[at(i, 2 + k)] - force + (k == 1 ? kGravity : 0.0);
        rate += d * w;
        second += w * w + d * along(yp, i, 2 + k);
      }
      r[at(i, 4)] = index_ == 1 ? second : rate;
    }
  }

  int N;
  double rod_;
  int index_;
};

/// IDA on a chain, with a band matrix by IDA's differences.
class BandHost : public Host {
 public:
  BandHost(const LongChain& chain, const Problem& of_chain, double tolerance)
      : Host(of_chain, tolerance),
        matrix_(SUNBandMatrix(of_chain.size, kWidth, kWidth, context)),
        solver_(SUNLinSol_Band(y, matrix_, context)) {
    REQUIRE(IDASetLinearSolver(ida, solver_, matrix_) == 0);
    attach(chain.rows());
  }
  ~BandHost() {
    SUNLinSolFree(solver_);
    SUNMatDestroy(matrix_);
  }

 private:
  static constexpr int kWidth = 2 * LongChain::kEach - 1;
  SUNMatrix matrix_;
  SUNLinearSolver solver_;
};

std::vector<double> fall(const LongChain& chain, const Problem& problem, double tolerance) {
  BandHost host(chain, problem, tolerance);
  REQUIRE(host.finish() >= 0);
  return host.state();
}

}  // namespace

TEST_CASE("long chains: in a start velocities are not repaired by sliding positions along") {
  struct Case {
    int rods;
    double length;
  };
  double mean = 0.0;
  int runs = 0;
  for (const Case& c : {Case{200, 0.04}, Case{300, 0.03}, Case{300, 0.06}, Case{500, 0.06}}) {
    const LongChain chain(c.rods, c.length);
    const Problem problem = chain.problem(0.1);
    const std::vector<double> reference = fall(chain, problem, 1e-10);
    for (const double tolerance : {1e-4, 5e-5, 2e-5, 1e-5, 5e-6, 2e-6, 1e-6, 5e-7}) {
      const std::vector<double> y = fall(chain, problem, tolerance);
      mean += std::log(chain.error(y.data(), reference.data()) / tolerance);
      ++runs;
    }
  }
  // 107 with one scale for each level and nothing else.
  CHECK(std::exp(mean / runs) <= 85.0);
}

TEST_CASE("long chains in index 2: few error tests of a start fail by its multipliers") {
  for (const int rods : {100, 300})
    for (const double tolerance : {1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6}) {
      INFO(rods << " rods, tolerance " << tolerance);
      const LongChain chain(rods, 0.05, 2);
      BandHost host(chain, chain.problem(0.1), tolerance);
      int low = 0;
      while (host.steps() < 16) {
        REQUIRE(host.step() >= 0);
        int order = 0;
        IDAGetLastOrder(host.ida, &order);
        low += order == 1 ? 1 : 0;
      }
      long failures = 0;
      IDAGetNumErrTestFails(host.ida, &failures);
      // IDA raises the order only after k + 2 steps of one size from then on.
      CHECK(failures <= 3);
      CHECK(low <= 16);
    }
}
