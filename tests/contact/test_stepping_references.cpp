// Motions with known answers: the closed sums of the scheme where it has them, otherwise the
// continuous motion with the order of convergence in the time step. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
#include <array>
#include <functional>
#include <tether/linalg/shortest_turn.hpp>

#include "stepping_scenes.hpp"
#include "support/catch.hpp"

namespace {

using namespace stepping_scenes;

// A slope down `heading`, `up` its normal.
struct Fall {
  Vector3d up, down, axis;  // axis: of rolling down
  Fall(double angle, double heading) {
    const Quaterniond q = Quaterniond(AngleAxisd(heading, Vector3d::UnitZ())) *
                          Quaterniond(AngleAxisd(angle, Vector3d::UnitY()));
    up = q * Vector3d::UnitZ();
    down = q * Vector3d::UnitX();
    axis = q * Vector3d::UnitY();
  }
};

// y' = f(t, y) by the classical Runge-Kutta method, n steps; `stop` ends it.
template <int n>
using State = Eigen::Matrix<double, n, 1>;
template <int n, class F>
State<n> runge_kutta(const F& f, State<n> y, double T, int steps) {
  const double h = T / steps;
  for (int k = 0; k < steps; ++k) {
    const State<n> a = f(y), b = f(y + h / 2 * a), c = f(y + h / 2 * b), d = f(y + h * c);
    y += h / 6 * (a + 2 * b + 2 * c + d);
  }
  return y;
}

// Errors at dt, dt/2, dt/4: each quotient must be 2^order within the given part.
void check_order(const std::function<double(double)>& error, double dt, int order,
                 double part = 0.15) {
  const std::array<double, 3> e = {error(dt), error(dt / 2), error(dt / 4)};
  INFO("errors " << e[0] << " " << e[1] << " " << e[2]);
  CHECK(e[0] / e[1] == Approx(std::pow(2, order)).epsilon(part));
  CHECK(e[1] / e[2] == Approx(std::pow(2, order)).epsilon(part));
}

double tilt(const tc::Stepper& s, int body, const Quaterniond& from) {
  return s.bodies().orientation[static_cast<std::size_t>(body)].angularDistance(from);
}

}  // namespace

TEST_CASE("stepping: a block that slides to a stop is v0 dt / 2 short") {
  const double v0 = 2, mu = 0.3;
  for (const double dt : {1e-2, 1e-3}) {
    Scene scene(dt);
    scene.friction(mu);
    scene.ground();
    const int box = scene.box({0.4, 0.3, 0.2}, 1, {0, 0, 0.1});
    scene.bodies.motion[1].velocity = Vector3d(0.6, 0.8, 0) * v0;
    tc::Stepper s = scene.stepper();
    run(s, 1);
    // The last step before the stop is cut: at most mu g dt^2 / 8 from the parabola.
    const double path = v0 * v0 / (2 * mu * kGravity) - v0 * dt / 2;
    CHECK(position(s, box).head<2>().norm() == Approx(path).margin(mu * kGravity * dt * dt / 7));
    CHECK(velocity(s, box).norm() < 1e-9);
    CHECK(tilt(s, box, Quaterniond::Identity()) < 1e-9);
  }
}

TEST_CASE("stepping: spheres and cylinders on a slope roll or slide, with the sums of the scheme") {
  const double angle = radians(30), T = 1, R = 0.2;
  const double heading = GENERATE(0.0, 0.6435, 2.0);
  const double dt = GENERATE(1e-2, 1e-3);
  const bool cylinder = GENERATE(false, true);
  const tc::Law law = GENERATE(tc::Law::coulomb, tc::Law::maximum_dissipation);
  // At the ends of an axle friction is not opposite to slip under maximum dissipation.
  if (cylinder && law != tc::Law::coulomb) return;
  const Fall fall(angle, heading);
  // I = part m R^2; rolls for mu >= tan part/(1 + part).
  const double part = cylinder ? 0.5 : 0.4, limit = std::tan(angle) * part / (1 + part);
  for (const double mu : {limit * (1 + 1e-3), limit * (1 - 1e-3), 0.0}) {
    Scene scene(dt);
    scene.options.law = law;
    scene.friction(mu);
    scene.ground(fall.up);
    int body;
    if (cylinder) {
      // A capsule, its axis across the slope, with the inertia of a cylinder about that axis.
      const Quaterniond q = tether::linalg::shortest_turn(Vector3d::UnitZ(), fall.axis);
      body = scene.bodies.add(1, Vector3d(0.1, 0.1, part * R * R).asDiagonal().toDenseMatrix(),
                              R * fall.up, q);
      scene.surfaces.push_back({body, tc::Shape::capsule(R, 0.5), 0});
    } else {
      body = scene.sphere(R, 1, R * fall.up);
    }
    tc::Stepper s = scene.stepper();
    run(s, T);
    const bool rolls = mu > limit;
    const double a =
        kGravity * (rolls ? std::sin(angle) / (1 + part) : std::sin(angle) - mu * std::cos(angle));
    const double spin = rolls ? a * T / R : mu * kGravity * std::cos(angle) * T / (part * R);
    INFO((cylinder ? "cylinder" : "sphere") << " mu " << mu << " dt " << dt);
    CHECK((position(s, body) - R * fall.up - a * T * (T + dt) / 2 * fall.down).norm() < 1e-8);
    CHECK((velocity(s, body) - a * T * fall.down).norm() < 1e-8);
    CHECK((angular_velocity(s, body) - spin * fall.axis).norm() < 1e-7);
  }
}

