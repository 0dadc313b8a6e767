// Tether: proofs of exact solutions. Oracles: problems of whole numbers whose solution is known
// exactly, and rational arithmetic. SPDX-License-Identifier: BSD-3-Clause
#include <boost/multiprecision/cpp_bin_float.hpp>
#include <boost/multiprecision/cpp_int.hpp>
#include <cfenv>
#include <cmath>
#ifdef __SSE2__
#include <xmmintrin.h>
#endif
#include <tether/contact.hpp>

#include "assemblies.hpp"
#include "packing.hpp"
#include "proof/regime_equations.hpp"
#include "support/catch.hpp"

using namespace tether::contact;
using detail::at;
using detail::Interval;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

using Exact = boost::multiprecision::cpp_rational;

bool contains(Interval interval, const Exact& x) {
  return (std::isinf(interval.lo) || Exact(interval.lo) <= x) &&
         (std::isinf(interval.hi) || x <= Exact(interval.hi));
}

// A number of any size and sign; often 0, a power of two or next to one.
double anything(random::Generator& g, int exponent) {
  const double x = std::ldexp(g.uniform(-1, 1), static_cast<int>(g.uniform(-exponent, exponent)));
  const double kind = g.uniform(0, 10);
  if (kind < 1) return 0;
  if (kind < 2) return std::copysign(std::ldexp(1.0, std::ilogb(x)), x);
  if (kind < 3) return std::nextafter(std::ldexp(1.0, std::ilogb(x)), 0);
  return x;
}

// Whole numbers that solve Coulomb's law exactly: b = A x - w, every contact in a chosen regime.
struct Known {
  Problem problem;
  VectorXd x;
  std::vector<Regime> regimes;
};

// At mu = 1/2, x = (10 k, 6 k, 8 k) / 2 lies on the cone.
Known known(random::Generator& g, int contacts) {
  const auto whole = [&g](int lo, int hi) { return std::floor(g.uniform(lo, hi + 1)); };
  const int rows = 3 * contacts;
  MatrixXd J(rows, rows);
  for (double& entry : J.reshaped()) entry = whole(-2, 2);
  const MatrixXd A = J * J.transpose() + 4 * rows * MatrixXd::Identity(rows, rows);
  Known out{{}, VectorXd::Zero(rows), {}};
  VectorXd w = VectorXd::Zero(rows);
  for (int i = 0; i < contacts; ++i) {
    const auto regime = static_cast<Regime>(static_cast<int>(whole(0, 2)));
    const double k = whole(1, 9), s = whole(1, 9);
    out.regimes.push_back(regime);
    if (regime == Regime::separating) w.segment(3 * i, 3) << k, whole(-9, 9), whole(-9, 9);
    if (regime == Regime::sticking) out.x.segment(3 * i, 3) << 4 * k, whole(-1, 1), whole(-1, 1);
    if (regime == Regime::sliding) {
      out.x.segment(3 * i, 3) << 10 * k, 3 * k, -4 * k;
      w.segment(3 * i, 3) << 0, -3 * s, 4 * s;
    }
  }
  out.problem = Problem::dense(A, A * out.x - w, VectorXd::Constant(contacts, 0.5));
  return out;
}

// The exact solution of the equations of the regimes that Newton's method reaches from x, in
// ninety digits; nothing is shared with the library. Empty: none is reached.
using Digits = boost::multiprecision::number<boost::multiprecision::cpp_bin_float<90>>;
using Column = std::vector<Digits>;

Column residual(const detail::ProofIsland& island, const std::vector<Regime>& regimes,
                const Column& x) {
  const std::size_t rows = x.size();
  Column w(rows), F = x;  // separating: x = 0
  for (std::size_t r = 0; r < rows; ++r) {
    w[r] = -island.b[static_cast<int>(r)];
    for (std::size_t c = 0; c < rows; ++c)
      w[r] += Digits(island.A(static_cast<int>(r), static_cast<int>(c))) * x[c];
  }
  for (std::size_t i = 0; i < rows; i += 3) {
    const Regime regime = regimes[i / 3];
    const Digits limit = Digits(island.mu[static_cast<int>(i / 3)]) * x[i];
    if (regime != Regime::separating)
      for (std::size_t r = i; r < i + 3; ++r) F[r] = w[r];
    if (regime != Regime::sliding) continue;
    F[i + 1] = x[i + 1] * w[i + 2] - x[i + 2] * w[i + 1];
    F[i + 2] = x[i + 1] * x[i + 1] + x[i + 2] * x[i + 2] - limit * limit;
  }
  return F;
}

