// Tether: points, steps and projections of second-order cones against their definitions.
// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <random>
#include <tether/linalg/cone_scaling.hpp>
#include <tether/linalg/friction_cone.hpp>

#include "support/catch.hpp"

using namespace tether::linalg;

namespace {

struct Random {
  std::mt19937 generator{3};
  std::normal_distribution<double> normal;
  double operator()() { return normal(generator); }
};

// A point of the cone with the gap x_n - |x_t| > 0.
void point(Random& random, double gap, double* x) {
  x[1] = random();
  x[2] = random();
  x[3] = gap;
  x[0] = tangent(x) + gap;
}

}  // namespace

// Towards the tip the boundary is touched, not crossed: the determinant has a double root there.
TEST_CASE("cones: a step towards the tip ends there, whatever the rounding") {
  Random random;
  for (int trial = 0; trial < 1000; ++trial) {
    double x[4];
    point(random, std::pow(10.0, -trial % 8), x);
    const double s = 0.1 + std::abs(random());
    const double d[3] = {-s * x[0], -s * x[1], -s * x[2]};
    const double t = longest(x, determinant(x), d);
    CHECK(t <= (1 + 1e-12) / s);
    CHECK(t >= (1 - 1e-3) / s);  // a double root is known to half of the digits
  }
}

TEST_CASE("cones: the longest step ends on the boundary, and there is none inwards") {
  Random random;
  for (int trial = 0; trial < 1000; ++trial) {
    double x[4];
    point(random, 0.1 + std::abs(random()), x);
    const double d[3] = {random(), random(), random()};
    const double t = longest(x, determinant(x), d);
    if (std::isinf(t)) {
      CHECK(d[0] >= std::hypot(d[1], d[2]));
      continue;
    }
    const double tangential = std::hypot(x[1] + t * d[1], x[2] + t * d[2]);
    CHECK(std::abs(x[0] + t * d[0] - tangential) < 1e-9 * (1 + tangential));
  }
}

TEST_CASE("cones: products of nearly orthogonal points keep their digits") {
  for (const double gap : {1e-3, 1e-9, 1e-15}) {
    const double x[4] = {1 + gap, 1, 0, gap}, u[4] = {1 + gap, -1, 1e-8, gap};
    // x_n u_n + x_t.u_t by hand: 2 gap + gap^2 and nothing else, to the rounding of |u_t|.
    const double rest = std::sqrt(1 + 1e-16) - 1;
    CHECK(product(x, u) == Approx(2 * gap + gap * gap + 0.5e-16 + rest).epsilon(1e-6));
  }
}

TEST_CASE("friction cone: the projection is the nearest point, beside, inside and behind it") {
  Random random;
  int zero = 0, same = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const double mu = 0.2 + 0.3 * (trial % 4);
    const double v[3] = {random(), random(), random()};
    double p[3] = {v[0], v[1], v[2]};
    project_cone(mu, p);
    CHECK(std::hypot(p[1], p[2]) <= mu * p[0] * (1 + 1e-14) + 1e-300);
    // The rest lies in the polar cone and is orthogonal to the point (Moreau).
    const double r[3] = {v[0] - p[0], v[1] - p[1], v[2] - p[2]};
    CHECK(r[0] + mu * std::hypot(r[1], r[2]) <= 1e-14);
    CHECK(std::abs(r[0] * p[0] + r[1] * p[1] + r[2] * p[2]) < 1e-14);
    zero += p[0] == 0;
    same += r[0] == 0;
  }
  CHECK(zero > 100);
  CHECK(same > 100);
}

TEST_CASE("friction cone: the slip variable is a root, and positive, for any coupling") {
  Random random;
  int roots = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const double w[2] = {random(), random()}, g[2] = {0.8 * random(), 0.8 * random()};
    const double s = slip(w[0], w[1], g[0], g[1]);
    CHECK(s >= 0);
    const double right = std::hypot(w[0] + s * g[0], w[1] + s * g[1]);
    if (std::hypot(g[0], g[1]) >= 1 && std::abs(s - right) > 1e-9 * (1 + s)) {
      // No s at all: |w + s g| stays above s.
      for (const double t : {0.1, 1.0, 10.0, 100.0})
        CHECK(std::hypot(w[0] + t * g[0], w[1] + t * g[1]) > t);
      continue;
    }
    CHECK(s == Approx(right).epsilon(1e-9));
    ++roots;
  }
  CHECK(roots > 1000);
}
