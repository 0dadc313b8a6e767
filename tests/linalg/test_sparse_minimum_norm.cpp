// Tether: minimum-norm solves with many sparse rows and few full ones. SPDX-License-Identifier:
// BSD-3-Clause
#include <limits>

#include "allocations.hpp"
#include "cases.hpp"
#include "support/catch.hpp"
#include "thrown.hpp"

using namespace tether::test;
using tether::linalg::SparseMinimumNorm;

namespace {

/// Sparse rows first, then `full` full ones.
struct SparseCase {
  Case dense;
  std::vector<int> starts{0}, columns;
  int full = 0;
  std::vector<double> values{};  // where C would be too large to be dense
};

/// Row i has entries near column 1.4 i and one anywhere.
SparseCase banded(int sparse, int full, unsigned seed) {
  const int n = 3 * sparse / 2 + 4;
  SparseCase c{random_case(sparse + full, n, seed), {0}, {}, full};
  std::mt19937 random(seed + 100);
  for (int i = 0; i < sparse; ++i) {
    const int stray = std::uniform_int_distribution<int>(0, n - 1)(random);
    for (int j = 0; j < n; ++j) {
      if (std::abs(j - 7 * i / 5 - 1) <= 2 || j == stray)
        c.columns.push_back(j);
      else
        c.dense.C(i, j) = 0.0;
    }
    c.starts.push_back(static_cast<int>(c.columns.size()));
  }
  return c;
}

void load(SparseMinimumNorm& solver, const SparseCase& c) {
  const int sparse = solver.sparse_rows();
  for (int i = 0; i < sparse; ++i)
    for (int e = c.starts[static_cast<std::size_t>(i)];
         e < c.starts[static_cast<std::size_t>(i) + 1]; ++e)
      solver.entries()[e] = c.dense.C(i, c.columns[static_cast<std::size_t>(e)]);
  for (int f = 0; f < c.full; ++f)
    for (int j = 0; j < solver.columns(); ++j) solver.full_row(f)[j] = c.dense.C(sparse + f, j);
  std::copy_n(c.dense.D.data(), solver.columns(), solver.metric());
}

SparseMinimumNorm factored(const SparseCase& c) {
  SparseMinimumNorm solver;
  solver.resize(static_cast<int>(c.dense.C.cols()), c.starts, c.columns, c.full);
  load(solver, c);
  REQUIRE(solver.factor());
  return solver;
}

Eigen::VectorXd solve(SparseMinimumNorm& solver, const Eigen::VectorXd& g) {
  Eigen::VectorXd dy(solver.columns());
  solver.solve(g.data(), dy.data());
  return dy;
}

/// Distances between n x n balls at `place(i, j)`, along both diagonals, too: more rows than the
/// 3 n^2 - 6 ways to move them.
template <class Place>
SparseCase net_on(int n, const Place& place) {
  SparseCase c;
  std::vector<Eigen::Vector3d> balls;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) balls.push_back(place(double(i), double(j)));
  std::vector<Eigen::Vector3d> directions;
  const auto link = [&](int a, int b) {
    directions.push_back(balls[static_cast<std::size_t>(b)] - balls[static_cast<std::size_t>(a)]);
    for (const int ball : {a, b})
      for (int k = 0; k < 3; ++k) c.columns.push_back(3 * ball + k);
    c.starts.push_back(static_cast<int>(c.columns.size()));
  };
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const int ball = i * n + j;
      if (i + 1 < n) link(ball, ball + n);
      if (j + 1 < n) link(ball, ball + 1);
      if (i + 1 < n && j + 1 < n) {
        link(ball, ball + n + 1);
        link(ball + 1, ball + n);
      }
    }
  for (const Eigen::Vector3d& d : directions)
    for (const double sign : {-1.0, 1.0})
      for (int k = 0; k < 3; ++k) c.values.push_back(sign * d[k] / d.norm());
  c.dense.D = Eigen::VectorXd::Ones(3 * n * n);
  return c;
}

/// On a wavy surface: many rows depend on others up to 1e-6 and less of themselves.
SparseCase net(int n, double bend) {
  return net_on(n, [=](double i, double j) {
    const double x = i / (n - 1.0) - 0.5, y = j / (n - 1.0) - 0.5;
    return Eigen::Vector3d(x, y, 0.1 * bend * std::sin(6.0 * x) * std::cos(5.0 * y));
  });
}

