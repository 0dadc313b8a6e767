// Tether: rows that are nearly parallel, in the classes that keep them. SPDX-License-Identifier:
// BSD-3-Clause
#include <Eigen/Dense>
#include <cmath>
#include <nvector/nvector_serial.h>

#include "host.hpp"
#include "rows/gradient_rows.hpp"
#include "rows/row_trust.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using tether::linalg::MinimumNorm;

namespace {

/// (1, 0, 0), (1, sine, 0) and (0, 0, 1) in unit metric, factored.
MinimumNorm two_near_and_one(double sine) {
  MinimumNorm solver(3, 3);
  const Eigen::Matrix3d C{{1.0, 0.0, 0.0}, {1.0, sine, 0.0}, {0.0, 0.0, 1.0}};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) solver.row(i)[j] = C(i, j);
  const double D[3] = {1.0, 1.0, 1.0};
  REQUIRE(solver.factor(D));
  REQUIRE(solver.rank() == 3);
  return solver;
}

/// Teaches that unit rows turn by `angle` over a move of `length` tolerances.
void teach(tp::RowTrust* trust, MinimumNorm* solver, double angle, double length) {
  const std::vector<int> all = {0, 1, 2};
  std::vector<double> before = {1.0, 0.0, 0.0, 1.0, 1e-4, 0.0, 0.0, 0.0, 1.0}, after = before;
  after[8] = std::cos(angle);
  after[7] = std::sin(angle);
  std::copy_n(std::vector<double>(3, 1.0).data(), 3, solver->metric());
  trust->learn(*solver, all, all, 3, before, after, length);
}

}  // namespace

TEST_CASE("a thin row counts while it is twice as independent as C turns over the move") {
  MinimumNorm solver = two_near_and_one(1e-4);
  REQUIRE(tp::RowTrust::has_thin_rows(solver));
  REQUIRE(tp::RowTrust::firm_rows(solver) == 2);
  tp::RowTrust trust;
  CHECK(trust.trusted_rows(solver, 1e-6) == 2);  // nothing is known yet
  teach(&trust, &solver, 1e-3, 1.0);             // kappa = 1e-3: 2 kappa |dy| = 1e-4 at 0.05
  CHECK(trust.trusted_rows(solver, 0.048) == 3);
  CHECK(trust.trusted_rows(solver, 0.052) == 2);
  CHECK(trust.trusted_rows(solver, 100.0) == 2);  // the firm rows always count
}

TEST_CASE("how C turns is looked at again: after longer moves, and every 64th time") {
  MinimumNorm solver = two_near_and_one(1e-4);
  tp::RowTrust trust;
  CHECK(trust.must_learn());
  REQUIRE(trust.wants_to_learn(0.01));
  teach(&trust, &solver, 1e-5, 0.01);
  CHECK_FALSE(trust.must_learn());
  CHECK_FALSE(trust.wants_to_learn(0.03));
  CHECK(trust.wants_to_learn(0.05));
  CHECK_FALSE(trust.wants_to_learn(1e-4));
  int until = 0;
  while (!trust.wants_to_learn(0.01) && until < 100) ++until;
  CHECK(until >= 32);
  CHECK(until < 64);
  // Learning only ever makes it more careful.
  teach(&trust, &solver, 1e-3, 0.01);
  CHECK(trust.trusted_rows(solver, 1e-3) == 2);
  teach(&trust, &solver, 0.0, 0.01);
  CHECK(trust.trusted_rows(solver, 1e-3) == 2);
}

TEST_CASE("nearly parallel gradients are solved as exactly as their angle allows") {
  for (const double sine : {1e-3, 1e-6, 1e-9}) {
    INFO("sine " << sine);
    Context context;
    N_Vector like = N_VNew_Serial(4, context);
    const Eigen::Vector4d first = Eigen::Vector4d(3.0, 1.0, -2.0, 0.5).normalized();
    const Eigen::Vector4d second = first + sine * Eigen::Vector4d(0.3, -0.7, 0.1, 1.0);
    {
      tp::GradientRows rows(2, like);
      N_VConst(1.0, like);
      for (int j = 0; j < 4; ++j) {
        N_VGetArrayPointer(rows.gradients()[0])[j] = first[j];
        N_VGetArrayPointer(rows.gradients()[1])[j] = second[j];
      }
      REQUIRE(rows.factor(like, like) == -1);
      REQUIRE(rows.rank() == 2);
      tp::OwnedVector dy(like);
      rows.solve({0.0, 1.0}, like, dy);
      const Eigen::Map<const Eigen::Vector4d> found(N_VGetArrayPointer(dy));
      // A move as long as 1 / sine whose part along the first row is rounding.
      CHECK(std::abs(first.dot(found)) <= 1e-14 * found.norm());
      CHECK(found.norm() > 0.5 / sine);
    }
    N_VDestroy(like);
  }
}
