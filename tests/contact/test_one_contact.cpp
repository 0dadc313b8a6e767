// Tether: the one-contact laws against an independent reference. SPDX-License-Identifier:
// BSD-3-Clause
#include <cstdlib>
#include <tether/contact.hpp>

#include "random_contacts.hpp"
#include "support/catch.hpp"

using namespace tether::contact;
using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

int samples() {
  const char* text = std::getenv("TETHER_CONTACT_SAMPLES");
  return text ? std::atoi(text) : 20000;
}

}  // namespace

TEST_CASE("maximum dissipation is the least energy in every class") {
  for (const std::string& kind : random::classes()) {
    random::Generator generator(7);
    int failures = 0, most = 0;
    std::string first;
    for (int k = 0; k < samples(); ++k) {
      const random::Contact p = generator(kind);
      const OneContact s = solve_one(Law::maximum_dissipation, p.A, p.b, p.mu);
      most = std::max(most, s.evaluations);
      const char* failure = random::failure(p, s.impulse, 180);
      if (failure) {
        ++failures;
        if (first.empty()) first = failure;
      }
    }
    INFO(kind << ": " << failures << " failures, first: " << first);
    CHECK(failures == 0);
    CHECK(most <= 40);
  }
}

TEST_CASE("maximum dissipation: a singular block whose b leaves its range has the least energy") {
  // B = diag(1, 0): along y_1 the energy falls without end, up to the border of the cone.
  Matrix3d A;
  A << 1, 0.3, 0.2, 0.3, 1.09, 0.06, 0.2, 0.06, 0.04;
  for (const double h1 : {1e-3, 0.1, -0.7, 4.0})
    for (const double h0 : {0.0, 0.2, -1.5}) {
      const double mu = 0.6;
      const Vector3d b(1, h0 + 0.3, h1 + 0.2);
      const auto energy = [&](double y0, double y1) { return 0.5 * y0 * y0 - h0 * y0 - h1 * y1; };
      double least = 0;
      for (int k = 0; k < 100000; ++k) {
        const double phi = k * 6.283185307179586e-5, u0 = std::cos(phi), u1 = std::sin(phi);
        const double r = mu / (1 + mu * (0.3 * u0 + 0.2 * u1));
        least = std::min(least, energy(r * u0, r * u1));
      }
      const OneContact s = solve_one(Law::maximum_dissipation, A, b, mu);
      CAPTURE(h0, h1);
      CHECK(s.regime == Regime::sliding);
      CHECK(std::abs((A * s.impulse - b)[0]) < 1e-14);
      CHECK(energy(s.impulse[1], s.impulse[2]) == Approx(least).margin(1e-9));
    }
}

TEST_CASE("coulomb: friction opposes slip, cone and plane hold") {
  for (const std::string& kind : random::classes()) {
    random::Generator generator(11);
    int failures = 0;
    for (int k = 0; k < samples(); ++k) {
      const random::Contact p = generator(kind);
      const LocalBlock block(p.A, p.mu);
      LocalState s;
      solve_local(Law::coulomb, block, p.b, s);
      const Vector3d x(s.x[0], s.x[1], s.x[2]);
      const Vector3d w = block.matrix() * x - p.b;
      const double scale = block.matrix().cwiseAbs().maxCoeff() * x.norm() + p.b.norm();
      const double t = std::hypot(x[1], x[2]), tol = 1e-11 * scale;
      bool good = x.allFinite() && x[0] >= 0 && t <= p.mu * x[0] * (1 + 1e-12) + 1e-300;
      if (x[0] > 0) {
        good = good && std::abs(w[0]) <= tol;
        if (s.regime == Regime::sticking) good = good && w.tail<2>().norm() <= tol;
        if (s.regime == Regime::sliding && t > 0) {
          const Eigen::Vector2d u = x.tail<2>() / t;
          const double along = w.tail<2>().dot(u), across = w[2] * u[0] - w[1] * u[1];
          good = good && along <= tol && std::abs(across) <= tol && t >= p.mu * x[0] * (1 - 1e-9);
        }
      } else {
        good = good && w[0] >= -tol;
      }
      if (!good) ++failures;
    }
    INFO(kind << ": " << failures);
    CHECK(failures == 0);
  }
}