Eigen::VectorXd times(const SparseCase& c, const Eigen::VectorXd& x) {
  Eigen::VectorXd product = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(c.starts.size()) - 1);
  for (int i = 0; i < product.size(); ++i)
    for (int e = c.starts[static_cast<std::size_t>(i)];
         e < c.starts[static_cast<std::size_t>(i) + 1]; ++e)
      product[i] +=
          c.values[static_cast<std::size_t>(e)] * x[c.columns[static_cast<std::size_t>(e)]];
  return product;
}

SparseMinimumNorm factored_net(const SparseCase& c, double rank_tolerance = 1e-6) {
  SparseMinimumNorm solver;
  solver.resize(static_cast<int>(c.dense.D.size()), c.starts, c.columns, 0);
  std::copy(c.values.begin(), c.values.end(), solver.entries());
  std::copy_n(c.dense.D.data(), solver.columns(), solver.metric());
  REQUIRE(solver.factor(rank_tolerance));
  return solver;
}

RowMajor dense_rows(const SparseCase& c) {
  const auto m = static_cast<Eigen::Index>(c.starts.size()) - 1, n = c.dense.D.size();
  RowMajor A(m, n);
  for (Eigen::Index j = 0; j < n; ++j) A.col(j) = times(c, Eigen::VectorXd::Unit(n, j));
  return A;
}

}  // namespace

TEST_CASE("sparse and full rows: equal to a complete orthogonal decomposition") {
  for (const auto& [sparse, full] :
       {std::make_pair(1, 0), {0, 1}, {5, 0}, {40, 1}, {40, 3}, {150, 2}})
    for (unsigned seed = 1; seed <= 4; ++seed) {
      INFO(sparse << " sparse, " << full << " full, seed " << seed);
      const SparseCase c = banded(sparse, full, seed);
      SparseMinimumNorm solver = factored(c);
      CHECK(solver.rank() == sparse + full);
      const Eigen::VectorXd dy = solve(solver, c.dense.g), expected = oracle(c.dense);
      const RowMajor A = c.dense.C * c.dense.D.asDiagonal();
      const RowMajor unit = A.rowwise().norm().cwiseInverse().asDiagonal() * A;
      const Eigen::VectorXd singular = unit.jacobiSvd().singularValues();
      const double condition = singular.maxCoeff() / singular.minCoeff();
      CHECK(length(dy - expected, c.dense.D) <=
            1e-14 * condition * condition * length(expected, c.dense.D));
    }
}

TEST_CASE("one step: symmetric, and the solution of least norm but for eps") {
  const SparseCase c = banded(40, 2, 5);
  SparseMinimumNorm solver = factored(c);
  const auto n = static_cast<int>(c.dense.C.cols());
  const auto once = [&](const Eigen::VectorXd& g) {
    Eigen::VectorXd dy(n);
    solver.one_step(g.data(), dy.data());
    return dy;
  };
  // In u = D^-1 dy: a . H b = b . H a.
  std::mt19937 random(8);
  const Eigen::VectorXd a = random_vector(n, random), b = random_vector(n, random);
  const auto H = [&](const Eigen::VectorXd& u) {
    return Eigen::VectorXd(once(c.dense.C * c.dense.D.asDiagonal() * u).cwiseQuotient(c.dense.D));
  };
  CHECK(std::abs(a.dot(H(b)) - b.dot(H(a))) <= 1e-12 * a.norm() * b.norm());
  const Eigen::VectorXd expected = oracle(c.dense);
  const RowMajor A = c.dense.C * c.dense.D.asDiagonal();
  const RowMajor unit = A.rowwise().norm().cwiseInverse().asDiagonal() * A;
  const double least = unit.jacobiSvd().singularValues().minCoeff();
  CHECK(length(once(c.dense.g) - expected, c.dense.D) <=
        2e-12 / (least * least) * length(expected, c.dense.D));
}
TEST_CASE("a loose tolerance: what residual() says is left, with one step where that is enough") {
  // The last full row is the first one, but for `apart` in a column: both stages of its border are
  // long and cancel.
  for (const double apart : {1.0, 1e-3, 1e-5, 1e-8})
    for (const double tolerance : {1e-3, 1e-6, 1e-9}) {
      INFO("apart " << apart << ", tolerance " << tolerance);
      SparseCase c = banded(150, 3, 7);
      c.dense.C.row(152) = c.dense.C.row(150) + 0.5 * c.dense.C.row(10);
      c.dense.C(152, 3) += apart;
      c.dense.g = c.dense.C * c.dense.D.cwiseProduct(Eigen::VectorXd::LinSpaced(229, -1.0, 2.0));
      SparseMinimumNorm solver = factored(c);
      Eigen::VectorXd dy(solver.columns());
      solver.solve(c.dense.g.data(), dy.data(), tolerance);
      const RowMajor A = c.dense.C * c.dense.D.asDiagonal();
      const Eigen::VectorXd inverse = A.rowwise().norm().cwiseInverse();
      const Eigen::VectorXd b = inverse.asDiagonal() * c.dense.g;
      const Eigen::VectorXd left = b - inverse.asDiagonal() * (c.dense.C * dy);
      CHECK(left.norm() <= tolerance * b.norm());
      CHECK(std::abs(solver.residual() * b.norm() - left.norm()) <= 0.02 * tolerance * b.norm());
      if (apart == 1.0 && tolerance >= 1e-6) CHECK(solver.iterations() == 1);
    }
}