// Gauss with column pivoting; M has its right side as last column.
Column eliminated(std::vector<Column> M) {
  const std::size_t n = M.size();
  for (std::size_t k = 0; k < n; ++k) {
    for (std::size_t r = k + 1; r < n; ++r)
      if (abs(M[r][k]) > abs(M[k][k])) std::swap(M[r], M[k]);
    for (std::size_t r = 0; r < n; ++r) {
      if (r == k || M[r][k] == 0) continue;
      const Digits factor = M[r][k] / M[k][k];
      for (std::size_t c = k; c <= n; ++c) M[r][c] -= factor * M[k][c];
    }
  }
  Column out(n);
  for (std::size_t k = 0; k < n; ++k) out[k] = M[k][n] / M[k][k];
  return out;
}

Column exact_root(const detail::ProofIsland& island, const std::vector<Regime>& regimes,
                  const VectorXd& from) {
  Column x(from.begin(), from.end());
  const Digits h("1e-45");  // F is quadratic: differences have an error of the order of h
  for (int k = 0; k < 40; ++k) {
    const Column F = residual(island, regimes, x);
    std::vector<Column> M(x.size(), Column(x.size() + 1));
    for (std::size_t c = 0; c < x.size(); ++c) {
      Column moved = x;
      moved[c] += h;
      moved = residual(island, regimes, moved);
      for (std::size_t r = 0; r < x.size(); ++r) M[r][c] = (moved[r] - F[r]) / h;
    }
    for (std::size_t r = 0; r < x.size(); ++r) M[r][x.size()] = F[r];
    const Column step = eliminated(M);
    Digits size = 0;
    for (std::size_t r = 0; r < x.size(); ++r) {
      x[r] -= step[r];
      size = std::max(size, Digits(abs(step[r])));
    }
    if (size < Digits("1e-60")) return x;
  }
  return {};
}

// Whether the box has the exact root that is next to its middle.
bool holds_root(const detail::ProofIsland& island, const std::vector<Regime>& regimes,
                const detail::Box& box) {
  const Column root = exact_root(island, regimes, box.x);
  for (std::size_t r = 0; r < root.size(); ++r) {
    const int row = static_cast<int>(r);
    if (abs(root[r] - Digits(box.x[row])) > Digits(box.radius[row]) + Digits("1e-60")) return false;
  }
  return !root.empty();
}

double distance(const VectorXd& x, const VectorXd& y) {
  double out = 0;
  for (int i = 0; i < x.size(); i += 3) out = std::max(out, (x - y).segment(i, 3).norm());
  return out;
}

Solution solved(const Problem& problem, double tolerance) {
  Options o;
  o.law = Law::coulomb;
  o.tolerance = tolerance;
  return Solver(o).solve(problem);
}

// One contact without coupling, mu = 1/2.
Problem one(double bn, double b1, double b2) {
  return Problem::dense(MatrixXd::Identity(3, 3), Eigen::Vector3d(bn, b1, b2),
                        VectorXd::Constant(1, 0.5));
}

}  // namespace

TEST_CASE("intervals contain exact results") {
  random::Generator g(1);
  for (int exponent : {2, 60, 500, 1070}) {
    for (int k = 0; k < 2000; ++k) {
      const double a = anything(g, exponent), b = anything(g, exponent), c = anything(g, exponent);
      if (!std::isfinite(a) || !std::isfinite(b) || !std::isfinite(c)) continue;
      const Exact x(a), y(b), z(c);
      INFO(a << " " << b << " " << c);
      CHECK(contains(Interval(a) + b, x + y));
      CHECK(contains(Interval(a) - b, x - y));
      CHECK(contains(Interval(a) * b, x * y));
      CHECK(contains((Interval(a) + b) * c, (x + y) * z));
      CHECK(contains((Interval(a) - b) * (Interval(c) - a), (x - y) * (z - x)));
      CHECK(contains(square(Interval(a) + b), (x + y) * (x + y)));
      if (b > 0) CHECK(contains((Interval(a) * c) / b, x * z / y));
      const Interval r = root(square(Interval(a)));  // |a|
      CHECK((r.lo <= std::abs(a) && std::abs(a) <= r.hi));
    }
  }
}

TEST_CASE("intervals: what is no number is any number") {
  const double huge = 1e300, none = std::nan("");
  for (const Interval& any : {Interval(huge) * huge - Interval(huge) * huge,
                              Interval(1) / Interval(-1, 1), Interval::around(none, 1),
                              Interval::around(1, none), Interval::around(0, detail::kInfinity)})
    CHECK((any.lo <= -huge && any.hi >= huge));
}