TEST_CASE("coulomb: started at any of its solutions, a strongly coupled contact stays there") {
  // Solutions from sign changes of |y| + g.y - k on a fine logarithmic grid of lambda; they share
  // nothing with the count by curvature that the library relies on.
  int several = 0;
  for (const std::string kind : {"condition_1e1", "condition_1e4", "condition_1e8", "rods",
                                 "hyperbolic", "mu_1000", "singular"}) {
    random::Generator generator(23);
    for (int k = 0; k < std::min(samples() / 10, 2000); ++k) {
      random::Contact p = generator(kind);
      if (k % 3 == 0) p.b[0] = -std::abs(p.b[0]);  // jams
      const LocalBlock L(p.A, p.mu);
      if (L.e <= 0.8 || p.mu == 0) continue;
      const Eigen::Vector2d beta(L.beta[0], L.beta[1]), g(L.g[0], L.g[1]);
      Eigen::Matrix2d V;
      V << L.cosine, -L.sine, L.sine, L.cosine;
      const Eigen::Vector2d h =
          V.transpose() * (p.b.tail<2>() - Eigen::Vector2d(L.c[0], L.c[1]) * (p.b[0] / L.a));
      const double limit = p.mu * p.b[0] / L.a;
      const auto y = [&](double l) -> Eigen::Vector2d { return h.array() / (beta.array() + l); };
      const auto excess = [&](double l) { return y(l).norm() + g.dot(y(l)) - limit; };
      const double first = 1e-7 * beta.minCoeff(),
                   last =
                       std::max(1e6 * beta.maxCoeff(), 4 * (1 + L.e) * h.norm() / std::abs(limit));
      double left = 0, at_left = excess(0);
      int found = (at_left <= 0) + (p.b[0] <= 0);
      const double factor = std::pow(last / first, 1e-3);
      for (double right = first; right <= last; right *= factor) {
        const double at_right = excess(right);
        if ((at_left > 0) != (at_right > 0)) {
          double lo = left, hi = right;
          for (int n = 0; n < 200; ++n) {
            const double middle = 0.5 * (lo + hi);
            ((excess(middle) > 0) == (at_left > 0) ? lo : hi) = middle;
          }
          const Eigen::Vector2d yt = V * y(lo);
          const Vector3d x(yt.norm() / p.mu, yt[0], yt[1]);
          LocalState s;
          for (int c = 0; c < 3; ++c) s.x[c] = x[c];
          solve_local(Law::coulomb, L, p.b, s);
          INFO(kind << " " << k << " lambda " << lo << " e " << L.e);
          CHECK((Vector3d(s.x[0], s.x[1], s.x[2]) - x).norm() <= 1e-5 * x.norm());
          CHECK(s.evaluations <= 500);
          ++found;
        }
        left = right;
        at_left = at_right;
      }
      several += found > 1;
    }
  }
  CHECK(several > 100);
}

TEST_CASE("the solution does not depend on the start") {
  random::Generator generator(3);
  for (const std::string kind : {"boxes", "hyperbolic", "condition_1e4"}) {
    for (int k = 0; k < 3000; ++k) {
      const random::Contact p = generator(kind);
      const LocalBlock block(p.A, p.mu);
      LocalState cold, warm;
      solve_local(Law::maximum_dissipation, block, p.b, cold);
      const Vector3d start = generator.vector();
      for (int c = 0; c < 3; ++c) warm.x[c] = start[c];
      solve_local(Law::maximum_dissipation, block, p.b, warm);
      REQUIRE(cold.regime == warm.regime);
      const random::Reduced r(p);
      const Eigen::Vector2d y(cold.x[1], cold.x[2]), z(warm.x[1], warm.x[2]);
      REQUIRE(std::abs(r.energy(y) - r.energy(z)) <= 1e-9 * (r.scale(y) + 1e-300));
    }
  }
}

TEST_CASE("rotating the tangents and scaling the units changes nothing else") {
  random::Generator generator(5);
  for (Law law : {Law::maximum_dissipation, Law::coulomb}) {
    for (int k = 0; k < 5000; ++k) {
      const random::Contact p = generator(k % 2 ? "boxes" : "rods");
      if (law == Law::coulomb && LocalBlock(p.A, p.mu).e > 0.8) continue;
      const double angle = generator.uniform(0, 6.28), s = std::exp(generator.uniform(-5, 5));
      Matrix3d R = Matrix3d::Identity();
      R.bottomRightCorner<2, 2>() << std::cos(angle), -std::sin(angle), std::sin(angle),
          std::cos(angle);
      const Vector3d x = solve_one(law, p.A, p.b, p.mu).impulse;
      const Vector3d y = solve_one(law, s * (R * p.A * R.transpose()), R * p.b, p.mu).impulse;
      REQUIRE((s * y - R * x).norm() <= 1e-9 * x.norm() + 1e-300);
    }
  }
}

TEST_CASE("a sphere: both laws are radial return") {
  random::Generator generator(17);
  for (int k = 0; k < 1000; ++k) {
    const double a = generator.uniform(0.1, 10), t = a * 3.5, mu = generator.uniform(0, 2);
    const Matrix3d A = Vector3d(a, t, t).asDiagonal();
    const Vector3d b = generator.vector();
    Vector3d expected = Vector3d::Zero();
    if (b[0] > 0) {
      expected << b[0] / a, b[1] / t, b[2] / t;
      const double length = expected.tail<2>().norm(), most = mu * expected[0];
      if (length > most) expected.tail<2>() *= most / length;
    }
    for (Law law : {Law::maximum_dissipation, Law::coulomb}) {
      REQUIRE((solve_one(law, A, b, mu).impulse - expected).norm() <=
              1e-12 * (expected.norm() + 1e-300));
    }
  }
}