TEST_CASE("redundant sparse and full rows: dropped, explained, the rest still solved") {
  SparseCase c = banded(30, 2, 9);
  c.dense.D.setOnes();
  // Row 12 repeats the pattern and the direction of row 11; full row 31 adds rows 3 and 30.
  for (int i = 12; i < 13; ++i) {
    const int begin = c.starts[11], end = c.starts[12];
    c.columns.erase(c.columns.begin() + c.starts[12], c.columns.begin() + c.starts[13]);
    const std::vector<int> copy(c.columns.begin() + begin, c.columns.begin() + end);
    c.columns.insert(c.columns.begin() + end, copy.begin(), copy.end());
    const int change = 2 * end - begin - c.starts[13];
    for (std::size_t k = 13; k < c.starts.size(); ++k) c.starts[k] += change;
  }
  c.dense.C.row(12) = -1e5 * c.dense.C.row(11);
  c.dense.C.row(31) = 2.0 * c.dense.C.row(30) - 0.5 * c.dense.C.row(3);
  std::mt19937 random(3);
  c.dense.g = c.dense.C * random_vector(static_cast<int>(c.dense.C.cols()), random);
  SparseMinimumNorm solver = factored(c);
  REQUIRE(solver.rank() == 30);
  CHECK((solver.pivot(30) == 11 || solver.pivot(30) == 12));
  CHECK(solver.pivot(31) == 31);
  const Eigen::VectorXd dy = solve(solver, c.dense.g);
  CHECK(length(dy - oracle(c.dense), c.dense.D) <= 1e-9 * length(dy, c.dense.D));
  for (const int k : {30, 31}) CHECK(solver.inconsistency(k) < 1e-9);

  // The shares of the kept rows (scaled to unit length) give the dropped one.
  for (const int k : {30, 31}) {
    const std::vector<double> share = solver.dependence(k);
    const int row = solver.pivot(k);
    Eigen::VectorXd rest = c.dense.C.row(row).transpose() / c.dense.C.row(row).norm();
    for (int i = 0; i < 30; ++i) {
      const auto kept = c.dense.C.row(solver.pivot(i));
      rest -= share[static_cast<std::size_t>(i)] * kept.transpose() / kept.norm();
    }
    CHECK(rest.norm() < 1e-9);
  }
  // A contradiction is told as a distance.
  const int row = solver.pivot(31);
  c.dense.g[row] += 0.25 * solver.row_norm(row);
  solve(solver, c.dense.g);
  CHECK(solver.inconsistency(31) == Approx(0.25).epsilon(1e-8));
}

TEST_CASE("vanishing rows, held columns, huge and tiny units, entries that are not finite") {
  SparseCase c = banded(20, 1, 4);
  SparseMinimumNorm solver = factored(c);
  const Eigen::VectorXd plain = solve(solver, c.dense.g);

  SparseCase scaled = c;  // the units of a row do not matter
  scaled.dense.C.row(2) *= 1e200;
  scaled.dense.g[2] *= 1e200;
  scaled.dense.C.row(7) *= 1e-200;
  scaled.dense.g[7] *= 1e-200;
  solver = factored(scaled);
  CHECK(length(solve(solver, scaled.dense.g) - plain, c.dense.D) <=
        1e-10 * length(plain, c.dense.D));

  SparseCase zero = c;
  zero.dense.C.row(5).setZero();
  solver = factored(zero);
  REQUIRE(solver.rank() == 20);
  CHECK(solver.pivot(20) == 5);
  CHECK(solver.row_norm(5) == 0.0);
  solve(solver, zero.dense.g);
  CHECK(solver.inconsistency(20) == std::abs(zero.dense.g[5]));

  SparseCase held = c;
  held.dense.D[9] = 0.0;
  solver = factored(held);
  CHECK(solve(solver, held.dense.g)[9] == 0.0);

  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    load(solver, c);
    solver.entries()[3] = bad;
    CHECK_FALSE(solver.factor());
    load(solver, c);
    solver.full_row(0)[3] = bad;
    CHECK_FALSE(solver.factor());
  }
  load(solver, c);  // and recovers
  REQUIRE(solver.factor());
  CHECK((solve(solver, c.dense.g) - plain).cwiseAbs().maxCoeff() == 0.0);
}

