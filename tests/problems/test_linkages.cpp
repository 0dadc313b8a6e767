// Tether: Bricard's linkage, the governor and long chains against published digits, and the sparse
// side of the chains. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <problems/bricard.hpp>
#include <problems/governor.hpp>
#include <problems/link_chain.hpp>
#include <problems/pinned_rods.hpp>
#include <tether/linalg/singular_values.hpp>

#include "oracle.hpp"
#include "support/catch.hpp"

using namespace tether::problems;
using namespace tether::problems::test;

namespace {

const Rows& group(const Problem& p, const std::string& name) {
  for (const Rows& rows : p.rows)
    if (rows.name == name) return rows;
  throw std::logic_error(p.name + " has no rows " + name);
}

Eigen::MatrixXd dense(const Problem& p, double cj, const Eigen::VectorXd& y,
                      const Eigen::VectorXd& yp) {
  Eigen::MatrixXd J(p.size, p.size);
  p.jacobian(0.0, cj, y.data(), yp.data(), J.data());
  return J;
}

}  // namespace

// design/hard_cases.md, A04: quadrature of the reduced motion, good to 11 digits.
TEST_CASE("Bricard's linkage: published point and kinetic energy") {
  struct Row {
    double t, x, y, z, kinetic;
  };
  for (const Row& row : {Row{0.5, 0.774717808038, -0.979815047655, -0.199906158955, 1.8075440491},
                         Row{1, 0.274481319262, -0.886707938734, -0.462330002688, 4.1455439080},
                         Row{2, -0.778135373035, -0.980352683444, -0.197252670616, 1.7849516887},
                         Row{5, 0.999932742302, -0.999999997738, -0.000067255436, 0.0006597536}}) {
    const BricardState at = bricard_exact(row.t);
    INFO(row.t);
    CHECK(std::abs(at.point[0] - row.x) < 1.2e-11);
    CHECK(std::abs(at.point[1] - row.y) < 1.2e-11);
    CHECK(std::abs(at.point[2] - row.z) < 1.2e-11);
    CHECK(std::abs(at.kinetic - row.kinetic) < 2e-10);
  }
}

TEST_CASE("Bricard's linkage: 24 rows of rank 23 all the way, the 23 of F independent") {
  for (const double t : {0.0, 0.4, 1.1, 1.24793, 2.0, 2.5, 4.0}) {
    const Problem p = bricard(std::max(t, 1e-3), "index 0");
    const Eigen::VectorXd y = vector(t == 0.0 ? p.y0 : p.reference);
    RowMajor all(24, p.size);
    all << jacobian(group(p, "position"), 0.0, y),
        jacobian(group(p, "redundant"), 0.0, y).topRows(1);
    CHECK(value(group(p, "redundant"), 0.0, y).cwiseAbs().maxCoeff() < 1e-14);
    INFO(t);
    const Eigen::VectorXd of_all = tether::linalg::singular_values(all);
    CHECK(of_all[23] < 1e-14);
    CHECK(of_all[22] > 0.25);
    const Eigen::VectorXd kept = tether::linalg::singular_values(all.topRows(23));
    CHECK(kept[22] > 0.05);
  }
}

// design/hard_cases.md, A05: Radau at 1e-11 and 1e-12.
TEST_CASE("governor: published motion and angular momentum") {
  struct Row {
    double t, height, speed, arm, spin;
  };
  for (const Row& row : {Row{0.1, 0.523836475570, 0.459271810436, 0.496173869076, 6.103717808831},
                         Row{0.5, 0.743249424786, 0.052119780158, 0.259491381543, 5.103415421971},
                         Row{1, 0.501420922380, -0.122151492898, 0.521833301626, 6.271125741876}}) {
    const GovernorState at = governor_exact(row.t);
    INFO(row.t);
    CHECK(std::abs(at.height - row.height) < 2e-12);
    CHECK(std::abs(at.speed - row.speed) < 2e-12);
    CHECK(std::abs(at.arm - row.arm) < 2e-12);
    CHECK(std::abs(at.spin - row.spin) < 4e-12);
  }
  const Problem p = governor(0.5, "index 0");
  Eigen::VectorXd still = Eigen::VectorXd::Zero(p.size);
  // The row is L - L(0): without velocities it is -L(0).
  still.head(13) = vector(p.y0).head(13);
  CHECK(-value(group(p, "angular momentum"), 0.0, still)[0] ==
        Approx(53.8689986584).epsilon(1e-12));
  CHECK(std::abs(value(group(p, "angular momentum"), 0.5, vector(p.reference))[0]) < 1e-12);
}

