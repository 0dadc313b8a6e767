// More motions with known answers: rods, discs, bowls, hoppers. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
#include <array>
#include <functional>
#include <tether/linalg/index.hpp>
#include <tether/linalg/shortest_turn.hpp>

#include "stepping_scenes.hpp"
#include "support/catch.hpp"

namespace {

using namespace stepping_scenes;

using tether::linalg::at;

// A slender rod (m = 1, L = 1) whose lower end touches the ground at the origin, leaning towards +x
// by `angle` from the ground. Sliding that end towards +x digs it in, towards -x lifts it.
struct Rod {
  Scene scene;
  int body;
  double a, c;  // A_nn, |A_tn| of the contact
  Rod(double angle, double mu, const Vector3d& v, tc::Law law) : scene(1e-3) {
    scene.options.law = law;
    scene.friction(mu);
    scene.ground();
    const Vector3d middle(-0.5 * std::cos(angle), 0, 0.5 * std::sin(angle));
    const Quaterniond q(AngleAxisd(angle, Vector3d::UnitY()));
    body = scene.bodies.add(1, Vector3d(1e-3, 1.0 / 12, 1.0 / 12).asDiagonal().toDenseMatrix(),
                            middle, q, v);
    scene.surfaces.push_back({body, tc::Shape::touching_points({{0.5, 0, 0}, {-0.5, 0, 0}}), 0});
    a = 1 + 3 * std::cos(angle) * std::cos(angle);
    c = 3 * std::sin(angle) * std::cos(angle);
  }
};

// Vertical and horizontal impulse on the body in the last step.
Vector3d impulse(const tc::Stepper& s) {
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& p : s.contacts().impulses) sum += p;
  return sum;
}

// A ball in a hollow sphere or cone is at every moment a ball on the tangent plane: the plane, body
// 0, is put there before each step.
void put_plane(tc::Stepper& s, const Vector3d& on, const Vector3d& normal) {
  s.bodies().position[0] = on;
  s.bodies().orientation[0] = tether::linalg::shortest_turn(Vector3d::UnitZ(), normal);
}

struct Swing {
  double period, energy;  // third minus first crossing of the lowest point; largest change, J
};

Swing bowl(double start, double dt, bool rolling, double duration) {
  const double R = 1, r = 0.1;
  Scene scene(dt);
  scene.options.tolerance = 1e-12;
  scene.friction(rolling ? 1 : 0);
  scene.ground();
  const double heading = 0.4;
  const Vector3d out(std::cos(heading), std::sin(heading), 0);
  const int ball =
      scene.sphere(r, 1, (R - r) * (std::sin(start) * out - std::cos(start) * Vector3d::UnitZ()));
  tc::Stepper s = scene.stepper();
  const auto energy = [&] {
    return tc::kinetic_energy(s.bodies()) + kGravity * position(s, ball).z();
  };
  const double E = energy();
  std::vector<double> crossings;
  Swing swing{0, 0};
  double last = start;
  while (s.time() < duration || crossings.size() < 3) {
    const Vector3d d = position(s, ball).normalized();
    put_plane(s, R * d, -d);
    s.step();
    const double x = position(s, ball).dot(out), angle = std::atan2(x, -position(s, ball).z());
    if ((angle < 0) != (last < 0)) crossings.push_back(s.time() - dt * angle / (angle - last));
    last = angle;
    swing.energy = std::max(swing.energy, std::abs(energy() - E));
  }
  swing.period = crossings[2] - crossings[0];
  return swing;
}

}  // namespace

