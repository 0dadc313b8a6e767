// Bodies on planes: closed forms of the scheme and of the motion. SPDX-License-Identifier:
// BSD-3-Clause
#include <stdexcept>

#include "stepping_scenes.hpp"
#include "support/catch.hpp"

namespace {

using namespace stepping_scenes;

// A slope whose fall line has the given heading; gravity stays vertical, the ground is tilted.
struct Slope {
  Vector3d normal, down;
  Quaterniond turned;  // of a box that lies flat on it, yawed against the fall line
  Slope(double angle, double heading, double yaw = 0) {
    const Quaterniond spin(AngleAxisd(heading, Vector3d::UnitZ()));
    const Quaterniond tilt(AngleAxisd(angle, Vector3d::UnitY()));
    turned = spin * tilt * Quaterniond(AngleAxisd(yaw, Vector3d::UnitZ()));
    normal = spin * (tilt * Vector3d::UnitZ());
    down = spin * (tilt * Vector3d::UnitX());
  }
};

struct Slid {
  double along, aside, off, turned;  // m, rad
};

Slid slide(double mu, double dt, double seconds, double heading, double yaw, const Vector3d& size,
           tc::Law law = tc::Law::coulomb) {
  const Slope slope(radians(30), heading, yaw);
  Scene scene(dt);
  scene.options.law = law;
  scene.friction(mu);
  scene.ground(slope.normal);
  const Vector3d at = 0.5 * size[2] * slope.normal;
  const int box = scene.box(size, 1, at, slope.turned);
  tc::Stepper s = scene.stepper();
  run(s, seconds);
  const Vector3d moved = position(s, box) - at;
  return {moved.dot(slope.down), moved.dot(slope.normal.cross(slope.down)), moved.dot(slope.normal),
          s.bodies().orientation[1].angularDistance(slope.turned)};
}

}  // namespace

TEST_CASE("stepping: free fall has the closed sum of the scheme") {
  const double dt = GENERATE(1e-2, 1e-3);
  Scene scene(dt);
  const Vector3d start(1, 2, 3), v(0.5, -0.25, 4);
  scene.sphere(0.1, 2, start, v);
  tc::Stepper s = scene.stepper();
  const int n = 1000;
  for (int k = 0; k < n; ++k) s.step();
  const Vector3d exact =
      start + n * dt * v + Vector3d(0, 0, -kGravity) * dt * dt * n * (n + 1) / 2.0;
  CHECK((position(s, 0) - exact).norm() < 1e-13 * exact.norm() * n);
  CHECK(s.contacts().points.empty());
  CHECK(s.counts().contact_problems == 0);
}

TEST_CASE("stepping: any number may name a material, the last meeting of a pair counts") {
  // A table of all pairs of materials would not fit into memory.
  const int stone = 2000000000, ice = 7, floor = 2000000001, nothing = 1999999999;
  Scene scene;
  scene.ground();
  scene.surfaces[0].material = floor;
  const int rough = scene.sphere(0.5, 1, Vector3d(0, 0, 0.5), Vector3d(7, 0, 0));
  scene.surfaces.back().material = stone;
  const int smooth = scene.sphere(0.5, 1, Vector3d(0, 5, 0.5), Vector3d(7, 0, 0));
  scene.surfaces.back().material = ice;
  const int falls = scene.sphere(0.5, 1, Vector3d(0, 9, 0.5));
  scene.surfaces.back().material = nothing;
  scene.meetings = {{floor, stone, 0, 0}, {ice, floor, 0, 0}, {stone, floor, 0.3, 0}};
  tc::Stepper s = scene.stepper();
  run(s, 1.5);
  CHECK(velocity(s, rough).x() == Approx(5).epsilon(1e-12));
  CHECK(velocity(s, smooth).x() == 7);
  CHECK(position(s, falls).z() < -10);
}

TEST_CASE("stepping: incline at the angle of friction, every heading and step") {
  const double dt = GENERATE(1e-2, 1e-3);
  const double heading = radians(GENERATE(0.0, 36.87));
  const double part = GENERATE(1e-3, 1e-6);
  const double tangent = std::tan(radians(30)), T = 10;
  const Vector3d cube(1, 1, 1);
  const Slid stuck = slide(tangent * (1 + part), dt, T, heading, 0, cube);
  CHECK(std::abs(stuck.along) < 1e-9);
  CHECK(std::abs(stuck.aside) < 1e-9);
  CHECK(std::abs(stuck.off) < 1e-9);
  const Slid free = slide(tangent * (1 - part), dt, T, heading, 0, cube);
  const double a = kGravity * 0.5 * part;
  // An error of the tolerance in each step's impulse is one of tolerance * g in the acceleration.
  CHECK(free.along == Approx(a * T * (T + dt) / 2).margin(1e-9 * kGravity * T * T / 2));
  CHECK(std::abs(free.aside) < 1e-9);
  CHECK(free.turned < 1e-7);
}