TEST_CASE("long sums contain the exact sum, also of terms that cancel") {
  random::Generator g(2);
  for (int exponent : {1, 30, 400}) {
    for (int k = 0; k < 300; ++k) {
      detail::LongSum sum;
      Exact exact = 0, size = 0;
      const auto add = [&](double a, double x) {
        sum.add(a, x);
        exact += Exact(a) * Exact(x);
        size += abs(Exact(a) * Exact(x));
      };
      const int terms = 1 + static_cast<int>(g.uniform(0, 60));
      for (int t = 0; t < terms; ++t) {
        const double a = anything(g, exponent), x = anything(g, exponent);
        add(a, x);
        if (t % 3 == 0) add(-a, std::nextafter(x, 1));
      }
      const Interval value = sum.value();
      INFO(value.lo << " " << value.hi);
      CHECK(contains(value, exact));
      CHECK(Exact(sum.size()) >= size);
      const double width = value.hi - value.lo;
      CHECK(width <= 1e-15 * std::abs(value.middle()) + 1e-25 * sum.size() + 1e-300);
    }
  }
}

TEST_CASE("one contact with a known solution, in each regime") {
  struct Case {
    Problem problem;
    Eigen::Vector3d x;
    Regime regime;
  };
  for (const Case& c : {Case{one(-1, 2, 3), {0, 0, 0}, Regime::separating},
                        Case{one(4, 1, -1), {4, 1, -1}, Regime::sticking},
                        Case{one(10, 6, 8), {10, 3, 4}, Regime::sliding}}) {
    for (double error : {0.0, 1e-9, 1e-3, 0.4}) {
      const Eigen::Vector3d given = c.x + error * Eigen::Vector3d(1, -1, 1) / std::sqrt(3.0);
      const Proof p = prove(c.problem, given, 0);
      INFO(name(c.regime) << ", " << error << ": " << p.reason);
      CHECK(p.status == ProofStatus::proven);
      CHECK(p.regimes == std::vector<Regime>{c.regime});
      CHECK(p.radius >= (given - c.x).norm() * (1 - 1e-15));
      CHECK(p.radius <= (given - c.x).norm() + 1e-14);
      CHECK(p.contact == -1);
      CHECK(p.change == 0);
    }
  }
}

TEST_CASE("one contact in the plane and one without friction") {
  const Problem plane =
      Problem::dense(MatrixXd::Identity(2, 2), Eigen::Vector2d(10, -8), VectorXd::Constant(1, 0.5));
  const Proof slides = prove(plane, Eigen::Vector2d(10.25, -5));
  CHECK(slides.status == ProofStatus::proven);
  CHECK(slides.radius == Approx(0.25).epsilon(1e-12));
  const Problem smooth =
      Problem::dense(MatrixXd::Identity(3, 3), Eigen::Vector3d(10, 1, 1), VectorXd::Zero(1));
  const Proof p = prove(smooth, Eigen::Vector3d(10, 0.5, 0));
  CHECK(p.status == ProofStatus::proven);
  CHECK(p.radius == Approx(0.5).epsilon(1e-12));
}

TEST_CASE("known solutions of coupled contacts lie within the radius") {
  random::Generator g(3);
  int proven = 0;
  for (int k = 0; k < 300; ++k) {
    const Known problem = known(g, 1 + k % 12);
    for (double error : {0.0, 1e-10, 1e-6, 1e-3}) {
      VectorXd given = problem.x;
      for (double& x : given) x += error * g.normal();
      const Proof p = prove(problem.problem, given, 0);
      INFO(k << ", " << error << ": " << p.reason << ", contact " << p.contact);
      CHECK(p.status == ProofStatus::proven);
      CHECK(p.regimes == problem.regimes);
      CHECK(p.radius >= distance(given, problem.x) * (1 - 1e-15));
      CHECK(p.radius <= distance(given, problem.x) + 1e-12);
      proven += p.status == ProofStatus::proven ? 1 : 0;
    }
  }
  CHECK(proven == 1200);
}

TEST_CASE("wrong impulses get a radius that reaches the solution") {
  random::Generator g(4);
  for (int k = 0; k < 200; ++k) {
    const Known problem = known(g, 2 + k % 6);
    VectorXd given = problem.x;  // one contact in another regime, or all of it invented
    const int i = k % static_cast<int>(problem.regimes.size());
    if (problem.regimes[at(i)] == Regime::separating)
      given.segment(3 * i, 3) << 5, 0.1, 0.1;
    else
      given.segment(3 * i, 3).setZero();
    if (k % 5 == 0)
      for (double& x : given) x = 10 * g.normal();
    const Proof p = prove(problem.problem, given);
    INFO(k << ": " << p.reason);
    REQUIRE(p.status != ProofStatus::not_proven);
    CHECK(p.radius >= distance(given, problem.x) * (1 - 1e-15));
  }
}