TEST_CASE("nets of nearly dependent rows: solved, never longer than the least norm, rank known") {
  std::mt19937 random(5);
  for (const double bend : {0.3, 1.5})
    for (const int n : {10, 30, 60, 110}) {
      if (n > 60 && bend < 1.0) continue;
      INFO(n << " x " << n << " balls, bend " << bend);
      SparseCase c = net(n, bend);
      const Eigen::VectorXd generated = random_vector(3 * n * n, random);
      const Eigen::VectorXd b = times(c, generated);
      SparseMinimumNorm solver = factored_net(c);
      Eigen::VectorXd x(3 * n * n);
      solver.solve(b.data(), x.data());
      const double left = (b - times(c, x)).norm() / b.norm();
      CHECK(left < 1e-9);
      CHECK(solver.residual() == Approx(left).margin(1e-14));
      CHECK(solver.iterations() <= 18);
      CHECK(x.norm() <= (1.0 + 1e-9) * generated.norm());  // the least norm is not longer
      CHECK(std::abs(solver.rank() - (3 * n * n - 6)) <= n * n / 40);
      double contradiction = 0.0;
      for (int k = solver.rank(); k < solver.rows(); ++k)
        contradiction = std::max(contradiction, solver.inconsistency(k));
      CHECK(contradiction < 1e-6);
    }
}

TEST_CASE("rows with large coefficients over those before are told from independent ones") {
  // Rigid, with singular values from 5e-5 on. Of a dependent row with coefficients c, d is
  // eps |c|^2: far above eps.
  const int n = 14;
  const SparseCase c = net_on(n, [=](double i, double j) -> Eigen::Vector3d {
    return Eigen::Vector3d(i, j, 0.2 * i * i - 0.1 * j * j + 0.1 * i * j) / n;
  });
  SparseMinimumNorm solver = factored_net(c, 3.25e-7);
  Eigen::MatrixXd A = dense_rows(c);
  A.rowwise().normalize();
  CHECK(solver.rank() == rank_of(A, 1e-10));
}

TEST_CASE("the row that closes a loop is redundant, however long it is") {
  // Points in a line; the last row gives the distance between the ends once more, as the sum of
  // all.
  for (const auto& [n, unit] : {std::make_pair(10, 1.0), {100, 1e-8}, {1000, 1e8}, {10000, 1.0}}) {
    INFO(n << " points, unit " << unit);
    SparseCase c;
    for (int i = 0; i < n; ++i) {
      const int first = i + 1 < n ? i : 0, second = i + 1 < n ? i + 1 : n - 1;
      c.columns.insert(c.columns.end(), {first, second});
      c.values.insert(c.values.end(), {unit * (first - second), unit * (second - first)});
      c.starts.push_back(2 * (i + 1));
    }
    c.dense.D = Eigen::VectorXd::Ones(n);
    SparseMinimumNorm solver = factored_net(c);
    REQUIRE(solver.rank() == n - 1);
    Eigen::VectorXd b = times(c, Eigen::VectorXd::LinSpaced(n, -1.0, 2.0).cwiseAbs2());
    solve(solver, b);
    CHECK(solver.residual() < 1e-12);
    CHECK(solver.inconsistency(n - 1) < 1e-9);
    const int row = solver.pivot(n - 1);
    b[row] += 0.25 * solver.row_norm(row);
    solve(solver, b);
    // Short by eps / s^2, s the least singular value, pi / n.
    CHECK(solver.inconsistency(n - 1) == Approx(0.25).epsilon(1e-4));
  }
}

TEST_CASE("every direction of a net, however thin: at most the least norm, and no residual grows") {
  const SparseCase c = net(8, 1.5);
  const SingularVectors svd = singular_vectors(dense_rows(c));
  SparseMinimumNorm solver = factored_net(c);
  int thin = 0;
  for (Eigen::Index k = 0; k < svd.sigma.size(); ++k) {
    const double sigma = svd.sigma[k];
    INFO("singular value " << sigma);
    const Eigen::VectorXd b = svd.U.col(k), x = solve(solver, b);
    thin += sigma < 1e-3;
    CHECK(solver.residual() <= 1.0 + 1e-12);
    if (sigma > 1e-14) CHECK(x.norm() <= 2.0 / sigma);
    if (sigma > 1e-6) {
      CHECK(solver.residual() < 1e-6);
      CHECK((x - svd.V.col(k) / sigma).norm() <= 1e-6 / sigma);
    }
  }
  CHECK(thin >= 6);
}

