// Tether: errors on the brink of sliding, where block solutions jump. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <random>
#include <tether/contact.hpp>

#include "support/catch.hpp"

using namespace tether::contact;

namespace {

// Contacts on three freedoms, strongly coupled, and impulses x that solve them with b = A x - w:
// the first two on the cone, the others within; the first slides, if asked for, the others stick.
struct Brink {
  Eigen::MatrixXd A;
  Eigen::VectorXd mu, x, b;

  Brink(std::mt19937& random, bool slides) : mu(kContacts), x(3 * kContacts) {
    std::uniform_real_distribution<double> any(-1, 1);
    Eigen::MatrixXd H(3 * kContacts, 3);
    for (double& h : H.reshaped()) h = any(random);
    A = H * H.transpose();
    Eigen::VectorXd w = Eigen::VectorXd::Zero(3 * kContacts);
    for (int i = 0; i < kContacts; ++i) {
      mu[i] = 0.2 + 0.5 * (1 + any(random));
      const double angle = 3.14159 * any(random), part = i < 2 ? 1 : 0.5 * (1 + any(random));
      const Eigen::Vector2d u(std::cos(angle), std::sin(angle));
      x[3 * i] = 1 + 0.5 * any(random);
      x.segment<2>(3 * i + 1) = part * mu[i] * x[3 * i] * u;
      if (slides && i == 0) w.segment<2>(1) = -u;
    }
    b = A * x - w;
  }

  double error(const Eigen::VectorXd& of, Law law = Law::coulomb) const {
    return evaluate(Problem::dense(A, of, mu), law, x).fixed_point;
  }
  // The velocity scale: docs/method/contact.md, eq. 15.
  double scale(const Eigen::VectorXd& of) const {
    double out = 0;
    for (int i = 0; i < kContacts; ++i) {
      const double bn = of[3 * i], bt = of.segment<2>(3 * i + 1).norm();
      const double T = 0.5 * (A(3 * i + 1, 3 * i + 1) + A(3 * i + 2, 3 * i + 2));
      if (bn > 0) out = std::max(out, bn + std::min(bt, mu[i] * bn * T / A(3 * i, 3 * i)));
    }
    return out;
  }

  static constexpr int kContacts = 4;
};

}  // namespace

// 10 for 192 of the 2000 that stick, where the error was measured from block solutions alone.
TEST_CASE("brink: exact solutions on the cone have errors of round-off") {
  std::mt19937 random(5);
  double worst[2] = {0, 0};
  for (int k = 0; k < 4000; ++k) {
    const Brink brink(random, k % 2 == 1);
    worst[k % 2] = std::max(worst[k % 2], brink.error(brink.b));
  }
  CHECK(worst[0] < 1e-13);
  CHECK(worst[1] < 1e-13);
}

// The least change of b that is to be seen: an error that is too kind would fall below it, one that
// is measured from solutions far away is 1e4 times larger.
TEST_CASE("brink: errors are of the size of what b is off") {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> any(-1, 1);
  double least = 1e300, most = 0;
  for (int k = 0; k < 4000; ++k) {
    const Brink brink(random, k % 2 == 1);
    Eigen::VectorXd off(brink.b.size());
    for (double& d : off) d = 1e-4 * any(random);
    double largest = 0;
    for (int i = 0; i < Brink::kContacts; ++i)
      largest = std::max(largest, off.segment<3>(3 * i).norm());
    const Eigen::VectorXd b = brink.b + off;
    if (!(brink.scale(b) > 0)) continue;
    const double ratio = brink.error(b) * brink.scale(b) / largest;
    least = std::min(least, ratio);
    most = std::max(most, ratio);
  }
  CHECK(least > 0.3);
  CHECK(most < 10);
}

// Maximum dissipation separates wherever b_n <= 0.
TEST_CASE("brink: a jam at rest is a solution under Coulomb's law alone") {
  // A x = (-2, 15, 0): pressed and stuck, though b_n < 0.
  Eigen::Matrix3d A;
  A << 1, -3, 0, -3, 18, 0, 0, 0, 8;
  const Eigen::Vector3d x(1, 1, 0), b = A * x;
  const Problem p = Problem::dense(A, b, Eigen::VectorXd::Ones(1));
  CHECK(evaluate(p, Law::coulomb, x).fixed_point < 1e-13);
  CHECK(evaluate(p, Law::maximum_dissipation, x).fixed_point > 0.1);
}

// Four contacts on three freedoms stick, one on the brink of sliding: strongly coupled, it has
// another solution far away, and the last bit of b decided which one the error was measured from.
TEST_CASE("brink: what is solved is solved for evaluate(), too") {
  for (const unsigned seed : {1U, 11U}) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> any(-1, 1);
    int solved = 0;
    for (int k = 0; k < 3000; ++k) {
      const int n = 2 + k % 5;
      Eigen::MatrixXd H(3 * n, 3);
      for (double& h : H.reshaped()) h = any(random);
      Eigen::VectorXd u(3), mu(n);
      for (double& speed : u) speed = any(random);
      for (double& m : mu) m = 0.6 * (1 + any(random));
      for (int i = 0; i < n; ++i) H(3 * i, 0) = std::abs(H(3 * i, 0)) + 0.2 * H.row(3 * i).norm();
      const Problem problem = Problem::dense(H * H.transpose(), -H * u, mu);
      Options o;
      o.law = Law::coulomb;
      o.tolerance = 1e-6;
      o.max_work = 1e7;
      const Solution s = Solver(o).solve(problem);
      if (s.status != Status::solved) continue;
      ++solved;
      const double error = evaluate(problem, o.law, s.impulses).fixed_point;
      INFO("seed " << seed << ", problem " << k << ": " << s.error);
      CHECK(error <= o.tolerance);
    }
    CHECK(solved >= 2990);
  }
}