TEST_CASE("stepping: a box tips where tan of the slope exceeds b/h, of order 1") {
  const double b = 0.5, h = 1, T = 2;
  const auto angle_after = [&](double slope, double dt) {
    const Fall fall(slope, 0.3);
    Scene scene(dt);
    scene.friction(2);
    scene.ground(fall.up);
    Matrix3d axes;
    axes << fall.down, fall.axis, fall.up;
    const Quaterniond q(axes);
    const int box = scene.box({b, 0.7, h}, 1, h / 2 * fall.up, q);
    tc::Stepper s = scene.stepper();
    run(s, T);
    return tilt(s, box, q);
  };
  CHECK(angle_after(std::atan(b / h * (1 - 1e-3)), 1e-3) < 1e-9);
  CHECK(angle_after(std::atan(b / h * (1 - 1e-3)), 1e-2) < 1e-9);
  // About the lower edge, psi from the vertical: psi'' = 3 g / (4 d) sin(psi), d half a diagonal.
  const double slope = std::atan(b / h * (1 + 1e-3)), d = std::hypot(b, h) / 2;
  const double start = slope - std::atan(b / h);
  const State<2> end = runge_kutta<2>(
      [&](const State<2>& y) { return State<2>(y[1], 0.75 * kGravity / d * std::sin(y[0])); },
      State<2>(start, 0), T, 20000);
  const double exact = end[0] - start;
  INFO("exact " << exact);
  REQUIRE(exact > 0.1);
  CHECK(angle_after(slope, 1e-3) == Approx(exact).epsilon(0.02));
  check_order([&](double dt) { return std::abs(angle_after(slope, dt) - exact); }, 4e-3, 1);
}

TEST_CASE("stepping: a domino turns about its edge as the pendulum does, of order 1") {
  // h = 1, t = 0.2. An edge that holds also when pulled would let it fall flat; from a tilt of some
  // 50 degrees on the ground would have to pull, so the comparison ends before.
  const double h = 1, t = 0.2, d = std::hypot(h, t) / 2, T = 0.35;
  const auto turned = [&](double w, double dt, double longest) {
    Scene scene(dt);
    scene.friction(20);
    scene.ground();
    const int box = scene.box({t, 0.5, h}, 1, {-t / 2, 0, h / 2});
    scene.bodies.motion[1].angular_velocity = Vector3d(0, w, 0);
    scene.bodies.motion[1].velocity = Vector3d(0, w, 0).cross(Vector3d(-t / 2, 0, h / 2));
    tc::Stepper s = scene.stepper();
    double energy = tc::kinetic_energy(s.bodies()) + kGravity * h / 2;
    while (s.time() < longest - dt / 2) {
      s.step();
      const double now = tc::kinetic_energy(s.bodies()) + kGravity * position(s, box).z();
      // The scheme moves with the velocity after the step: energies differ by g v dt.
      CHECK(now <= energy + kGravity * dt * std::abs(velocity(s, box).z()) + 1e-12);
      energy = now;
    }
    return tilt(s, box, Quaterniond::Identity());
  };
  const double start = -std::atan(t / h);
  const State<2> end = runge_kutta<2>(
      [&](const State<2>& y) { return State<2>(y[1], 0.75 * kGravity / d * std::sin(y[0])); },
      State<2>(start, 2), T, 20000);
  const double exact = end[0] - start;
  REQUIRE(exact > 0.5);
  CHECK(turned(2, 1e-3, T) == Approx(exact).margin(5e-3));
  check_order([&](double dt) { return std::abs(turned(2, dt, T) - exact); }, 5e-3, 1);
  // It needs 0.7486069479 rad/s to go over its edge.
  CHECK(turned(0.7486069479 * 1.01, 2.5e-4, 4) == Approx(kPi / 2).margin(1e-3));
  CHECK(turned(0.7486069479 * 0.99, 2.5e-4, 4) < 0.2);  // it comes back and rocks
}