TEST_CASE("what no motion of a net can give is told by rows, in any units of the rows") {
  for (const double unit : {1e-8, 1.0, 1e8}) {
    INFO("unit " << unit);
    SparseCase c = net(8, 1.5);
    for (double& value : c.values) value *= unit;
    const RowMajor A = dense_rows(c);
    SparseMinimumNorm solver = factored_net(c);
    REQUIRE(solver.dropped() > 0);
    std::mt19937 random(8);
    Eigen::VectorXd b = A * random_vector(solver.columns(), random);
    const int row = solver.pivot(solver.rank());
    b[row] += 0.25 * solver.row_norm(row);
    const Eigen::VectorXd x = solve(solver, b);
    const double expected = (A * least_squares(A, b) - b).norm();
    CHECK((A * x - b).norm() == Approx(expected).epsilon(1e-3));
    CHECK(solver.residual() == Approx(expected / b.norm()).epsilon(1e-3));
    // The changed row is off by what was added to it.
    CHECK(solver.inconsistency(solver.rank()) == Approx(0.25).epsilon(1e-3));
    const std::vector<double> share = solver.dependence(solver.rank());
    Eigen::VectorXd rest = A.row(row).transpose() / unit;
    for (int i = 0; i < solver.rank(); ++i)
      rest -= share[static_cast<std::size_t>(i)] * A.row(solver.pivot(i)).transpose() / unit;
    CHECK(rest.norm() < 1e-5);
  }
}

TEST_CASE("multipliers: the least ones, also where rows are given ten times") {
  for (const int copies : {1, 3, 10}) {
    const SparseCase c = banded(20, 0, 3);
    SparseCase many = c;
    many.dense.C = c.dense.C.replicate(copies, 1);
    for (int k = 1; k < copies; ++k) {
      const int before = static_cast<int>(many.columns.size());
      many.columns.insert(many.columns.end(), c.columns.begin(), c.columns.end());
      for (std::size_t i = 1; i < c.starts.size(); ++i) many.starts.push_back(before + c.starts[i]);
    }
    SparseMinimumNorm solver = factored(many);
    const Eigen::VectorXd wanted = Eigen::VectorXd::LinSpaced(20, -1, 2);
    const Eigen::VectorXd dy =
        c.dense.D.cwiseAbs2().asDiagonal() * (c.dense.C.transpose() * wanted);
    Eigen::VectorXd x(20 * copies);
    solver.multipliers(dy.data(), x.data());
    const RowMajor A = c.dense.C * c.dense.D.asDiagonal();
    const Eigen::VectorXd norms = A.rowwise().norm();
    const RowMajor unit = norms.cwiseInverse().asDiagonal() * A;
    const Eigen::VectorXd singular = unit.jacobiSvd().singularValues();
    const double condition = singular.maxCoeff() / singular.minCoeff();
    INFO(copies << " copies, condition " << condition);
    // In the units of the rows.
    const Eigen::VectorXd scaled = norms.cwiseProduct(wanted);
    for (int k = 0; k < copies; ++k)
      CHECK((norms.cwiseProduct(x.segment(20 * k, 20)) - scaled / copies).norm() <
            1e-12 * condition * scaled.norm());
  }
}

TEST_CASE("a long band: little fill, no allocation once resized") {
  const SparseCase c = banded(400, 1, 2);
  SparseMinimumNorm solver = factored(c);
  Eigen::VectorXd dy = solve(solver, c.dense.g);
  load(solver, c);
  const long before = allocations();
  REQUIRE(solver.factor());
  solver.solve(c.dense.g.data(), dy.data());
  CHECK(allocations() == before);
}

TEST_CASE("patterns that make no sense are refused") {
  SparseMinimumNorm solver;
  const auto refusal = [&](int n, std::vector<int> starts, std::vector<int> columns) {
    return thrown([&] { solver.resize(n, starts, columns, 0); });
  };
  CHECK(refusal(3, {0, 2}, {0, 2}).empty());
  CHECK(contains(refusal(3, {}, {}), "starts"));
  CHECK(contains(refusal(3, {0, 3}, {0, 2}), "starts"));
  CHECK(contains(refusal(3, {0, 2, 1}, {0}), "starts"));
  CHECK(contains(refusal(3, {0, 2}, {2, 0}), "ascend"));
  CHECK(contains(refusal(3, {0, 2}, {1, 3}), "row 0"));
}
