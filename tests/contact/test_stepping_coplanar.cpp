// Faces, edges and corners that are flush up to rounding: contact points, areas, motion.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <random>

#include "stepping/detection/polyhedra/polyhedra.hpp"
#include "stepping_stacks.hpp"
#include "support/catch.hpp"

namespace {

using namespace stepping_scenes;
using Real = long double;
using Vector2r = Eigen::Matrix<Real, 2, 1>;
using Vector3r = Eigen::Matrix<Real, 3, 1>;
using Matrix3r = Eigen::Matrix<Real, 3, 3>;
using Polygon = std::vector<Vector2r>;

Real cross(const Vector2r& a, const Vector2r& b) { return a.x() * b.y() - a.y() * b.x(); }

// Area of the convex hull (Andrew's chain).
Real area_of(Polygon p) {
  std::sort(p.begin(), p.end(), [](const Vector2r& a, const Vector2r& b) {
    return a.x() < b.x() || (a.x() == b.x() && a.y() < b.y());
  });
  Real twice = 0;
  for (const int side : {1, -1}) {
    Polygon chain;
    for (const Vector2r& q : p) {
      while (chain.size() > 1 &&
             side * cross(chain.back() - chain[chain.size() - 2], q - chain.back()) <= 0)
        chain.pop_back();
      chain.push_back(q);
    }
    for (std::size_t k = 0; k + 1 < chain.size(); ++k)
      twice += side * cross(chain[k], chain[k + 1]);
  }
  return twice / 2;
}

// Corners of each inside the other, and crossings of their sides: what they share is their hull.
Real shared_area(const Polygon& a, const Polygon& b) {
  Polygon all;
  const auto side = [](const Polygon& p, std::size_t k) -> Vector2r {
    return p[(k + 1) % p.size()] - p[k];
  };
  const auto add_inside = [&](const Polygon& p, const Polygon& q) {
    for (const Vector2r& x : p) {
      bool in = true;
      for (std::size_t k = 0; k < q.size(); ++k) in = in && cross(side(q, k), x - q[k]) >= 0;
      if (in) all.push_back(x);
    }
  };
  add_inside(a, b);
  add_inside(b, a);
  for (std::size_t i = 0; i < a.size(); ++i)
    for (std::size_t j = 0; j < b.size(); ++j) {
      const Vector2r u = side(a, i), v = side(b, j), w = b[j] - a[i];
      const Real turn = cross(u, v);
      if (turn == 0) continue;
      const Real s = cross(w, v) / turn, t = cross(w, u) / turn;
      if (s >= 0 && s <= 1 && t >= 0 && t <= 1) all.push_back(a[i] + s * u);
    }
  return all.empty() ? 0 : area_of(all);
}

// A prism about the axis z: its flat outline, counterclockwise, and its height.
struct Prism {
  std::vector<Eigen::Vector2d> outline;
  double height;
  tc::Shape shape() const {
    std::vector<Vector3d> points;
    for (const double z : {-height / 2, height / 2})
      for (const Eigen::Vector2d& p : outline) points.emplace_back(p.x(), p.y(), z);
    return tc::Shape::convex(points);
  }
};

Prism rectangle(double x, double y, double height) {
  return {{{-x / 2, -y / 2}, {x / 2, -y / 2}, {x / 2, y / 2}, {-x / 2, y / 2}}, height};
}
Prism regular(int n, double radius, double height) {
  Prism p{{}, height};
  for (int k = 0; k < n; ++k)
    p.outline.emplace_back(radius * std::cos(2 * kPi * k / n), radius * std::sin(2 * kPi * k / n));
  return p;
}

// How far a point lies outside of the prism at a pose, in long double from the same data.
Real outside(const Prism& prism, const tc::Pose& pose, const Vector3d& point) {
  const Matrix3r R = pose.rotation.cast<Real>();
  const Vector3r x = R.inverse() * (point.cast<Real>() - pose.position.cast<Real>());
  Real most = std::abs(x.z()) - prism.height / 2;
  for (std::size_t k = 0; k < prism.outline.size(); ++k) {
    const Vector2r p = prism.outline[k].cast<Real>();
    const Vector2r along = prism.outline[(k + 1) % prism.outline.size()].cast<Real>() - p;
    most = std::max(most, -cross(along.normalized(), x.head<2>() - p));
  }
  return most;
}

struct Lay {
  double x, y, yaw, gap;  // of the upper prism on the lower one
};

struct Worst {
  double outside = 0, area = 0, normal = 0, gap = 0, depth = 0;  // of the size
  int empty = 0;
};

void compare(const Prism& lower, const Prism& upper, const Lay& lay, const Quaterniond& turn,
             double scale, Worst& worst) {
  Prism a = lower, b = upper;
  for (Prism* p : {&a, &b}) {
    p->height *= scale;
    for (Eigen::Vector2d& q : p->outline) q *= scale;
  }
  const Vector3d at =
      scale * Vector3d(lay.x, lay.y, lay.gap) + Vector3d(0, 0, (a.height + b.height) / 2);
  const Quaterniond own(AngleAxisd(lay.yaw, Vector3d::UnitZ()));
  const tc::Pose A{scale * Vector3d(1, -2, 0.5), turn.toRotationMatrix()};
  const tc::Pose B{A.position + turn * at, (turn * own).toRotationMatrix()};
  const tc::Shape first = a.shape(), second = b.shape();
  tc::NearPoints near;
  tc::detail::PolyhedraContacts().collide(first, tc::detail::make_polyhedron(first), A, second,
                                          tc::detail::make_polyhedron(second), B, 1e-3 * scale,
                                          near);

  const Matrix3r to_a = A.rotation.cast<Real>().inverse();
  const auto flat = [&](const Vector3d& p) -> Vector2r {
    return (to_a * (p.cast<Real>() - A.position.cast<Real>())).head<2>();
  };
  Polygon shared, one, other;
  for (int k = 0; k < near.count; ++k) {
    const tc::NearPoint& p = near.point[k];
    worst.outside = std::max({worst.outside, static_cast<double>(outside(a, A, p.on_first)) / scale,
                              static_cast<double>(outside(b, B, p.on_second)) / scale});
    const Vector3r d = p.on_first.cast<Real>() - p.on_second.cast<Real>();
    const double along = static_cast<double>(d.dot(p.normal.cast<Real>()));
    worst.gap = std::max(worst.gap, std::abs(along - p.gap) / scale);
    shared.push_back(flat(p.on_first));
  }
  for (const Eigen::Vector2d& p : a.outline) one.push_back(p.cast<Real>());
  for (const Eigen::Vector2d& p : b.outline)
    other.push_back(flat(B.position + B.rotation * Vector3d(p.x(), p.y(), -b.height / 2)));
  const Real wanted = shared_area(one, other), found = shared.empty() ? 0 : area_of(shared);
  worst.area =
      std::max(worst.area, static_cast<double>(std::abs(found - wanted)) / (scale * scale));
  // The sides may be what separates polygons that share next to nothing.
  if (wanted < 1e-5 * scale * scale) return;
  worst.empty += near.count < 3;
  for (int k = 0; k < near.count; ++k) {
    const tc::NearPoint& p = near.point[k];
    worst.normal = std::max(worst.normal, (p.normal + turn * Vector3d::UnitZ()).norm());
    worst.depth = std::max(worst.depth, std::abs(p.gap - scale * lay.gap) / scale);
  }
}

// A box on a table, its middle beyond the edge, laid a little askew.
Scene overhang(double dt, double x, double y, double yaw, const Quaterniond& turn) {
  Scene scene(dt);
  scene.options.gravity = turn * Vector3d(0, 0, -kGravity);
  scene.friction(0.5);
  const int table = scene.bodies.add_fixed(turn * Vector3d(0, 0, -0.5), turn);
  scene.surfaces.push_back({table, tc::Shape::box(Vector3d(1, 1, 1)), 0});
  scene.box({1, 1, 0.2}, 1, turn * Vector3d(x, y, 0.1),
            turn * Quaterniond(AngleAxisd(yaw, Vector3d::UnitZ())));
  return scene;
}

Quaterniond some_turn(int k) {
  return Quaterniond(std::cos(k + 0.3), std::sin(2.0 * k), std::cos(3.0 * k), std::sin(k * k + 1))
      .normalized();
}

}  // namespace