TEST_CASE("stepping: Painleve's rod, one answer below the critical friction") {
  // Critical: (4 + t^2)/(3 t), t = tan(angle): 5/3 at 45 degrees, 4/3 at 63.435 (the least).
  for (const double degrees : {45.0, 63.434948822922, 70.0})
    for (const tc::Law law : {tc::Law::coulomb, tc::Law::maximum_dissipation})
      for (const double direction : {1.0, -1.0}) {
        const double t = std::tan(radians(degrees)), critical = (4 + t * t) / (3 * t);
        const double mu = 0.95 * critical, dt = 1e-3;
        const Rod rod(radians(degrees), mu, Vector3d(direction, 0, 0), law);
        CHECK(rod.a / rod.c == Approx(critical));
        tc::Stepper s = rod.scene.stepper();
        s.step();
        const Vector3d p = impulse(s);
        const double n = kGravity * dt / (rod.a - direction * mu * rod.c);
        INFO(degrees << " degrees, " << tc::name(law) << ", direction " << direction);
        CHECK(s.status() == tc::Status::solved);
        CHECK(p.z() == Approx(n).epsilon(1e-8));
        CHECK(p.x() == Approx(-direction * mu * n).epsilon(1e-8));
      }
}

TEST_CASE("stepping: Painleve's rod, above the critical friction it jams with a finite impulse") {
  const double degrees = GENERATE(45.0, 63.434948822922, 70.0);
  const tc::Law law = GENERATE(tc::Law::coulomb, tc::Law::maximum_dissipation);
  const double t = std::tan(radians(degrees)), mu = 1.2 * (4 + t * t) / (3 * t);
  // b_n, the speed of approach that gravity adds in a step, goes to zero: the impulse does not. It
  // stops the tip, A p = b with A = [1 + 3 cos^2, c; c, 1 + 3 sin^2], of determinant 4.
  for (const double gravity : {9.81, 1e-2, 1e-5, 1e-8}) {
    Rod rod(radians(degrees), mu, Vector3d(1, 0, 0), law);
    rod.scene.options.gravity = Vector3d(0, 0, -gravity);
    tc::Stepper s = rod.scene.stepper();
    s.step();
    const Vector3d p = impulse(s);
    INFO(degrees << " degrees, " << tc::name(law) << ", gravity " << gravity << ", impulse "
                 << p.transpose());
    REQUIRE(p.allFinite());
    CHECK(s.status() == tc::Status::solved);
    const double b = gravity * 1e-3, T = 5 - rod.a;
    CHECK(p.z() == Approx((T * b + rod.c) / 4).epsilon(1e-8));
    CHECK(p.x() == Approx(-(rod.a + rod.c * b) / 4).epsilon(1e-8));
    CHECK(p.head<2>().norm() <= mu * p.z() * (1 + 1e-9));
    CHECK(tc::kinetic_energy(s.bodies()) <= 0.5 + gravity * 1e-3);
  }
  // Separating, however slowly: no impulse, though a jam would satisfy the law.
  Rod rod(radians(degrees), mu, Vector3d(1, 0, 1e-9), law);
  rod.scene.options.gravity.reset();
  tc::Stepper s = rod.scene.stepper();
  s.step();
  CHECK(impulse(s).norm() == 0);
}

TEST_CASE("stepping: a ladder on an icy wall slips where mu < tan(lean)/2") {
  const double lean = GENERATE(0.3, 0.6, 1.0), dt = GENERATE(1e-2, 1e-3);
  for (const double part : {1e-3, -1e-3}) {
    Scene scene(dt);
    scene.bodies.add_fixed(Vector3d::Zero());
    scene.surfaces.push_back({0, tc::Shape::plane({0, 0, 1}), 1});
    scene.surfaces.push_back({0, tc::Shape::plane({1, 0, 0}), 2});
    scene.meetings = {{0, 1, std::tan(lean) / 2 * (1 + part), 0}, {0, 2, 0, 0}};
    const Quaterniond q(AngleAxisd(-lean, Vector3d::UnitY()));
    const int ladder =
        scene.bodies.add(1, Vector3d(1.0 / 12, 1.0 / 12, 1e-3).asDiagonal().toDenseMatrix(),
                         {0.5 * std::sin(lean), 0, 0.5 * std::cos(lean)}, q);
    scene.surfaces.push_back({ladder, tc::Shape::touching_points({{0, 0, -0.5}, {0, 0, 0.5}}), 0});
    const Vector3d start = scene.bodies.position[at(ladder)];
    tc::Stepper s = scene.stepper();
    run(s, 2);
    INFO("lean " << lean << " part " << part << " moved " << (position(s, ladder) - start).norm());
    if (part > 0)
      CHECK((position(s, ladder) - start).norm() < 1e-9);
    else
      CHECK((position(s, ladder) - start).norm() > 1e-3);
  }
}