TEST_CASE("a candidate with a wrong regime is not proven") {
  random::Generator g(5);
  int refused = 0, roots = 0;
  for (int k = 0; k < 200; ++k) {
    const Known problem = known(g, 2 + k % 6);
    const detail::ProofIsland island = detail::proof_island(problem.problem, problem.x);
    detail::Candidate candidate{island.x, problem.regimes};
    Regime& regime = candidate.regimes[at(k % static_cast<int>(problem.regimes.size()))];
    regime = static_cast<Regime>((static_cast<int>(regime) + 1 + k % 2) % 3);
    const std::optional<detail::Box> box = detail::enclose_root(island, candidate);
    roots += box ? 1 : 0;
    if (!box || detail::first_doubt(island, candidate.regimes, *box) >= 0) ++refused;
    if (regime != Regime::separating) continue;
    const detail::NearbySolution near = detail::nearby_solution(island, candidate);
    CHECK(near.change.maxCoeff() > 1e-3);
    for (int r = 0; r < island.x.size(); r += 3) {  // b has to change by all of a w_n < 0
      if (candidate.regimes[at(r / 3)] != Regime::separating) continue;
      Exact w = -Exact(island.b[r]);
      for (int c = 0; c < island.x.size(); ++c) w += Exact(island.A(r, c)) * Exact(near.box.x[c]);
      if (near.box.radius.isZero(0)) CHECK(Exact(near.change[r]) >= -w);
    }
  }
  CHECK(refused == 200);
  CHECK(roots >= 50);  // the inequalities refuse these
}

TEST_CASE("the box holds the root from far candidates, or there is none") {
  random::Generator g(6);
  int boxes = 0;
  for (int k = 0; k < 100; ++k) {
    const Known problem = known(g, 1 + k % 8);
    const detail::ProofIsland island = detail::proof_island(problem.problem, problem.x);
    for (double error : {1e-12, 1e-8, 1e-4, 1e-2, 1e-1}) {
      detail::Candidate candidate{island.x, problem.regimes};
      for (double& x : candidate.x) x += error * g.normal();
      const std::optional<detail::Box> box = detail::enclose_root(island, candidate);
      if (!box) continue;
      ++boxes;
      for (int r = 0; r < island.x.size(); ++r) {
        INFO(k << ", " << error << ", row " << r << ": " << box->radius[r]);
        CHECK(std::abs(box->x[r] - island.x[r]) <= box->radius[r] * (1 + 1e-15));
      }
    }
  }
  CHECK(boxes >= 300);
}

TEST_CASE("what is proven meets the law in ninety digits, within the radius") {
  random::Generator g(16);
  int proven = 0;
  const Digits none("1e-50");  // what rounding of the oracle leaves
  for (int k = 0; k < 200; ++k) {
    const double mu = std::pow(10, g.uniform(-1.5, 0.5));
    const Problem p = random::cluster(g, mu, 3, 2 + k % 4).problem();
    const VectorXd given = solved(p, k % 2 == 0 ? 1e-9 : 1e-5).impulses;
    const Proof proof = prove(p, given, 0);
    if (proof.status != ProofStatus::proven) continue;
    ++proven;
    const detail::ProofIsland island = detail::proof_island(p, given);
    const Column x = exact_root(island, proof.regimes, island.x);
    REQUIRE(!x.empty());
    const std::vector<Regime> sticking(at(p.contacts()), Regime::sticking);
    const Column w = residual(island, sticking, x);
    INFO(k << ", mu " << mu);
    for (int i = 0; i < p.contacts(); ++i) {
      const Digits *xi = &x[at(3 * i)], *wi = &w[at(3 * i)];
      const Digits length = sqrt(xi[1] * xi[1] + xi[2] * xi[2]), limit = Digits(mu) * xi[0];
      const Digits slip = sqrt(wi[1] * wi[1] + wi[2] * wi[2]);
      CHECK(xi[0] >= -none);
      CHECK(wi[0] >= -none);
      CHECK(abs(xi[0] * wi[0]) <= none);
      CHECK(length <= limit + none);
      if (xi[0] > none) {  // dissipation mu x_n |w_t|, nothing else
        CHECK(abs(xi[1] * wi[1] + xi[2] * wi[2] + limit * slip) <= none);
      }
      Digits squares = 0;
      for (int r = 3 * i; r < 3 * i + 3; ++r)
        squares += (x[at(r)] - Digits(island.x[r])) * (x[at(r)] - Digits(island.x[r]));
      CHECK(sqrt(squares) <= Digits(std::ldexp(proof.radius, -island.impulse[at(i)])) + none);
    }
  }
  CHECK(proven >= 150);
}

TEST_CASE("boxes hold the root in ninety digits, near and far from it") {
  random::Generator g(13);
  int boxes = 0, none = 0;
  for (int k = 0; k < 60; ++k) {
    const Problem p = random::cluster(g, 0.5, 3, 4).problem();
    const detail::Candidate good = detail::polish(detail::proof_island(p, VectorXd::Zero(12)));
    for (double error : {0.0, 1e-8, 1e-3, 1e-1, 1.0}) {
      detail::ProofIsland island = detail::proof_island(p, good.x);
      detail::Candidate candidate = detail::polish(island);
      for (double& x : candidate.x) x += error * g.normal();
      if (k % 2 == 0)  // regimes that nobody has checked
        for (Regime& regime : candidate.regimes)
          regime = static_cast<Regime>(static_cast<int>(g.uniform(0, 3)));
      const std::optional<detail::Box> box = detail::enclose_root(island, candidate);
      ++(box ? boxes : none);
      INFO(k << ", " << error);
      if (box) CHECK(holds_root(island, candidate.regimes, *box));
    }
  }
  CHECK(boxes >= 100);
  CHECK(none >= 50);
}

