// Tether: rows given by their entries. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <memory>
#include <problems/andrews.hpp>
#include <problems/car_axis.hpp>
#include <problems/kepler.hpp>
#include <problems/link_chain.hpp>
#include <problems/pendulum.hpp>

#include "host.hpp"
#include "linalg/allocations.hpp"
#include "linalg/thrown.hpp"
#include "rod_chain.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The named groups as sparse rows: the entries of their C that are not zero at some points.
tp::Constraints sparse(const Problem& problem, const std::vector<std::string>& names) {
  tp::Constraints joined;
  for (const std::string& name : names) {
    tp::Constraints set = problem.select({name});
    const auto fill = std::get<tp::DenseJacobian>(set.jacobian).fill;
    const int m = set.count, n = problem.size;
    RowMajor C(m, n), pattern = RowMajor::Zero(m, n);
    for (int point = 0; point < 3; ++point) {
      std::vector<double> y = problem.y0;
      for (std::size_t i = 0; i < y.size(); ++i) y[i] += 0.01 * point * std::sin(1.0 + 2.3 * i);
      C.setZero();
      fill(0.1 * point, tp::ConstVector(y.data(), n), tp::Matrix(C.data(), m, n));
      pattern += C.cwiseAbs();
    }
    tp::SparseJacobian given;
    given.starts = {0};
    for (int i = 0; i < m; ++i) {
      for (int j = 0; j < n; ++j)
        if (pattern(i, j) != 0.0) given.columns.push_back(j);
      given.starts.push_back(static_cast<int>(given.columns.size()));
    }
    given.fill = [=, C = RowMajor(m, n), starts = given.starts, columns = given.columns](
                     double t, tp::ConstVector y, tp::Vector entries) mutable {
      C.setZero();
      const int flag = fill(t, y, tp::Matrix(C.data(), m, n));
      for (int i = 0; i < m; ++i)
        for (int e = starts[static_cast<std::size_t>(i)];
             e < starts[static_cast<std::size_t>(i) + 1]; ++e)
          entries[e] = C(i, columns[static_cast<std::size_t>(e)]);
      return flag;
    };
    set.jacobian = std::move(given);
    joined = joined.count == 0 ? std::move(set) : std::move(joined) + set;
  }
  return joined;
}

/// Over the first components, which the problem compares.
double largest(const Problem& problem, const std::vector<double>& a, const std::vector<double>& b) {
  double difference = 0.0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(problem.error_components); ++i)
    difference = std::max(difference, std::abs(a[i] - b[i]) / (1.0 + std::abs(a[i])));
  return difference;
}

std::vector<double> after(const Problem& problem, const tp::Constraints& rows, double t,
                          double* drift) {
  Host host(problem, 1e-8);
  host.attach(rows);
  REQUIRE(host.to(t) >= 0);
  CHECK(host.projection().statistics().failures() == 0);
  *drift = host.projection().statistics().largest_drift_after;
  return host.state();
}

}  // namespace

TEST_CASE("sparse rows: the motion of the same rows as dense ones") {
  struct Given {
    Problem problem;
    std::vector<std::string> names;
    double t;
  };
  const std::vector<Given> all = {
      {pendulum(1.0, 1.0, 100.0, "index 1"), {"position", "velocity", "energy"}, 1.0},
      // Rows with algebraic variables, solved for these in a second stage.
      {pendulum(1.0, 1.0, 100.0, "index 1"), {"position", "velocity", "acceleration"}, 1.0},
      {pendulum(1.0, 1.0, 100.0, "index 0"), {"position", "velocity", "energy"}, 1.0},
      {andrews("index 1"), {"position", "velocity"}, 0.01},
      {link_chain(8, 0.5), {"position", "velocity", "energy"}, 0.3},
  };
  for (const Given& given : all) {
    INFO(given.problem.name << ", " << given.problem.form << ", with " << given.names.back());
    double of_sparse = 0.0, of_dense = 0.0;
    const std::vector<double> y =
        after(given.problem, sparse(given.problem, given.names), given.t, &of_sparse);
    const std::vector<double> expected =
        after(given.problem, given.problem.select(given.names), given.t, &of_dense);
    // Both keep what they have to; they differ in the metric, within the error of a run.
    CHECK(largest(given.problem, y, expected) < 3e-7);
    // 1e-4 tolerances; Andrews' velocities are some 100 rad/s.
    CHECK(of_sparse <= of_dense + 1e-10);
  }
}

