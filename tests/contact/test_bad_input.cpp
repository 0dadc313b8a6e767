// Tether: bad input is refused with a message. SPDX-License-Identifier: BSD-3-Clause
#include <limits>
#include <tether/contact.hpp>

#include "support/catch.hpp"

using namespace tether::contact;
using Eigen::MatrixXd;
using Eigen::VectorXd;

TEST_CASE("problems with wrong sizes or values are refused") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  const MatrixXd A = MatrixXd::Identity(6, 6);
  const VectorXd b = VectorXd::Ones(6), mu = VectorXd::Constant(2, 0.5);
  CHECK_NOTHROW(Problem::dense(A, b, mu));
  CHECK_THROWS_AS(Problem::dense(A, VectorXd::Ones(5), mu), std::invalid_argument);
  CHECK_THROWS_AS(Problem::dense(MatrixXd::Identity(5, 6), b, mu), std::invalid_argument);
  for (double bad : {nan, inf, -inf}) {
    MatrixXd C = A;
    C(0, 4) = bad;
    CHECK_THROWS_AS(Problem::dense(C, b, mu), std::invalid_argument);
    VectorXd q = b;
    q[3] = bad;
    CHECK_THROWS_AS(Problem::dense(A, q, mu), std::invalid_argument);
    VectorXd m = mu;
    m[1] = bad;
    CHECK_THROWS_AS(Problem::dense(A, b, m), std::invalid_argument);
  }
  CHECK_THROWS_AS(Problem::dense(A, b, VectorXd::Constant(2, -0.1)), std::invalid_argument);
  MatrixXd D = A;
  D(3, 3) = 0;  // no effective mass
  CHECK_THROWS_AS(Problem::dense(D, b, mu), std::invalid_argument);
  D = A;
  D(4, 4) = -1;
  CHECK_THROWS_AS(Problem::dense(D, b, mu), std::invalid_argument);
  CHECK_THROWS_AS(Problem::sparse(3, {{0, 2, Eigen::Matrix3d::Identity()}}, b, mu), std::invalid_argument);
  CHECK_THROWS_AS(Problem::sparse(4, {}, b, mu), std::invalid_argument);
  Problem p = Problem::dense(A, b, mu);
  CHECK_THROWS_AS(p.set_ids({1}), std::invalid_argument);
  CHECK_THROWS_AS(evaluate(p, Law::coulomb, VectorXd::Zero(5)), std::invalid_argument);
  CHECK_THROWS_AS(Solver().solve(p, VectorXd::Constant(6, nan)), std::invalid_argument);
  CHECK_THROWS_AS(Solver().solve(p, VectorXd::Zero(7)), std::invalid_argument);
}

TEST_CASE("illegal options are refused") {
  const auto refused = [](auto change) {
    Options o;
    change(o);
    CHECK_THROWS_AS(Solver(o), std::invalid_argument);
  };
  refused([](Options& o) { o.tolerance = 0; });
  refused([](Options& o) { o.tolerance = std::numeric_limits<double>::quiet_NaN(); });
  refused([](Options& o) { o.relaxation = 2; });
  refused([](Options& o) { o.method = Method::jacobi; o.relaxation = 1.5; });
  refused([](Options& o) { o.max_sweeps = 0; });
  refused([](Options& o) { o.max_work = -1; });
  refused([](Options& o) { o.anderson_depth = 21; });
}

TEST_CASE("nothing to do is done") {
  const Problem none = Problem::dense(MatrixXd(0, 0), VectorXd(0), VectorXd(0));
  const Solution s = Solver().solve(none);
  CHECK(s.status == Status::solved);
  CHECK(s.impulses.size() == 0);
  CHECK(Solution().status == Status::unsolved);
  const Problem rest = Problem::dense(MatrixXd::Identity(3, 3), VectorXd::Zero(3), VectorXd::Ones(1));
  CHECK(Solver().solve(rest).impulses.isZero(0));
}