TEST_CASE("stepping: incline with the box yawed by 45 degrees slides as far") {
  const double mu = 0.9 * std::tan(radians(30)), a = 0.1 * kGravity * 0.5, T = 5;
  for (const double dt : {1e-2, 1e-3}) {
    const Slid slid = slide(mu, dt, T, 0, radians(45), Vector3d(1, 1, 0.5));
    INFO("dt " << dt << " aside " << slid.aside << " turned " << slid.turned);
    CHECK(slid.along == Approx(a * T * (T + dt) / 2).epsilon(1e-6));
    CHECK(std::abs(slid.aside) < 1e-9);
    CHECK(slid.turned < 1e-7);
  }
}

TEST_CASE("stepping: above the angle of friction the box sticks at every yaw") {
  const double mu = 1.001 * std::tan(radians(30));
  for (const double yaw : {10.0, 22.5, 30.0, 45.0, 60.0}) {
    const Slid stuck = slide(mu, 1e-2, 10, 0.3, radians(yaw), Vector3d(1, 1, 0.5));
    INFO("yaw " << yaw);
    CHECK(std::hypot(stuck.along, stuck.aside, stuck.off) < 1e-9);
    CHECK(stuck.turned < 1e-9);
  }
}

TEST_CASE("stepping: sphere from sliding to rolling, both laws, every heading") {
  const tc::Law law = GENERATE(tc::Law::coulomb, tc::Law::maximum_dissipation);
  const double heading = GENERATE(0.0, 0.5, 0.6435, 2.0, 4.0);
  const double dt = GENERATE(1e-2, 1e-3);
  const Vector3d forward(std::cos(heading), std::sin(heading), 0);
  const double v0 = 7, mu = 0.3, R = 0.5;
  Scene scene(dt);
  scene.options.law = law;
  scene.friction(mu);
  scene.ground();
  const int ball = scene.sphere(R, 1, Vector3d(0, 0, R), v0 * forward);
  tc::Stepper s = scene.stepper();
  run(s, 2);
  CHECK((velocity(s, ball) - 5.0 / 7 * v0 * forward).norm() < 1e-12);
  CHECK((angular_velocity(s, ball) - Vector3d::UnitZ().cross(forward) * 5.0 / 7 * v0 / R).norm() <
        1e-12 / R * 10);
  const double exact =
      12 * v0 * v0 / (49 * mu * kGravity) + 5.0 / 7 * v0 * (2 - 2 * v0 / (7 * mu * kGravity));
  // The sum of the scheme: v0 dt / 7 short, and dt^2 for the step in which rolling starts.
  CHECK(position(s, ball).dot(forward) == Approx(exact - v0 * dt / 7).margin(5 * dt * dt));
  CHECK(std::abs(position(s, ball).dot(Vector3d::UnitZ().cross(forward))) < 1e-12);
  CHECK(std::abs(position(s, ball).z() - R) < 1e-12);
}

TEST_CASE("stepping: a sphere thrown with spin ends at (5 v0 + 2 R w0 x up)/7, whatever the axis") {
  const tc::Law law = GENERATE(tc::Law::coulomb, tc::Law::maximum_dissipation);
  const double R = 0.5, dt = GENERATE(1e-2, 1e-3);
  const Vector3d v0(2, 1, 0);
  // Forward, backward, sideways, and about the vertical, which no friction at a point ends.
  for (const Vector3d& w0 : {Vector3d(0, 20, 0), Vector3d(0, -20, 0), Vector3d(15, 0, 0),
                             Vector3d(-6, 9, 4), Vector3d(0, 0, 30)}) {
    Scene scene(dt);
    scene.options.law = law;
    scene.friction(0.3);
    scene.ground();
    const int ball = scene.sphere(R, 1, Vector3d(0, 0, R), v0, w0);
    tc::Stepper s = scene.stepper();
    run(s, 2);
    const Vector3d flat(w0.x(), w0.y(), 0), up = Vector3d::UnitZ();
    const Vector3d v = (5 * v0 + 2 * R * flat.cross(up)) / 7;
    INFO("w0 " << w0.transpose() << " dt " << dt);
    CHECK((velocity(s, ball) - v).norm() < 1e-11);
    CHECK((angular_velocity(s, ball) - up.cross(v) / R - Vector3d(0, 0, w0.z())).norm() < 1e-10);
  }
}