TEST_CASE("sparse rows, few or many: the bits of dense ones, in every form") {
  // A dense row beside them; rounding that differs is hundreds of tolerances on the car axis.
  const RodChain chain(20, 0.1);
  const tp::Constraints sparse_rods = chain.sparse_rows() + chain.energy_row();
  const tp::Constraints dense_rods = chain.dense_rows() + chain.energy_row();
  const auto same = [](const Problem& problem, const tp::Constraints& given,
                       const tp::Constraints& dense, double tolerance) {
    INFO(problem.name << ", " << problem.form << ", tolerance " << tolerance);
    const Run a = integrate(problem, tolerance, given, {}, false);
    const Run b = integrate(problem, tolerance, dense, {}, false);
    REQUIRE(a.flag >= 0);
    REQUIRE(a.statistics.projections > 20);
    CHECK(a.steps == b.steps);
    CHECK(same_bits(a.y, b.y));
  };
  for (const char* form : {"index 0", "index 1", "index 2", "GGL"}) {
    const Problem axis = car_axis(form);
    for (const double tolerance : {1e-4, 3.3e-8})
      same(axis, sparse(axis, axis.recommended), axis.recommended_constraints(), tolerance);
  }
  for (const double tolerance : {1e-4, 1e-7, 1e-9})
    same(chain.problem(0.7), sparse_rods, dense_rods, tolerance);
  const Problem links = link_chain(20, 0.2);  // 81 rows
  same(links, *links.sparse_constraints, links.select(links.recommended), 1e-7);
}

TEST_CASE("sparse rows and a full one: chain of 30 links on all its rows") {
  const Problem problem = link_chain(30, 0.4);
  REQUIRE(problem.sparse_constraints);
  Host host(problem, 1e-8);
  host.attach(*problem.sparse_constraints);
  REQUIRE(host.finish() >= 0);
  const tp::Statistics s = host.projection().statistics();
  CHECK(host.error() < 1e-5);
  CHECK(s.failures() == 0);
  CHECK(s.largest_drift_after < 1e-11);
  CHECK(s.factorizations <= s.projections / 3);
  CHECK(static_cast<double>(s.value_evaluations) < 4.5 * static_cast<double>(s.projections));
}

TEST_CASE("sparse rows: redundant ones are dropped, contradicting ones named") {
  const Problem problem = pendulum(1.0, 1.0, 10.0, "index 1");
  const std::vector<std::string> names = {"position", "velocity", "energy"};
  double drift = 0.0;
  const tp::Constraints once = sparse(problem, names);
  const std::vector<double> expected = after(problem, once, 1.0, &drift);
  CHECK(largest(problem, after(problem, once + sparse(problem, {"position"}), 1.0, &drift),
                expected) < 3e-7);

  tp::Constraints other = sparse(problem, {"position"});
  const auto g = other.value;
  other.value = [g](double t, tp::ConstVector y, tp::Vector out) {
    const int flag = g(t, y, out);
    out[0] += 1e-3;
    return flag;
  };
  other.names = {"another length"};
  Host host(problem, 1e-8);
  tp::Projection& projection = host.attach(once + other);
  CHECK(host.step() < 0);
  CHECK(projection.status() == tp::Status::inconsistent);
  CHECK(contains(projection.message(), "another length"));
}

TEST_CASE("sparse rows: consistent start and projected output") {
  Problem problem = link_chain(10, 0.4);
  problem.y0[3] += 1e-3;
  problem.y0[31] += 1e-3;
  Host host(problem, 1e-8);
  tp::Projection& projection = host.attach(*problem.sparse_constraints);
  const tp::ConsistencyReport report = projection.make_consistent(0.0, host.y, host.yp);
  REQUIRE(report.status == tp::Status::success);
  CHECK(report.drift_before > 1e-4);
  CHECK(report.drift_after < 1e-13);
  CHECK(report.rank == 41);
  REQUIRE(host.to(0.2) >= 0);
  const tp::ConsistencyReport output = projection.project(host.t, host.y, host.yp);
  CHECK(output.status == tp::Status::success);
  CHECK(output.drift_after < 1e-13);
  std::vector<double> g(41);
  REQUIRE(problem.select({"position", "velocity", "energy"}).total_count() == 41);
  tp::Constraints position = problem.select({"position"});
  REQUIRE(position.value(host.t, tp::ConstVector(host.data(), problem.size),
                         tp::Vector(g.data(), 20)) == 0);
  for (int i = 0; i < 20; ++i) CHECK(std::abs(g[static_cast<std::size_t>(i)]) < 1e-13);
}

