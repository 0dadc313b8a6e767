// Tether: rows that are spread over processes, in one process: ghosts are copies of its own
// unknowns. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <memory>

#include "host.hpp"
#include "linalg/thrown.hpp"
#include "rod_chain.hpp"
#include "support/catch.hpp"

using namespace tether::test;

namespace {

constexpr int kMasses = 12;
constexpr double kRod = 0.3;

/// Calls of the ghosts' functions, which fail with `flag` from the call `fails` on, `times` times.
struct Exchanges {
  int calls = 0, fails = -1, times = 1, flag = 0;
  int next() {
    const int call = calls++;
    return call >= fails && call < fails + times && fails >= 0 ? flag : 0;
  }
};

/// The same rows on n unknowns, with columns `copied` of every second row as ghosts.
tp::Constraints as_distributed(const tp::Constraints& sparse, int n, std::vector<int> copied = {},
                               std::shared_ptr<Exchanges> exchanges = nullptr) {
  const auto& given = std::get<tp::SparseJacobian>(sparse.jacobian);
  tp::DistributedRows rows;
  rows.unknowns = n;
  rows.ghosts = static_cast<int>(copied.size());
  rows.starts = given.starts;
  rows.columns = given.columns;
  for (int i = 0; i < sparse.count; i += 2)
    for (int e = given.starts[static_cast<std::size_t>(i)];
         e < given.starts[static_cast<std::size_t>(i) + 1]; ++e) {
      int& column = rows.columns[static_cast<std::size_t>(e)];
      const auto found = std::find(copied.begin(), copied.end(), column);
      if (found != copied.end()) column = n + static_cast<int>(found - copied.begin());
    }
  if (!copied.empty()) {
    if (!exchanges) exchanges = std::make_shared<Exchanges>();
    rows.update_ghosts = [copied, exchanges](tp::ConstVector y, tp::Vector ghosts) {
      for (Eigen::Index k = 0; k < ghosts.size(); ++k)
        ghosts[k] = y[copied[static_cast<std::size_t>(k)]];
      return exchanges->next();
    };
    rows.add_ghosts = [copied](tp::ConstVector ghosts, tp::Vector y) {
      for (Eigen::Index k = 0; k < ghosts.size(); ++k)
        y[copied[static_cast<std::size_t>(k)]] += ghosts[k];
    };
  }
  rows.fill = [fill = given.fill, n](double t, tp::ConstVector y, tp::Vector entries) {
    return fill(t, tp::ConstVector(y.data(), n), entries);
  };
  tp::Constraints out = sparse;
  out.value = [value = sparse.value, n](double t, tp::ConstVector y, tp::Vector g) {
    return value(t, tp::ConstVector(y.data(), n), g);
  };
  out.jacobian = std::move(rows);
  return out;
}

/// All coordinates of two masses in the middle: every row there is spread.
std::vector<int> middle() {
  std::vector<int> columns;
  for (const int first : {0, 2 * kMasses})
    for (int k = 0; k < 4; ++k) columns.push_back(first + kMasses + k);
  return columns;
}

}  // namespace

TEST_CASE("distributed rows: the same motion as sparse ones") {
  const RodChain chain(kMasses, kRod);
  const Problem problem = chain.problem(1.0);
  const tp::Constraints sparse = chain.sparse_rows();
  for (const double tolerance : {1e-4, 1e-7}) {
    const Run given = integrate(problem, tolerance, sparse, {}, false);
    for (const auto& copied : {std::vector<int>{}, middle()}) {
      INFO("tolerance " << tolerance << ", ghosts " << copied.size());
      Host host(problem, tolerance);
      host.attach(as_distributed(sparse, problem.size, copied));
      REQUIRE(host.finish() >= 0);
      const tp::Statistics statistics = host.projection().statistics();
      CHECK(statistics.failures() == 0);
      CHECK(std::abs(host.steps() - given.steps) <= 0.05 * static_cast<double>(given.steps));
      const std::vector<double> y = host.state();
      for (std::size_t i = 0; i < y.size(); ++i)
        CHECK(std::abs(y[i] - given.y[i]) <= 100.0 * tolerance);
      CHECK(statistics.largest_drift_after < 1e-3 * tolerance);
    }
  }
}