TEST_CASE("boxes hold the known root of ill-conditioned systems") {
  random::Generator g(14);
  int boxes = 0, none = 0;
  for (int k = 0; k < 600; ++k) {
    const int rows = 3 * (2 + k % 12);
    MatrixXd L = MatrixXd::Identity(rows, rows);  // of whole numbers, as A and its inverse
    for (int r = 0; r < rows; ++r)
      for (int c = 0; c < r; ++c) L(r, c) = std::floor(g.uniform(-2, 3));
    VectorXd x(rows);
    for (double& v : x) v = std::floor(g.uniform(-99, 100));
    const MatrixXd A = L * L.transpose();
    const Problem p = Problem::dense(A, A * x, VectorXd::Ones(rows / 3));
    const detail::ProofIsland island = detail::proof_island(p, x);
    detail::Candidate candidate{island.x, {}};
    candidate.regimes.assign(at(rows / 3), Regime::sticking);
    for (double& v : candidate.x) v += 1e-9 * g.normal();
    const std::optional<detail::Box> box = detail::enclose_root(island, candidate);
    ++(box ? boxes : none);
    if (!box) continue;
    INFO(k << ", " << rows << " rows");
    for (int r = 0; r < rows; ++r)
      CHECK(abs(Exact(box->x[r]) - Exact(island.x[r])) <= Exact(box->radius[r]));
  }
  CHECK(boxes >= 300);
  CHECK(none >= 50);
}

TEST_CASE("inequalities have to hold in the whole box") {
  MatrixXd A = MatrixXd::Identity(6, 6);
  A(0, 3) = A(3, 0) = 0.5;
  VectorXd b(6);
  b << 4, 1, 1, 1, 0, 0;  // w_n = 0.5 x_0 - 1 of the second contact
  const Problem p = Problem::dense(A, b, VectorXd::Constant(2, 0.5));
  VectorXd x = VectorXd::Zero(6);
  x.head(3) << 4, 1, 1;
  const detail::ProofIsland island = detail::proof_island(p, x);
  const double unit = island.x[0] / 4;
  const std::vector<Regime> regimes = {Regime::sticking, Regime::separating};
  const auto doubt = [&](int row, double radius) {
    VectorXd rho = VectorXd::Zero(6);
    rho[row] = radius * unit;
    return detail::first_doubt(island, regimes, {island.x, rho});
  };
  CHECK(doubt(0, 0) == -1);
  CHECK(doubt(0, 1.2) == 0);   // x_n < |x_t| / mu
  CHECK(doubt(1, 0.7) == -1);  // |x_t| <= sqrt(1.7^2 + 1) < 2
  CHECK(doubt(1, 0.8) == 0);
  VectorXd rho = VectorXd::Zero(6);
  rho[0] = 2.1 * unit;  // w_n of the second contact may be negative
  const std::vector<Regime> loose = {Regime::sliding, Regime::separating};
  const Problem slides =
      Problem::dense(A, (VectorXd(6) << 4, 3, 0, 1, 0, 0).finished(), VectorXd::Constant(2, 0.5));
  x.head(3) << 4, 2, 0;
  const detail::ProofIsland other = detail::proof_island(slides, x);
  CHECK(detail::first_doubt(other, loose, {other.x, VectorXd::Zero(6)}) == -1);
  CHECK(detail::first_doubt(other, loose, {other.x, rho}) == 1);
  rho[0] = 4.1 * unit;  // the opposite cone
  CHECK(detail::first_doubt(other, loose, {other.x, rho}) == 0);
}