TEST_CASE("polyhedra: flush faces, edges and corners have points on both bodies and their area") {
  std::mt19937 generator(11);
  const auto below = [&](int n) { return std::uniform_int_distribution<int>(0, n - 1)(generator); };
  // 0 or +- 1e-16 .. 1e-6.
  const auto little = [&] {
    return below(4) == 0 ? 0.0
                         : (below(2) == 0 ? 1 : -1) *
                               std::pow(10, std::uniform_real_distribution<>(-16, -6)(generator));
  };
  const std::vector<Prism> prisms{rectangle(1, 1, 1),     rectangle(1, 1, 0.2),
                                  rectangle(0.5, 1, 0.3), regular(3, 0.6, 0.4),
                                  regular(6, 0.5, 0.5),   regular(12, 0.7, 0.3)};
  const std::vector<double> yaws{0, kPi / 2, kPi, kPi / 3, kPi / 6, kPi / 4, 0.1, -1.234};
  Worst worst;
  for (int trial = 0; trial < 6000; ++trial) {
    const Prism &a = prisms[static_cast<std::size_t>(below(6))],
                &b = prisms[static_cast<std::size_t>(below(6))];
    const double yaw = yaws[static_cast<std::size_t>(below(8))] + little();
    const double places[] = {0, 0.5, -0.5, 1, 0.25, 0.6};
    const Lay lay{places[below(6)] + little(), places[below(6)] + little(), yaw,
                  std::min(1e-7, std::abs(little())) * (below(2) == 0 ? 1 : -1)};
    const Quaterniond turn = trial % 3 == 0 ? Quaterniond::Identity() : some_turn(trial);
    const double scale = trial % 5 == 0 ? 1e-8 : trial % 5 == 1 ? 1e8 : 1;
    compare(a, b, lay, turn, scale, worst);
  }
  INFO("outside " << worst.outside << " area " << worst.area << " normal " << worst.normal
                  << " gap " << worst.gap << " depth " << worst.depth);
  CHECK(worst.outside < 1e-12);
  CHECK(worst.normal < 1e-14);
  CHECK(worst.gap < 1e-14);
  CHECK(worst.depth < 1e-14);
  CHECK(worst.area < 1e-6);  // corners within 1e-7 of the thickness are one
  CHECK(worst.empty == 0);
}