TEST_CASE("distributed rows: the nearest point is that of sparse rows") {
  const RodChain chain(kMasses, kRod);
  const Problem problem = chain.problem(1.0);
  std::vector<double> far = problem.y0;
  for (std::size_t i = 0; i < far.size(); ++i)
    far[i] += 1e-4 * std::sin(static_cast<double>(3 * i + 1));
  const auto nearest = [&](const tp::Constraints& rows) {
    Host host(problem, 1e-8);
    host.attach(rows);
    N_Vector y = host.vector(far), yp = host.vector(problem.yp0);
    const tp::ConsistencyReport report = host.projection().project(0.0, y, yp);
    CHECK(report.status == tp::Status::success);
    const double* values = N_VGetArrayPointer(y);
    return std::vector<double>(values, values + problem.size);
  };
  const std::vector<double> sparse = nearest(chain.sparse_rows());
  for (const auto& copied : {std::vector<int>{}, middle()}) {
    const std::vector<double> spread =
        nearest(as_distributed(chain.sparse_rows(), problem.size, copied));
    for (std::size_t i = 0; i < spread.size(); ++i) CHECK(std::abs(spread[i] - sparse[i]) < 1e-7);
    CHECK(value(chain.sparse_rows(), 0.0, spread.data(), problem.size).cwiseAbs().maxCoeff() <
          1e-12);
  }
}

TEST_CASE("distributed rows: an energy joined to them") {
  const RodChain chain(kMasses, kRod);
  const Problem problem = chain.problem(1.0);
  const int n = problem.size;
  const tp::Constraints energy = gradients_of(chain.energy_row(), n);
  const tp::Constraints dense = chain.dense_rows() + chain.energy_row();
  const Run given = integrate(problem, 1e-5, dense, {}, false);
  for (const auto& copied : {std::vector<int>{}, middle()}) {
    INFO("ghosts " << copied.size());
    const tp::Constraints spread = as_distributed(chain.sparse_rows(), n, copied);
    Host host(problem, 1e-5);
    host.attach(spread + energy);
    while (host.t < problem.t_end) REQUIRE(host.step() >= 0);
    const tp::Statistics statistics = host.projection().statistics();
    CHECK(statistics.failures() == 0);
    CHECK(statistics.rank_drops == 0);
    CHECK(std::abs(host.steps() - given.steps) <= 0.05 * static_cast<double>(given.steps));
    CHECK(value(dense, 0.0, host.data(), n).cwiseAbs().maxCoeff() < 1e-7);

    // The rows move what depends on them; another value of it contradicts them.
    tp::Constraints again = gradients_of(chain.dense_rows(), n);
    again.names.assign(static_cast<std::size_t>(again.count), "copy");
    const Run twice = integrate(problem, 1e-5, spread + energy + again, {}, false);
    CHECK(twice.flag >= 0);
    CHECK(twice.statistics.rank_drops == twice.statistics.factorizations);
    CHECK(std::abs(twice.steps - given.steps) <= given.steps / 10);
    tp::Gradients other = std::get<tp::Gradients>(again.jacobian);
    other.value = [value = other.value](double t, N_Vector y, double* g) {
      value(t, y, g);
      g[3] += 0.01;
    };
    again.jacobian = other;
    const Run refused = integrate(problem, 1e-5, spread + again, {}, false);
    CHECK(refused.flag < 0);
    CHECK(refused.status == tp::Status::inconsistent);
    CHECK(contains(refused.message, "copy contradicts"));
  }
}

TEST_CASE("distributed rows: redundant ones serve, contradicting ones are named") {
  const tp::Constraints once = as_sparse(on_circle(), 2);
  for (const double square : {1.0, 2.0}) {
    tp::Constraints twice = once;
    twice.count = 2;
    twice.names = {"circle", "other circle"};
    twice.value = [square](double, tp::ConstVector y, tp::Vector g) {
      for (int i = 0; i < 2; ++i) g[i] = 0.5 * (y.squaredNorm() - (i == 0 ? 1.0 : square));
    };
    tp::SparseJacobian both;
    both.starts = {0, 2, 4};
    both.columns = {0, 1, 0, 1};
    both.fill = [](double, tp::ConstVector y, tp::Vector entries) {
      entries << y[0], y[1], y[0], y[1];
    };
    twice.jacobian = both;
    // The first row sees ghosts, the second the unknowns themselves.
    const Run run =
        integrate(tether::test::circle(5.0), 1e-6, as_distributed(twice, 2, {0, 1}), {}, false);
    if (square == 1.0) {
      REQUIRE(run.flag >= 0);
      CHECK(run.statistics.failures() == 0);
      CHECK(run.statistics.largest_drift_after < 1e-10);
    } else {
      CHECK(run.flag < 0);
      CHECK(run.status == tp::Status::inconsistent);
      CHECK(contains(run.message, "other circle"));
      CHECK(run.steps == 0);
    }
  }
}