TEST_CASE("stepping: a disc on three feet, sliding and spinning, follows its equations of motion") {
  // Feet at the height of the centre: each carries m g/3, whatever the friction. v1, v2, w, x, y,
  // angle.
  using Y = Eigen::Matrix<double, 6, 1>;
  const double R = 0.5, mu = 0.2, m = 2, I = 0.5 * m * R * R, T = 0.8;
  const auto feet = [&](double angle) {
    std::array<Vector3d, 3> r;
    for (int k = 0; k < 3; ++k)
      r[at(k)] =
          R * Vector3d(std::cos(angle + k * 2 * kPi / 3), std::sin(angle + k * 2 * kPi / 3), 0);
    return r;
  };
  const auto slope = [&](const Y& y) {
    Y d;
    d << 0, 0, 0, y[0], y[1], y[2];
    for (const Vector3d& r : feet(y[5])) {
      const Eigen::Vector2d u(y[0] - y[2] * r[1], y[1] + y[2] * r[0]);
      const Eigen::Vector2d f = -mu * m * kGravity / 3 * u.normalized();
      d[0] += f[0] / m;
      d[1] += f[1] / m;
      d[2] += (r[0] * f[1] - r[1] * f[0]) / I;
    }
    return d;
  };
  Y y;
  y << 2, 0, 8, 0, 0, 0;
  const int n = 20000;
  for (int k = 0; k < n; ++k) {
    const double h = T / n;
    const Y a = slope(y), b = slope(y + h / 2 * a), c = slope(y + h / 2 * b), d = slope(y + h * c);
    y += h / 6 * (a + 2 * b + 2 * c + d);
  }
  REQUIRE(y.head<2>().norm() > 0.3);
  const auto error = [&](double dt) {
    Scene scene(dt);
    scene.friction(mu);
    scene.ground();
    const int disc =
        scene.bodies.add(m, Vector3d(I / 2, I / 2, I).asDiagonal().toDenseMatrix(),
                         Vector3d::Zero(), Quaterniond::Identity(), {2, 0, 0}, {0, 0, 8});
    const auto r = feet(0);
    scene.surfaces.push_back({disc, tc::Shape::touching_points({r[0], r[1], r[2]}), 0});
    tc::Stepper s = scene.stepper();
    run(s, T);
    CHECK(std::abs(position(s, disc).z()) < 1e-10);
    return (velocity(s, disc).head<2>() - y.head<2>()).norm() +
           R * std::abs(angular_velocity(s, disc).z() - y[2]) +
           (position(s, disc).head<2>() - y.segment<2>(3)).norm();
  };
  const std::array<double, 3> e = {error(4e-3), error(2e-3), error(1e-3)};
  INFO("errors " << e[0] << " " << e[1] << " " << e[2]);
  CHECK(e[2] < 5e-3);
  CHECK(e[0] / e[1] == Approx(2).epsilon(0.15));
  CHECK(e[1] / e[2] == Approx(2).epsilon(0.15));
}