TEST_CASE("sparse rows given twice: output points are found") {
  const RodChain chain(70, 0.1);
  Host host(chain.problem(1.0), 1e-7);
  tp::Projection& projection = host.attach(chain.sparse_rows() + chain.sparse_rows());
  int outputs = 0;
  while (outputs < 100) {
    REQUIRE(host.step() >= 0);
    if (host.steps() < 40) continue;  // first steps turn C by much
    double h = 0.0;
    IDAGetLastStep(host.ida, &h);
    std::vector<double> between(host.state());
    N_Vector y = host.vector(between);
    const double t = host.t - 0.4 * h;
    REQUIRE(IDAGetDky(host.ida, t, 0, y) == 0);
    const tp::ConsistencyReport report = projection.project(t, y);
    REQUIRE(report);
    CHECK(report.rank == 140);
    CHECK(report.drift_after < 1e-12);
    ++outputs;
  }
}

TEST_CASE("sparse rows: no allocation in a projected step") {
  const Problem problem = link_chain(20, 1.0);
  Host host(problem, 1e-8);
  host.attach(*problem.sparse_constraints);
  for (int i = 0; i < 150; ++i) REQUIRE(host.step() >= 0);
  const long before = allocations();
  for (int i = 0; i < 100; ++i) REQUIRE(host.step() >= 0);
  CHECK(allocations() == before);
}

TEST_CASE("sparse rows of whipping chains: every step on the constraints, as dense rows") {
  // Point masses on rods of 0.1 m, released along the x axis, v' = a solved for the forces: C turns
  // by its own size within a few steps each time the end whips round.
  // Up to 128 rows the factors are those of dense rows, beyond that sparse ones.
  double ratios = 0.0;  // of steps, beside dense rows
  for (const auto& [rods, t_end, tolerance] : {std::make_tuple(20, 3.0, 1e-3),
                                               {20, 3.0, 1e-4},
                                               {20, 2.0, 3e-6},
                                               {40, 1.5, 1e-4},
                                               {40, 1.5, 1e-5},
                                               {70, 0.4, 3e-5},
                                               {70, 0.4, 1e-4},
                                               {70, 0.4, 1e-5}}) {
    const RodChain chain(rods, 0.1);
    INFO(rods << " rods");
    INFO("tolerance " << tolerance);
    Host host(chain.problem(t_end), tolerance);
    host.attach(chain.sparse_rows() + chain.energy_row());
    const tp::Constraints dense = chain.dense_rows() + chain.energy_row();
    double farthest = 0.0;
    while (host.t < host.problem.t_end) {
      REQUIRE(host.step() >= 0);
      if (host.steps() % 4 == 0) farthest = std::max(farthest, distance(host, dense));
    }
    const tp::Statistics s = host.projection().statistics();
    CHECK(farthest <= 1e-4);  // Options::tolerance
    CHECK(s.failures() == 0);
    CHECK(s.iterations <= 5 * s.projections);

    Host other(chain.problem(t_end), tolerance);
    other.attach(dense);
    REQUIRE(other.finish() >= 0);
    if (rods == 70)
      ratios += std::log(static_cast<double>(host.steps()) / static_cast<double>(other.steps()));
    if (rods <= 40) CHECK(host.steps() == other.steps());
  }
  CHECK(ratios <= 3.0 * std::log(1.1));
}

TEST_CASE("sparse factors: few solutions a step, plain IDA's errors") {
  for (const auto& [links, t_end] : {std::make_pair(50, 0.5), {110, 0.3}})
    for (const auto& [tolerance, solutions] : {std::make_pair(1e-4, 4.3), {1e-6, 3.9}}) {
      INFO(links << " links, tolerance " << tolerance);
      const Problem problem = link_chain(links, t_end);
      Host host(problem, tolerance), plain(problem, tolerance);
      host.attach(*problem.sparse_constraints);
      REQUIRE(host.finish() >= 0);
      REQUIRE(plain.finish() >= 0);
      const tp::Statistics s = host.projection().statistics();
      CHECK(s.failures() == 0);
      CHECK(s.largest_drift_after <= 1e-2 * tolerance);
      CHECK(static_cast<double>(s.iterations) <= solutions * static_cast<double>(s.projections));
      CHECK(host.steps() <= plain.steps());
      CHECK(host.error() <= 2.2 * plain.error() + tolerance);
    }
}

TEST_CASE("sparse rows of lower rank: the steps and the motion of dense rows") {
  for (const double tolerance : {1e-4, 1e-6, 1e-9}) {
    INFO("tolerance " << tolerance);
    for (const Problem& problem : {kepler(0.9, 20.0), pendulum(1.0, 9.81, 5.0, "index 1")}) {
      INFO(problem.name);
      const tp::Constraints rows = problem.recommended_constraints();
      Host of_sparse(problem, tolerance), of_dense(problem, tolerance);
      of_sparse.attach(sparse(problem, problem.recommended));
      of_dense.attach(rows);
      REQUIRE(of_sparse.finish() >= 0);
      REQUIRE(of_dense.finish() >= 0);
      CHECK(of_sparse.error() <= 1.5 * of_dense.error() + 10.0 * tolerance);
      CHECK(static_cast<double>(of_sparse.steps()) <= 1.1 * static_cast<double>(of_dense.steps()));
    }
  }
}