TEST_CASE("distributed rows: a ghost that fails once costs an attempt, for good the run") {
  const RodChain chain(kMasses, kRod);
  const Problem problem = chain.problem(0.3);
  for (const int flag : {1, -1})
    for (const int fails : {0, 1, 7, 50, 51, 52, 53}) {
      INFO("flag " << flag << " from call " << fails);
      const auto exchanges = std::make_shared<Exchanges>();
      exchanges->flag = flag;
      exchanges->fails = fails;
      Host host(problem, 1e-5);
      host.attach(as_distributed(chain.sparse_rows(), problem.size, middle(), exchanges));
      const int outcome = host.finish();
      REQUIRE(exchanges->calls > fails);
      if (flag > 0) {
        CHECK(outcome >= 0);
      } else {
        CHECK(outcome < 0);
        CHECK(host.projection().status() == tp::Status::callback_fatal);
        CHECK(contains(host.projection().message(), "update_ghosts returned -1"));
      }
    }
}

TEST_CASE("distributed rows: values that are no number fail the step by name") {
  const RodChain chain(kMasses, kRod);
  tp::Constraints rows = as_distributed(chain.sparse_rows(), 4 * kMasses, middle());
  const auto value = rows.value;
  rows.value = [value](double t, tp::ConstVector y, tp::Vector g) {
    value(t, y, g);
    if (t > 0.0) g[3] = std::nan("");
  };
  const Run run = integrate(chain.problem(1.0), 1e-5, rows, {}, false);
  CHECK(run.flag < 0);
  CHECK(run.status == tp::Status::not_finite);
  CHECK(contains(run.message, "g of row 3 is not finite"));
}

TEST_CASE("distributed rows: what cannot work is refused by name") {
  const RodChain chain(kMasses, kRod);
  const int n = 4 * kMasses;
  const auto refusal = [&](auto change) {
    tp::Constraints rows = as_distributed(chain.sparse_rows(), n, middle());
    change(std::get<tp::DistributedRows>(rows.jacobian), rows);
    Host host(chain.problem(1.0), 1e-5);
    return thrown([&] { host.attach(rows); });
  };
  using Rows = tp::DistributedRows;
  const auto expect = [&](const char* text, auto change) {
    INFO(text);
    CHECK(contains(refusal([&](Rows& rows, tp::Constraints&) { change(rows); }), text));
  };
  expect("unknowns = 7", [](Rows& rows) { rows.unknowns = 7; });
  expect("ghosts = -1", [](Rows& rows) { rows.ghosts = -1; });
  expect("update_ghosts and add_ghosts", [](Rows& rows) { rows.add_ghosts = nullptr; });
  expect("fill is empty", [](Rows& rows) { rows.fill = nullptr; });
  expect("starts has", [](Rows& rows) { rows.starts.pop_back(); });
  expect("it must be 0 .. 55", [](Rows& rows) { rows.columns[3] = 56; });
  expect("each column once", [](Rows& rows) { rows.columns[1] = rows.columns[0]; });
  CHECK(contains(refusal([](Rows&, tp::Constraints& set) { set.value = nullptr; }), "value"));
  const tp::Constraints rows = as_distributed(chain.sparse_rows(), n);
  const tp::Constraints gradients = gradients_of(chain.energy_row(), n);
  CHECK(contains(thrown([&] { (void)(rows + chain.energy_row()); }), "only Gradients"));
  CHECK(contains(thrown([&] { (void)(gradients + rows); }), "come first"));
  CHECK(contains(thrown([&] { (void)(rows + rows); }), "come first"));
}