TEST_CASE("stepping: a box whose middle is beyond the edge of the table falls at every yaw") {
  const double dt = 1e-3;
  const auto run_of = [&](double y, double yaw, const Quaterniond& turn) {
    tc::Stepper s = overhang(dt, 0.6, y, yaw, turn).stepper();
    run(s, 0.3);
    return s.bodies();
  };
  const Quaterniond straight = Quaterniond::Identity();
  const tc::BodySet plain = run_of(0, 0, straight);
  // Turns about the edge: the angular acceleration is m g 0.1 / (I + m (0.1^2 + 0.1^2)).
  const double slope = kGravity * 0.1 / (1.04 / 12 + 0.02);
  CHECK(plain.motion[1].angular_velocity.y() > 0.3 * slope);
  std::mt19937 generator(3);
  std::uniform_real_distribution<> exponent(-16, -7);
  for (int k = 0; k < 24; ++k) {
    const double sign = k % 2 == 0 ? 1 : -1;
    const double yaw = k % 4 == 3 ? 0 : sign * std::pow(10, exponent(generator));
    const double y = k % 6 == 5 ? 0 : (k % 3 == 0 ? 1 : -1) * std::pow(10, exponent(generator));
    const Quaterniond turn = k % 2 == 0 ? straight : some_turn(k);
    const tc::BodySet b = run_of(y, yaw, turn);
    INFO("yaw " << yaw << " y " << y << " turned " << (k % 2 != 0));
    CHECK((turn.conjugate() * b.position[1] - plain.position[1]).norm() < 1e-5);
    CHECK((turn.conjugate() * b.motion[1].angular_velocity - plain.motion[1].angular_velocity)
              .norm() < 1e-4);
  }
  // With its middle above the table it stays, and by right angles as well.
  for (const double yaw : {0.0, 1e-9, kPi / 2, kPi / 2 + 1e-9, -kPi / 2 - 1e-12}) {
    tc::Stepper s = overhang(dt, 0.45, 1.98e-8, yaw, straight).stepper();
    run(s, 0.3);
    CHECK((position(s, 1) - Vector3d(0.45, 1.98e-8, 0.1)).norm() < 1e-9);
  }
}

TEST_CASE("stepping: a row of dominoes stays in its plane and never gains energy") {
  // Each of 0.15 x 0.5 x 1 m, 0.5 m apart; the first one is pushed. The wave of data of a failed
  // run: a corner 0.14 m away from both bodies.
  const double t = 0.15, h = 1, w0 = 4.698137929009748;
  for (const double turned : {0.0, 0.7}) {
    const Quaterniond turn(AngleAxisd(turned, Vector3d::UnitZ()));
    Scene scene(1e-3);
    scene.friction(0.3);
    scene.meetings = {{0, 0, 0.2, 0}, {0, 1, 0.5, 0}};
    scene.ground();
    const int n = 6;
    for (int k = 0; k < n; ++k)
      scene.box({t, 0.5, h}, 1, turn * Vector3d(0.65 * k, 0, h / 2), turn);
    scene.bodies.motion[1].angular_velocity = turn * Vector3d(0, w0, 0);
    scene.bodies.motion[1].velocity = turn * Vector3d(w0 * h / 2, 0, w0 * t / 2);
    tc::Stepper s = scene.stepper();
    double aside = 0, gained = 0, deepest = 0, last = tc::kinetic_energy(s.bodies());
    const auto energy = [&] {
      double sum = tc::kinetic_energy(s.bodies());
      for (int k = 1; k <= n; ++k) sum += kGravity * position(s, k).z();
      return sum;
    };
    last = energy();
    for (int k = 0; k < 600; ++k) {
      s.step();
      const double now = energy();
      gained = std::max(gained, now - last);
      last = now;
      deepest = std::max(deepest, s.penetration());
      for (int i = 1; i <= n; ++i)
        aside = std::max(aside, std::abs((turn.conjugate() * position(s, i)).y()));
    }
    INFO("turned " << turned << " aside " << aside << " gained " << gained << " deep " << deepest);
    CHECK(aside < 1e-4);
    CHECK(gained < 1e-9 * energy());
    CHECK(deepest < 1e-3);
  }
}