// Pin forces by blocks against absolute angles with a full matrix, and published digits of the tip.
TEST_CASE("link chain: two derivations agree, and the tip falls freely") {
  const Problem ten = link_chain(10, 0.4), angles = ten_link_chain(0.4, "index 0");
  for (std::size_t i = 0; i < 60; ++i)
    CHECK(std::abs(ten.reference[i] - angles.reference[i]) < 2e-14);
  for (const auto& [t, x] :
       {std::make_pair(0.25, 9.94908347500), std::make_pair(0.5, 9.66273921551)}) {
    const Problem p = link_chain(100, t);
    const double* last = p.reference.data() + 297;
    CHECK(std::abs(last[0] + 0.05 * std::cos(last[2]) - x) < 6e-12);
    CHECK(std::abs(last[1] + 0.05 * std::sin(last[2]) + 9.81 * t * t / 2.0) < 1e-11);
  }
  CHECK_THROWS_AS(link_chain(1, 1.0), std::invalid_argument);
  CHECK_THROWS_AS(link_chain(100001, 1.0), std::invalid_argument);
}

// Beyond the sizes that have a reference the start comes of a sparse factor; it must satisfy F.
TEST_CASE("link chain: a thousand links start as F asks") {
  const Problem p = link_chain(1000, 1.0);
  std::vector<double> r(static_cast<std::size_t>(p.size));
  p.residual(0.0, p.y0.data(), p.yp0.data(), r.data());
  const auto [least, most] = std::minmax_element(r.begin(), r.end());
  CHECK(std::max(-*least, *most) < 1e-10);
  CHECK(std::isnan(p.error(p.y0.data())));
}

TEST_CASE("link chain: the sparse Jacobian is the dense one") {
  const Problem p = link_chain(6, 0.3);
  std::mt19937 random(5);
  double t;
  const Eigen::VectorXd y = random_state(p, random, &t), yp = 3.0 * random_state(p, random, &t);
  const Eigen::MatrixXd expected = dense(p, 41.0, y, yp);
  std::vector<double> values(p.sparse.rows.size());
  p.sparse.fill(0.0, 41.0, y.data(), yp.data(), values.data());
  Eigen::MatrixXd given = Eigen::MatrixXd::Zero(p.size, p.size);
  for (int j = 0; j < p.size; ++j)
    for (int k = p.sparse.starts[static_cast<std::size_t>(j)];
         k < p.sparse.starts[static_cast<std::size_t>(j) + 1]; ++k)
      given(p.sparse.rows[static_cast<std::size_t>(k)], j) = values[static_cast<std::size_t>(k)];
  CHECK((given - expected).cwiseAbs().maxCoeff() == 0.0);
}

TEST_CASE("link chain: the sparse rows are the dense ones") {
  const Problem p = link_chain(6, 0.3);
  REQUIRE(p.sparse_constraints);
  std::mt19937 random(6);
  double t;
  const Eigen::VectorXd y = random_state(p, random, &t);
  const auto& sparse =
      std::get<tether::ida_projection::SparseJacobian>(p.sparse_constraints->jacobian);
  std::vector<double> g(24), entries(sparse.columns.size(), 0.0);
  const tether::ida_projection::ConstVector at(y.data(), p.size);
  REQUIRE(p.sparse_constraints->value(t, at, {g.data(), 24}) == 0);
  REQUIRE(sparse.fill(t, at, {entries.data(), static_cast<int>(entries.size())}) == 0);
  RowMajor given = RowMajor::Zero(24, p.size), expected(24, p.size);
  for (int i = 0; i < 24; ++i)
    for (int e = sparse.starts[static_cast<std::size_t>(i)];
         e < sparse.starts[static_cast<std::size_t>(i) + 1]; ++e)
      given(i, sparse.columns[static_cast<std::size_t>(e)]) = entries[static_cast<std::size_t>(e)];
  expected << jacobian(group(p, "position"), t, y), jacobian(group(p, "velocity"), t, y);
  CHECK((given - expected).cwiseAbs().maxCoeff() < 1e-15);
  Eigen::VectorXd values(24);
  values << value(group(p, "position"), t, y), value(group(p, "velocity"), t, y);
  CHECK((vector(g) - values).cwiseAbs().maxCoeff() < 1e-14);
  CHECK(p.sparse_constraints->total_count() == 25);
  CHECK(p.sparse_constraints->name(23) == "pin 5 y rate");
}