TEST_CASE(
    "stepping: a ball swings in a bowl, energy of order 1, period of small swings of order 2") {
  struct Case {
    double start;
    bool rolling;
    double period;
  };
  const Case c =
      GENERATE(Case{0.1, true, 2.253212448777}, Case{0.1, false, 1.904312087891},
               Case{kPi / 3, true, 2.416595820040}, Case{kPi / 3, false, 2.042396239266});
  std::array<Swing, 3> swing;
  std::array<double, 3> error;
  for (int k = 0; k < 3; ++k) {
    swing[at(k)] = bowl(c.start, 4e-3 / (1 << k), c.rolling, 3);
    error[at(k)] = std::abs(swing[at(k)].period / c.period - 1);
  }
  INFO("start " << c.start << " rolling " << c.rolling << " period " << error[0] << " " << error[1]
                << " " << error[2] << " energy " << swing[0].energy << " " << swing[1].energy << " "
                << swing[2].energy);
  // The wall turns the velocity once a step: v^2 dt/R^2 of the energy goes each second. A wide
  // swing that shrinks has a shorter period, which makes that of order 1, too.
  const bool wide = c.start > 0.5;
  const double order = wide ? 2 : 4;
  CHECK(error[2] < (wide ? 5e-4 : 1e-5));
  CHECK(error[0] / error[1] == Approx(order).epsilon(0.25));
  CHECK(error[1] / error[2] == Approx(order).epsilon(0.25));
  const double depth = kGravity * 0.9 * (1 - std::cos(c.start));
  CHECK(swing[2].energy < 0.03 * depth);
  CHECK(swing[0].energy / swing[1].energy == Approx(2).epsilon(0.15));
  CHECK(swing[1].energy / swing[2].energy == Approx(2).epsilon(0.15));
}

TEST_CASE("stepping: a ball circles in a cone at v^2 = g r / tan(half angle), of order 1") {
  const double half = radians(35), r = 0.1, orbit = 0.8;  // orbit: of the centre
  const double v = std::sqrt(kGravity * orbit / std::tan(half));
  const auto error = [&](double dt) {
    Scene scene(dt);
    scene.friction(0);
    scene.ground();
    // Apex such that the centre at this radius is r from the wall.
    const double apex = -(orbit / std::tan(half) + r / std::sin(half));
    const int ball = scene.sphere(r, 1, {orbit, 0, 0}, {0, v, 0});
    tc::Stepper s = scene.stepper();
    double most = 0;
    for (int k = 0; k < std::lround(2 / dt); ++k) {
      const Vector3d p = position(s, ball);
      const Vector3d out = Vector3d(p.x(), p.y(), 0).normalized();
      put_plane(s, Vector3d(0, 0, apex),
                -std::cos(half) * out + std::sin(half) * Vector3d::UnitZ());
      s.step();
      most = std::max(most, std::abs(position(s, ball).head<2>().norm() / orbit - 1));
    }
    CHECK(velocity(s, ball).norm() == Approx(v).epsilon(20 * dt));
    CHECK(impulse(s).norm() / dt == Approx(kGravity / std::sin(half)).epsilon(20 * dt));
    return most;
  };
  const std::array<double, 3> e = {error(2e-3), error(1e-3), error(5e-4)};
  INFO("errors " << e[0] << " " << e[1] << " " << e[2]);
  CHECK(e[1] < 0.02);
  CHECK(e[0] / e[1] == Approx(2).epsilon(0.1));
  CHECK(e[1] / e[2] == Approx(2).epsilon(0.1));
}

TEST_CASE("stepping: the bouncing ball comes to rest at Zeno's time, of order 1") {
  const bool cut = GENERATE(true, false);
  const double e = 0.5, h = 1, R = 0.1, zeno = 1.354570923;
  std::vector<double> late;
  for (const double dt : {4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4}) {
    Scene scene(dt);
    scene.options.restitution_threshold = 1e-3;
    scene.options.cut_at_impacts = cut;
    scene.friction(0, e);
    scene.ground();
    const int ball = scene.sphere(R, 1, {0, 0, R + h});
    tc::Stepper s = scene.stepper();
    double rest = 0;
    while (s.time() < 2) {
      s.step();
      if (std::abs(velocity(s, ball).z()) > 1e-9) rest = s.time();
    }
    INFO("dt " << dt << " at rest from " << rest);
    // Bounces below the threshold are left, and the rest of a step. Without cuts some twelve
    // bounces are two or three steps late each.
    const double left = 2 * 1e-3 * std::sqrt(kGravity * R) / kGravity / (1 - e);
    CHECK(std::abs(rest - zeno) < (cut ? left + dt : 36 * dt));
    late.push_back(rest - zeno);
    CHECK(std::abs(position(s, ball).z() - R) < dt / 10);
  }
  if (!cut) CHECK(late.front() / late.back() == Approx(16).epsilon(0.3));
}