TEST_CASE("id of many unknowns: the right one, by few evaluations of F") {
  // 288 unknowns, 72 of them multipliers; one by one that took 4 N evaluations.
  const Problem problem = link_chain(36, 1.0);
  Host derived(problem, 1e-6), given(problem, 1e-6);
  derived.attach(*problem.sparse_constraints);
  tp::Options options;
  options.id = given.vector(problem.id);
  given.attach(*problem.sparse_constraints, options);
  for (int i = 0; i < 30; ++i) REQUIRE((derived.step() >= 0 && given.step() >= 0));
  REQUIRE(derived.projection().statistics().projections > 0);
  CHECK(same_bits(derived.state(), given.state()));
  const long evaluations = derived.projection().statistics().residual_evaluations -
                           given.projection().statistics().residual_evaluations;
  CHECK(evaluations > 0);
  CHECK(evaluations <= 60);
}

TEST_CASE("id where equations share derivatives, with equal coefficients of opposite sign") {
  Problem problem = pendulum(1.0, 1.0, 5.0, "index 1");
  problem.jacobian = nullptr;
  const auto residual = problem.residual;
  problem.residual = [residual](double t, const double* y, const double* yp, double* r) {
    residual(t, y, yp, r);
    for (int i = 0; i < 4; ++i) r[i] -= r[i + 1];
  };
  Host derived(problem, 1e-6), given(problem, 1e-6);
  const tp::Constraints rows = problem.recommended_constraints();
  derived.attach(rows);
  tp::Options options;
  options.id = given.vector(problem.id);
  given.attach(rows, options);
  REQUIRE(derived.finish() >= 0);
  REQUIRE(given.finish() >= 0);
  CHECK(same_bits(derived.state(), given.state()));
}

TEST_CASE("sparse rows: check_jacobian names entries that are wrong or missing") {
  const Problem problem = pendulum(1.0, 1.0, 10.0, "index 1");
  tp::Constraints set = sparse(problem, {"position"});
  const std::vector<double> y = {0.6, -0.8, 0.1, 0.2, 0.3};
  CHECK(tp::check_jacobian(set, 0.0, y).correct);
  auto& given = std::get<tp::SparseJacobian>(set.jacobian);
  const int missing = given.columns.back();
  given.columns.pop_back();
  --given.starts.back();
  given.fill = [whole = given.fill](double t, tp::ConstVector at, tp::Vector entries) {
    Eigen::VectorXd all(entries.size() + 1);  // what the whole pattern has, and one less is taken
    const int flag = whole(t, at, tp::Vector(all.data(), all.size()));
    for (Eigen::Index e = 0; e < entries.size(); ++e) entries[e] = all[e];
    return flag;
  };
  const tp::JacobianReport report = tp::check_jacobian(set, 0.0, y);
  CHECK_FALSE(report.correct);
  CHECK(report.column == missing);
}

TEST_CASE("sparse rows: patterns that make no sense are refused by name") {
  const Problem problem = pendulum(1.0, 1.0, 10.0, "index 1");
  const tp::Constraints good = sparse(problem, {"position"});
  Host host(problem, 1e-6);
  const auto refusal = [&](auto change) {
    tp::Constraints set = good;
    change(std::get<tp::SparseJacobian>(set.jacobian));
    return thrown([&] { host.attach(set); });
  };
  using Given = tp::SparseJacobian;
  CHECK(contains(refusal([](Given& s) { s.fill = nullptr; }), "fill is empty"));
  CHECK(contains(refusal([](Given& s) { s.starts.push_back(2); }), "starts has 3 entries for 1"));
  CHECK(contains(refusal([](Given& s) { s.starts.back() = 1; }), "from 0 to 1"));
  CHECK(contains(refusal([](Given& s) { s.columns[0] = -1; }), "columns[0] = -1"));
  CHECK(contains(refusal([](Given& s) { s.columns[1] = 5; }), "it must be 0 .. 4"));
  CHECK(contains(refusal([](Given& s) { s.columns[1] = 0; }), "ascend"));
  CHECK(refusal([](Given&) {}).empty());
  // Rows without an entry have nothing to move.
  tp::Constraints none = good;
  auto& given = std::get<Given>(none.jacobian);
  given.starts = {0, 0};
  given.columns.clear();
  given.fill = [](double, tp::ConstVector, tp::Vector) {};
  host.attach(none);
  CHECK(host.step() < 0);
  CHECK(contains(host.projection().message(), "depends on no component"));
}