TEST_CASE("nearby solutions: the change covers what the law misses, exactly") {
  random::Generator g(15);
  int regimes[3] = {0, 0, 0};
  for (int k = 0; k < 2000; ++k) {
    const Eigen::Vector3d x(std::abs(g.normal()), 0.4 * g.normal(), 0.4 * g.normal()),
        b = g.rotation() * x;
    const Problem p = Problem::dense(MatrixXd::Identity(3, 3), b, VectorXd::Constant(1, 0.7));
    const detail::ProofIsland island = detail::proof_island(p, x);
    detail::Candidate candidate{island.x, {static_cast<Regime>(k % 3)}};
    if (k % 2 == 0) {  // on the cone to the last digit, or not quite
      const double t = candidate.x.tail(2).norm();
      candidate.x.tail(2) *= 0.7 * candidate.x[0] / t;
    }
    const detail::NearbySolution near = detail::nearby_solution(island, candidate);
    ++regimes[static_cast<int>(near.regimes[0])];
    const Exact n(near.box.x[0]), limit = Exact(0.7) * n;
    const Exact squares = Exact(candidate.x[1]) * Exact(candidate.x[1]) +
                          Exact(candidate.x[2]) * Exact(candidate.x[2]);
    const Exact w = n - Exact(island.b[0]);
    INFO(k << ", " << name(near.regimes[0]));
    if (near.regimes[0] == Regime::separating) {
      CHECK(near.box.x.isZero(0));
      CHECK(Exact(near.change[0]) >= -w);
      continue;
    }
    CHECK(Exact(near.change[0]) >= abs(w));
    if (near.regimes[0] == Regime::sticking) CHECK(squares <= limit * limit);
    if (near.regimes[0] != Regime::sliding) continue;
    for (int r = 1; r < 3; ++r) {  // (x_t mu x_n / |x_t|)^2 is rational
      const Exact t(candidate.x[r]), wanted = limit * limit * t * t / squares;
      const Interval square_of = square(near.box[r]);
      CHECK(contains(square_of, wanted));
      const Exact inner = abs(Exact(near.box.x[r])) - Exact(near.box.radius[r]);
      const Exact outer = abs(Exact(near.box.x[r])) + Exact(near.box.radius[r]);
      CHECK((inner < 0 || inner * inner <= wanted));
      CHECK(outer * outer >= wanted);
    }
  }
  for (int count : regimes) CHECK(count >= 150);
}

TEST_CASE("remainder of the quadratic equations, against rational arithmetic") {
  random::Generator g(7);
  for (int k = 0; k < 100; ++k) {
    const Known problem = known(g, 2);
    const detail::ProofIsland island = detail::proof_island(problem.problem, problem.x);
    const std::vector<Regime> slide(2, Regime::sliding);
    VectorXd x(6), rho(6);
    for (double& v : x) v = g.normal();
    for (double& v : rho) v = std::ldexp(g.uniform(0, 1), -static_cast<int>(g.uniform(0, 50)));
    const detail::RegimeEquations F(island, slide, x);
    const VectorXd rest = F.remainder(rho, island.A.cwiseAbs() * rho * (1 + 1e-14));
    VectorXd e(6);
    for (int r = 0; r < 6; ++r)
      e[r] = rho[r] * (k % 3 == 0 ? g.uniform(-1, 1) : g.normal() < 0 ? -1 : 1);
    std::vector<Exact> at_x, moved;  // F by its definition
    for (auto* values : {&at_x, &moved}) {
      std::vector<Exact> y(6), w(6);
      for (int r = 0; r < 6; ++r)
        y[at(r)] = Exact(x[r]) + (values == &moved ? Exact(e[r]) : Exact(0));
      for (int r = 0; r < 6; ++r) {
        w[at(r)] = -Exact(island.b[r]);
        for (int c = 0; c < 6; ++c) w[at(r)] += Exact(island.A(r, c)) * y[at(c)];
      }
      for (std::size_t i = 0; i < 6; i += 3) {
        const Exact c(1 / std::hypot(x[static_cast<int>(i) + 1], x[static_cast<int>(i) + 2]));
        values->push_back(w[i]);
        values->push_back(c * (y[i + 1] * w[i + 2] - y[i + 2] * w[i + 1]));
        values->push_back(c / 2 * (y[i + 1] * y[i + 1] + y[i + 2] * y[i + 2] - y[i] * y[i] / 4));
      }
    }
    for (int r = 0; r < 6; ++r) {
      Exact linear = 0;
      for (int c = 0; c < 6; ++c) linear += Exact(F.J()(r, c)) * Exact(e[c]);
      const Exact left = abs(moved[at(r)] - at_x[at(r)] - linear);
      INFO(k << ", row " << r << ": " << static_cast<double>(left) << " of " << rest[r]);
      CHECK(left <= Exact(rest[r]));
      CHECK(abs(at_x[at(r)] - Exact(F.middle()[r])) <= Exact(F.radius()[r]));
    }
  }
}

TEST_CASE("at the brink of two regimes another b is named, or nothing is proven") {
  MatrixXd A = MatrixXd::Identity(6, 6);
  A(0, 3) = A(3, 0) = 0.5;  // the second contact touches without impulse, w = 0
  VectorXd b(6), x = VectorXd::Zero(6);
  b << 4, 1, 1, 2, 0, 0;
  x.head(3) << 4, 1, 1;
  const Problem touches = Problem::dense(A, b, VectorXd::Constant(2, 0.5));
  const Problem on_the_cone = one(10, 3, 4);
  for (const auto& [problem, at_brink] : {std::pair(touches, 1), std::pair(on_the_cone, 0)}) {
    const VectorXd given = at_brink == 1 ? x : VectorXd(on_the_cone.b());
    const Proof p = prove(problem, given);
    INFO(p.reason);
    CHECK(p.status == ProofStatus::proven_nearby);
    CHECK(p.change <= 1e-14);
    CHECK(p.contact == at_brink);
    CHECK(prove(problem, given, 0).status == ProofStatus::not_proven);
  }
}