TEST_CASE("stepping: a hopper carries the weight of its grains, loses none, and empties") {
  // Four boxes at 45 degrees about a square outlet of 5 diameters, closed by the floor. Narrower
  // ones may jam: whether an arch forms then depends on the last bit.
  const double r = 0.05, dt = 2e-3, outlet = 10 * r, length = 1.2;
  Scene scene(dt);
  scene.options.tolerance = 1e-4;
  scene.friction(0.3);
  scene.ground();
  for (int k = 0; k < 4; ++k) {
    const Quaterniond q = Quaterniond(AngleAxisd(k * kPi / 2, Vector3d::UnitZ())) *
                          Quaterniond(AngleAxisd(-kPi / 4, Vector3d::UnitY()));
    const Vector3d along = q * Vector3d::UnitX(), up = q * Vector3d::UnitZ();
    const Vector3d lip =
        Quaterniond(AngleAxisd(k * kPi / 2, Vector3d::UnitZ())) * Vector3d(outlet / 2, 0, 0);
    const int wall = scene.bodies.add_fixed(lip + 0.5 * length * along - 0.1 * up, q);
    scene.surfaces.push_back({wall, tc::Shape::box({length, 4, 0.2}), 1});
  }
  const int grains = 150;
  for (int k = 0; k < grains; ++k)
    scene.sphere(
        r, 1,
        {0.11 * (k % 5 - 2) + 0.004 * (k % 3), 0.11 * (k / 5 % 5 - 2), 0.75 + 0.11 * (k / 25)});
  tc::Stepper s = scene.stepper();
  double deepest = 0;
  const auto carried = [&] {
    double sum = 0;
    for (std::size_t k = 0; k < s.contacts().points.size(); ++k) {
      const tc::PointContact& c = s.contacts().points[k];
      const bool a = s.bodies().mass[at(c.first)] > 0, b = s.bodies().mass[at(c.second)] > 0;
      if (a != b) sum += (a ? 1 : -1) * s.contacts().impulses[k].z();
    }
    return sum;
  };
  while (s.time() < 6) {
    s.step();
    deepest = std::max(deepest, s.penetration());
  }
  double sum = 0;
  const double before = tc::momentum(s.bodies()).z();
  for (int k = 0; k < 500; ++k) {
    s.step();
    sum += carried();
  }
  const double change = tc::momentum(s.bodies()).z() - before;
  // Exact is the balance with the momentum of what still moves.
  CHECK(sum - change == Approx(grains * kGravity).epsilon(1e-9));
  CHECK(sum == Approx(grains * kGravity).epsilon(1e-3));
  // The floor drops away.
  s.bodies().position[0].z() = -5;
  run(s, 4);
  int inside = 0, below = 0;
  for (int i = 5; i < s.bodies().size(); ++i) {
    const Vector3d p = position(s, i);
    REQUIRE(p.allFinite());
    below += p.z() < 0;
    inside += p.z() >= 0;
    CHECK(p.z() > -5 + r - 0.01 * r - 1e-9);
    // Above the outlet nobody is outside of the walls.
    if (p.z() > r) CHECK(std::max(std::abs(p.x()), std::abs(p.y())) < p.z() + outlet / 2);
  }
  INFO("below " << below << " inside " << inside << " deepest " << deepest / r);
  CHECK(below + inside == grains);
  CHECK(below > grains * 9 / 10);
  CHECK(deepest < 0.01 * r);
}