// The admissible x_t next to the one that sticks; an end is at infinity where the cone opens there.
// In the plane both laws pick the same point.
Eigen::Vector2d planar(Law law, const Eigen::Matrix2d& A, const Eigen::Vector2d& b, double mu) {
  const double a = A(0, 0), c = A(0, 1), none = std::numeric_limits<double>::infinity();
  if (!(b[0] > 0)) return {0, 0};
  if (law == Law::frictionless) return {b[0] / a, 0};
  const double lower = a - mu * c > 0 ? -mu * b[0] / (a - mu * c) : -none;
  const double upper = a + mu * c > 0 ? mu * b[0] / (a + mu * c) : none;
  const double xt = std::clamp((b[1] - c * b[0] / a) / (A(1, 1) - c * c / a), lower, upper);
  return {(b[0] - c * xt) / a, xt};
}

TEST_CASE("planar contacts: closed form equals the contact in space") {
  random::Generator generator(19);
  for (int k = 0; k < 5000; ++k) {
    const double c = generator.uniform(-1, 1), mu = generator.uniform(0, 4);
    Eigen::Matrix2d A;
    A << 1, c, c, c * c + generator.uniform(0.01, 2);
    const Eigen::Vector2d b(generator.normal(), generator.normal());
    Matrix3d A3 = Matrix3d::Identity();
    A3.topLeftCorner<2, 2>() = A;
    for (Law law : {Law::maximum_dissipation, Law::coulomb, Law::frictionless}) {
      const Eigen::Vector2d flat = planar(law, A, b, mu);
      if (law == Law::coulomb && mu * std::abs(c) > 0.8) continue;  // several solutions
      const Vector3d x = solve_one(law, A3, Vector3d(b[0], b[1], 0), mu).impulse;
      REQUIRE(std::abs(x[2]) <= 1e-12 * (1 + x.norm()));
      REQUIRE((x.head<2>() - flat).norm() <= 1e-9 * (flat.norm() + 1e-300));
    }
  }
}

TEST_CASE("tangential impact at the Painleve limit: the map jumps at b_n = 0") {
  // Rod at tan(theta) = 2: |c|/a = 3/4, so e = 1 at mu = 4/3.
  const double mu = 4.0 / 3.0;
  Matrix3d A;
  A << 1.6, 1.2, 0, 1.2, 3.4, 0, 0, 0, 1;
  for (double factor : {1 - 1e-6, 1 + 1e-6}) {
    const Vector3d down(1e-12, -1, 0), up(-1e-12, -1, 0);
    CHECK(solve_one(Law::maximum_dissipation, A, up, mu * factor).impulse.isZero(0));
    const Vector3d x = solve_one(Law::maximum_dissipation, A, down, mu * factor).impulse;
    CHECK(random::failure({A, down, mu * factor}, x, 2000) == nullptr);
  }
}

TEST_CASE("waLBerla's case: b_n > 0 while the unconstrained normal impulse is negative") {
  Matrix3d A;
  A << 1, 0.9, 0, 0.9, 1, 0, 0, 0, 1;
  const Vector3d b(0.1, 1, 0.3);
  REQUIRE(A.inverse().row(0).dot(b) < 0);
  for (double mu : {0.0, 0.3, 1.0, 2.0, 1e3}) {
    CHECK(random::failure({A, b, mu}, solve_one(Law::maximum_dissipation, A, b, mu).impulse,
                          2000) == nullptr);
  }
}

// A grazing contact whose two tangents yield by 1e6 to 1.
TEST_CASE("one contact: a slip along very different tangents is found to round-off") {
  Matrix3d A;
  A << 0.27174634389719821, 0.26977126231934284, -0.00018346246674967736,  //
      0.26977126231934284, 1.30430747962033, 0.00030291632224983491,       //
      -0.00018346246674967736, 0.00030291632224983491, 3.8546642340108574e-07;
  const Vector3d b(1.7804478488988186e-53, -1.3066759270983948, 0.00023290633919364199);
  Options o;
  o.law = Law::coulomb;
  o.tolerance = 1e-12;
  const Problem p = Problem::dense(A, b, Eigen::VectorXd::Constant(1, 0.99978667686509826));
  const Solution s = Solver(o).solve(p);
  CHECK(s.status == Status::solved);
  const double error = evaluate(p, o.law, s.impulses).fixed_point;
  INFO(1e12 * error << " tolerances");
  CHECK(error <= 1e-12);
}

// mu / a is beyond the range of doubles, mu c / a is not: a body that approaches was "solved" at
// rest.
TEST_CASE("one contact: friction over a small A is not lost to overflow") {
  Matrix3d A = Matrix3d::Identity();
  A(0, 1) = A(1, 0) = 0.4;
  const Vector3d b(1, 0.2, 0.1);
  for (double size : {1e-307, 1e-300, 1.0}) {
    for (double mu : {1.5, 1e2, 1e150, 1e300}) {
      for (Law law : {Law::coulomb, Law::maximum_dissipation}) {
        Options o;
        o.law = law;
        o.max_work = 1e8;
        const Problem p = Problem::dense(size * A, b, Eigen::VectorXd::Constant(1, mu));
        const Solution s = Solver(o).solve(p);
        INFO(name(law) << ", A " << size << ", mu " << mu << ": " << name(s.status));
        CHECK(s.status == Status::solved);
        CHECK(s.velocities.norm() < 1e-9);
      }
    }
  }
}