TEST_CASE("without impulses w = -b is exact, and so is a grazing contact") {
  for (const Problem& p : {one(0, 0, 0), one(0, 1, 0)}) {
    const Proof q = prove(p, VectorXd::Zero(3), 0);
    CHECK(q.status == ProofStatus::proven);
    CHECK(q.radius == 0);
    CHECK(q.relative_radius == 0);
  }
}

TEST_CASE("a box on four corners sticks by impulses that are not unique") {
  const Problem p = random::stack(1, 1).problem();
  const Solution s = solved(p, 1e-9);
  const Proof near = prove(p, s.impulses);
  INFO(near.reason);
  REQUIRE(near.status == ProofStatus::proven_nearby);
  CHECK(near.relative_change <= 1e-14);
  CHECK(near.relative_radius <= 1e-8);
  CHECK(prove(p, s.impulses, 0).status == ProofStatus::not_proven);
  // The change covers the exact residual of the point, which sticks.
  const detail::ProofIsland island = detail::proof_island(p, s.impulses);
  const detail::NearbySolution point = detail::nearby_solution(island, detail::polish(island));
  REQUIRE(point.box.radius.isZero(0));
  for (int r = 0; r < island.b.size(); ++r) {
    Exact w = -Exact(island.b[r]);
    for (int c = 0; c < island.b.size(); ++c) w += Exact(island.A(r, c)) * Exact(point.box.x[c]);
    CHECK(abs(w) <= Exact(point.change[r]));
  }
}

TEST_CASE("a problem without solution is not proven") {
  MatrixXd A = MatrixXd::Identity(6, 6);
  A(0, 3) = A(3, 0) = -1;  // a body is driven into two walls
  VectorXd b = VectorXd::Zero(6);
  b[0] = b[3] = 1;
  const Problem p = Problem::dense(A, b, VectorXd::Constant(2, 0.5));
  REQUIRE(solved(p, 1e-9).status == Status::infeasible);
  random::Generator g(8);
  for (double size : {0.0, 1.0, 1e3, 1e8}) {
    VectorXd x(6);
    for (double& v : x) v = size * g.normal();
    const Proof q = prove(p, x);
    INFO(size);
    CHECK(q.status == ProofStatus::not_proven);
    CHECK(q.radius == detail::kInfinity);
    CHECK((q.contact >= 0 && !q.reason.empty()));
  }
}

TEST_CASE("impulses that are no numbers, and wrong arguments") {
  const Problem p = one(4, 1, -1);
  for (double bad : {std::nan(""), detail::kInfinity, -detail::kInfinity}) {
    const Proof q = prove(p, Eigen::Vector3d(4, bad, -1));
    CHECK(q.status == ProofStatus::not_proven);
    CHECK(q.contact == 0);
  }
  CHECK_THROWS_WITH(prove(p, VectorXd::Zero(2)), Catch::Contains("impulses has 2 entries"));
  for (double bad : {-1.0, std::nan(""), detail::kInfinity})
    CHECK_THROWS_AS(prove(p, VectorXd::Zero(3), bad), std::invalid_argument);
  CHECK(prove(Problem(), VectorXd()).status == ProofStatus::proven);
}

TEST_CASE("numbers beyond doubles are not proven, and units do not matter") {
  random::Generator g(9);
  const Known k = known(g, 3);
  const MatrixXd A = k.problem.dense_matrix();
  const VectorXd mu = VectorXd::Constant(3, 0.5);
  for (double mass : {0x1p-300, 0x1p-60, 0x1p40, 0x1p300}) {
    const Problem p = Problem::dense(A * mass, k.problem.b(), mu);
    const Proof q = prove(p, k.x / mass, 0);
    INFO(mass << ": " << q.reason);
    CHECK(q.status == ProofStatus::proven);
    CHECK(q.relative_radius < 1e-12);
  }
  MatrixXd far = A;
  far(0, 8) = far(8, 0) = 5e-324;
  CHECK(prove(Problem::dense(far, k.problem.b(), mu), k.x).status == ProofStatus::not_proven);
}

TEST_CASE("bounds are finite numbers, or there is no proof") {
  const Problem p = one(4, 1, -1);
  const Proof far = prove(p, Eigen::Vector3d(1e200, 1, 1));
  CHECK(far.status == ProofStatus::proven);
  CHECK((far.radius >= 1e200 && far.radius <= 1.01e200));
  const Proof beyond = prove(p, VectorXd::Constant(3, 1.7e308));
  CHECK(beyond.status == ProofStatus::not_proven);
  CHECK(beyond.relative_radius == detail::kInfinity);
  CHECK_THAT(beyond.reason, Catch::Contains("|x| times about sqrt(A_nn) = inf"));
  // A solution of 1e450 N s.
  const MatrixXd A = 1e-300 * MatrixXd::Identity(3, 3);
  const Problem large = Problem::dense(A, Eigen::Vector3d(1e150, 0, 0), VectorXd::Ones(1));
  CHECK(prove(large, VectorXd::Zero(3)).status == ProofStatus::not_proven);
}

TEST_CASE("the contact whose numbers leave the range is named") {
  MatrixXd A = MatrixXd::Identity(6, 6);
  A(0, 3) = A(3, 0) = 0.5;
  A(5, 4) = 5e-324;
  VectorXd b = VectorXd::Ones(6);
  const Proof q = prove(Problem::dense(A, 3 * b, VectorXd::Ones(2)), 5 * b);
  CHECK(q.status == ProofStatus::proven);
  A.bottomRightCorner(3, 3) *= 1e4;
  A(5, 4) = 5e-324;
  const Proof none = prove(Problem::dense(A, 3 * b, VectorXd::Ones(2)), 5 * b);
  CHECK(none.contact == 1);
  CHECK_THAT(none.reason, Catch::Contains("A = 4.9"));
}

TEST_CASE("velocities over a box without bounds are anything") {
  const detail::ProofIsland island =
      detail::proof_island(one(4, 1, -1), Eigen::Vector3d(1, 0, 0));  // A is diagonal
  const detail::Velocities v(island, {VectorXd::Ones(3), Eigen::Vector3d(detail::kInfinity, 1, 1)});
  for (const Interval& w : v.w) CHECK(w.hi - w.lo >= 2);
}

TEST_CASE("nothing is proven in other arithmetic") {
  const Problem p = one(4, 1, -1);
  const int before = std::fegetround();
  for (int mode : {FE_UPWARD, FE_DOWNWARD, FE_TOWARDZERO}) {
    std::fesetround(mode);
    const Proof q = prove(p, Eigen::Vector3d(4, 1, -1));
    std::fesetround(before);
    CHECK(q.status == ProofStatus::not_proven);
  }
#ifdef __SSE2__
  const unsigned control = _mm_getcsr();
  for (unsigned flush : {0x8000u, 0x0040u}) {  // results, operands
    _mm_setcsr(control | flush);
    const Proof q = prove(p, Eigen::Vector3d(4, 1, -1));
    _mm_setcsr(control);
    CHECK(q.status == ProofStatus::not_proven);
  }
#endif
}

TEST_CASE("islands are proven one by one, the weakest counts") {
  MatrixXd A = MatrixXd::Identity(9, 9);
  VectorXd b(9);
  b << 4, 1, -1, 10, 3, 4, 10, 6, 8;  // sticks; at the brink; slides
  VectorXd x(9);
  x << 4, 1, -1, 10, 3, 4, 10, 3, 4.5;
  const Proof p = prove(Problem::dense(A, b, VectorXd::Constant(3, 0.5)), x);
  CHECK(p.status == ProofStatus::proven_nearby);
  CHECK(p.contact == 1);
  CHECK(p.radius == Approx(0.5).epsilon(1e-12));
  CHECK(p.regimes[2] == Regime::sliding);
}

TEST_CASE("packings, stacks and clusters with mu from 0.1 to 1") {
  int exact = 0, all = 0;
  const auto judge = [&](const Problem& p, double allowed = 1e-9) {
    for (double tolerance : {1e-6, 1e-9}) {
      const Solution s = solved(p, tolerance);
      if (s.status != Status::solved) continue;
      const Proof q = prove(p, s.impulses, allowed);
      INFO(p.contacts() << " contacts, " << tolerance << ": " << q.reason << " " << q.contact);
      CHECK(q.status != ProofStatus::not_proven);
      CHECK(q.relative_radius <= 0.01);
      exact += q.status == ProofStatus::proven ? 1 : 0;
      ++all;
    }
  };
  random::Generator g(11);
  for (double mu : {0.1, 0.4, 0.7, 1.0}) {
    for (bool spheres : {true, false}) {
      const random::Packing close = random::close_packing(3, spheres, mu, 5);
      judge(delassus(close.bodies, to_contacts(close.contacts)));
    }
    for (int boxes : {1, 3, 10})
      for (double ratio : {1.0, 1e3, 1e6})  // of which rounding takes part of the digits of b
        judge(random::stack(boxes, ratio, mu).problem(), 1e-14 * std::max(1e5, ratio));
    for (int k = 0; k < 50; ++k) judge(random::cluster(g, mu).problem());
  }
  INFO(exact << " of " << all);
  CHECK(all >= 480);
  CHECK(exact >= 400);
}
