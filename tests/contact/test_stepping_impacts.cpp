// Impacts with friction: one whole impact at every phase of the step, Newton's law with the cone,
// and when a body bounces. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <random>
#include <string>

#include "stepping_scenes.hpp"
#include "support/catch.hpp"

namespace {

using namespace stepping_scenes;

// Capobianco, Harsch, Eugster and Leine, A nonsmooth generalized-alpha method for mechanical
// systems with frictional contact (2021): a ball of R = 0.1, mu = 0.2, falls from 1 m with spin.
Scene rotating_ball(double dt, double restitution, const Vector3d& at, const Vector3d& v,
                    double spin) {
  Scene scene(dt);
  scene.friction(0.2, restitution);
  scene.ground();
  scene.sphere(0.1, 1, at, v, Vector3d(0, spin, 0));
  return scene;
}

// Velocity along x and spin about y in the mean of a window without impacts.
struct Flight {
  double v, spin, x;
};
Flight flight(tc::Stepper& s, double until) {
  run(s, until - s.time());
  return {velocity(s, 1).x(), angular_velocity(s, 1).y(), position(s, 1).x()};
}

// Order of errors that belong to halved steps, from the first to the last.
double order(const std::vector<double>& error) {
  return std::log2(error.front() / error.back()) / static_cast<double>(error.size() - 1);
}

}  // namespace

TEST_CASE("stepping: an inelastic impact with slip reversal is the same at every phase and step") {
  // One touching point of a rod at 45 degrees, 1 kg, 1 m, that comes with (0.1, -1) m/s: slip turns
  // round within the impact. A_nn = 1 + 12 * 0.125 = 2.5 = A_tt, A_nt = 1.5.
  const double exact = 0.1 + 0.3 / 2.05;
  for (const tc::Law law : {tc::Law::coulomb, tc::Law::maximum_dissipation})
    for (const double dt : {1e-2, 1e-3, 1e-4})
      for (int k = 0; k <= 20; ++k) {
        const Quaterniond turn(AngleAxisd(0.3 * k, Vector3d::UnitZ()));
        Scene scene(dt);
        scene.options.gravity.reset();
        scene.options.law = law;
        scene.friction(0.3);
        scene.ground();
        const Vector3d tip = turn * Vector3d(-std::sqrt(0.125), 0, -std::sqrt(0.125));
        scene.bodies.add(1, Matrix3d::Identity() / 12, Vector3d(0, 0, (3 + k / 20.0) * dt) - tip,
                         Quaterniond::Identity(), turn * Vector3d(0.1, 0, -1));
        scene.surfaces.push_back({1, tc::Shape::touching_points({tip}), 0});
        tc::Stepper s = scene.stepper();
        for (int n = 0; n < 10; ++n) s.step();
        INFO("dt " << dt << " phase " << k / 20.0);
        CHECK((turn.conjugate() * velocity(s, 1)).x() == Approx(exact).epsilon(1e-9));
      }
}

TEST_CASE("stepping: a spinning ball that does not bounce slips, then rolls, of order 1") {
  std::vector<double> after, rolls;
  for (const double dt : {4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4}) {
    tc::Stepper s = rotating_ball(dt, 0, {0, 0, 1}, {0, 0, 0}, -50).stepper();
    // The whole impact takes mu v_n from the slip; then mu g until it rolls at 0.728 s.
    const double impact = 0.42835293687811934, v = 0.84042846215487015, stops = 0.72811999417504005;
    const Flight a = flight(s, 0.6);
    const double t = 0.6 - impact;
    after.push_back(std::abs(-a.v - (v + 0.2 * kGravity * t)) / v);
    const Flight b = flight(s, 0.9);
    CHECK(-b.v == Approx(10.0 / 7).epsilon(2 * dt));
    CHECK(-b.spin == Approx(100.0 / 7).epsilon(2 * dt));
    const double x = v * (stops - impact) + 0.1 * kGravity * std::pow(stops - impact, 2) +
                     10.0 / 7 * (0.9 - stops);
    rolls.push_back(std::abs(-b.x - x));
  }
  INFO("errors of v " << after.front() << " " << after.back() << ", of x " << rolls.front() << " "
                      << rolls.back());
  CHECK(after.back() < 1e-2);
  CHECK(rolls.back() < 1e-3);
  CHECK(order(rolls) > 0.8);
}

TEST_CASE("stepping: a spinning ball with restitution 1/2 keeps to Newton's law in every bounce") {
  // It slips through the first impact and sticks from the second one on; flights in between.
  const bool cut = GENERATE(true, false);
  std::vector<double> first, places;
  for (const double dt : {4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4}) {
    Scene scene = rotating_ball(dt, 0.5, {-0.5, 0, 1}, {1, 0, 0}, -50);
    scene.options.cut_at_impacts = cut;
    tc::Stepper s = scene.stepper();
    const Flight a = flight(s, 0.64);
    first.push_back(std::max(std::abs(a.v + 0.26064269323230522) / 0.26,
                             std::abs(a.spin + 18.48393266919237) / 18));
    CHECK(first.back() < (cut ? 1e-11 : 16 * dt));
    const Flight b = flight(s, 0.96);
    CHECK(b.v == Approx(-5.0 / 7).epsilon(1e-12));
    CHECK(b.spin == Approx(-50.0 / 7).epsilon(1e-12));
    const Flight c = flight(s, 1.12);
    CHECK(c.v == Approx(-5.0 / 7).epsilon(1e-12));
    CHECK(c.spin == Approx(-50.0 / 7).epsilon(1e-12));
    const double x[] = {-0.07164706312188066 - 0.26064269323230522 * (0.64 - 0.42835293687811934),
                        -0.18329412624376132 - 5.0 / 7 * (0.96 - 0.85670587375623868),
                        -0.3362773179859468 - 5.0 / 7 * (1.12 - 1.0708823421952984)};
    places.push_back(std::max({std::abs(a.x - x[0]), std::abs(b.x - x[1]), std::abs(c.x - x[2])}));
  }
  INFO("first bounce " << first.back() << " places " << places.front() << " " << places.back());
  CHECK(places.back() < (cut ? 1e-11 : 5e-4));
  if (!cut) CHECK(order(places) > 0.8);
}

TEST_CASE("stepping: the law of Poisson, by name, gives slip back as well") {
  tc::Stepper s = [] {
    Scene scene = rotating_ball(1e-4, 0.5, {-0.5, 0, 1}, {1, 0, 0}, -50);
    scene.options.restitution_law = tc::RestitutionLaw::poisson;
    return scene.stepper();
  }();
  const Flight b = flight(s, 0.96);
  CHECK(b.v == Approx(-0.8910).epsilon(5e-3));
  CHECK(b.spin == Approx(-2.73).epsilon(5e-2));
  CHECK(std::string(tc::name(s.options().restitution_law)) == "poisson");
}

TEST_CASE("stepping: two free balls share an impact by either law, Newton's and Poisson's") {
  for (const auto law : {tc::RestitutionLaw::newton, tc::RestitutionLaw::poisson}) {
    Scene scene(1e-3);
    scene.options.gravity.reset();
    scene.options.restitution_law = law;
    scene.friction(0, 0.5);
    scene.sphere(0.1, 1, {-0.1505, 0, 0}, {1, 0, 0});
    scene.sphere(0.1, 3, {0.1505, 0, 0}, {-1, 0, 0});
    tc::Stepper s = scene.stepper();
    for (int k = 0; k < 200; ++k) s.step();
    // Momentum -2 kg m/s; an approach of 2 m/s parts with 1 m/s.
    CHECK(s.bodies().motion[0].velocity.x() == Approx(-1.25).epsilon(1e-9));
    CHECK(s.bodies().motion[1].velocity.x() == Approx(-0.25).epsilon(1e-9));
  }
}

TEST_CASE("stepping: boxes that strike with restitution and friction never gain energy") {
  // Newton's law does gain some by itself where friction and normal impulse are coupled.
  std::mt19937 generator(17);
  std::normal_distribution<double> normal;
  const auto vector = [&] {
    return Vector3d(normal(generator), normal(generator), normal(generator));
  };
  for (int trial = 0; trial < 60; ++trial) {
    Scene scene(1e-3);
    scene.options.gravity.reset();
    scene.options.restitution_law =
        trial % 2 == 0 ? tc::RestitutionLaw::newton : tc::RestitutionLaw::poisson;
    const double e = trial % 3 / 2.0;
    scene.meetings = {{0, 1, 0.3 * (trial % 4), e}};
    scene.ground();
    const Vector3d size = Vector3d(1, 0.3, 0.1) + 0.05 * vector().cwiseAbs();
    scene.bodies.add(1, box_inertia(1, size), Vector3d(0, 0, 1), Quaterniond::UnitRandom(),
                     3 * vector() - Vector3d(0, 0, 5), 5 * vector());
    scene.surfaces.push_back({1, tc::Shape::box(size), 0});
    tc::Stepper s = scene.stepper();
    double energy = tc::kinetic_energy(s.bodies());
    for (int k = 0; k < 500; ++k) {
      s.step();
      const double now = tc::kinetic_energy(s.bodies());
      CHECK(now <= energy * (1 + 1e-9));
      energy = now;
    }
    CHECK(s.counts().unsolved == 0);
  }
}

TEST_CASE("stepping: under gravity as well no bounce ends a step with more energy") {
  // An impact lifts what lies beside it or is about to fall: the new velocities move bodies for a
  // whole step. Boxes tumble, one ball drops, a stack of balls is hit; slow impacts and fast ones.
  std::mt19937 generator(3);
  std::normal_distribution<double> normal;
  const auto vector = [&] {
    return Vector3d(normal(generator), normal(generator), normal(generator));
  };
  int bounces = 0;
  for (int trial = 0; trial < 48; ++trial) {
    const double e = std::array<double, 4>{0.2, 0.5, 0.9, 1}[static_cast<std::size_t>(trial % 4)];
    const double dt = trial % 3 == 0 ? 5e-3 : 1e-3, size = trial % 2 == 0 ? 1 : 1e-2;
    Scene scene(dt * std::sqrt(size));
    scene.options.restitution_law =
        trial % 5 == 4 ? tc::RestitutionLaw::poisson : tc::RestitutionLaw::newton;
    scene.friction(trial % 7 * 0.1, e);
    scene.ground();
    const Vector3d box = size * (Vector3d(0.4, 0.2, 0.1) + 0.05 * vector().cwiseAbs());
    scene.bodies.add(1, box_inertia(1, box), Vector3d(0, 0, 0.4 * size), Quaterniond::UnitRandom(),
                     std::sqrt(size) * vector(), 5 / std::sqrt(size) * vector());
    scene.surfaces.push_back({1, tc::Shape::box(box), 0});
    for (int k = 0; k < 3; ++k)
      scene.sphere(0.1 * size, 0.5 + k, size * Vector3d(2 + 0.01 * k, 0, 0.1 + 0.21 * k));
    scene.sphere(0.1 * size, 1, size * Vector3d(4, 0, 0.3));
    scene.meetings.front().friction = 0.3;
    scene.surfaces[1].material = 2;  // meets the ground only
    scene.meetings.push_back({2, 1, trial % 7 * 0.1, e});
    tc::Stepper s = scene.stepper();
    const auto energy = [&] {
      double sum = tc::kinetic_energy(s.bodies());
      for (std::size_t i = 0; i < s.bodies().mass.size(); ++i)
        sum += s.bodies().mass[i] * kGravity * s.bodies().position[i].z();
      return sum;
    };
    const double start = energy();
    double last = start, rise = 0;
    for (int k = 0; k < 800; ++k) {
      s.step();
      const double now = energy();
      // Taking a penetration back lifts what leans on it.
      rise = std::max(rise, now - last - 10 * kGravity * s.penetration());
      last = now;
    }
    CAPTURE(trial, e, dt, size);
    CHECK(rise < 1e-9 * start);
    CHECK(s.counts().unsolved == 0);
    bounces += static_cast<int>(s.counts().bounces);
  }
  CHECK(bounces > 1000);
}

TEST_CASE("stepping: what bounces is relative to size and gravity, whatever the unit") {
  // A ball of radius R falls from h: it bounces if h > threshold^2 R / 2, here 5e-5 R.
  for (const double R : {1e-6, 1e-3, 1.0, 1e3})
    for (const double g : {1.6, 9.81})
      for (const double h : {2.0, 1e-2, 1e-3, 2e-5}) {
        const double dt = 2e-3 * std::sqrt(2 * h * R / g);
        Scene scene(dt);
        scene.options.gravity = Vector3d(0, 0, -g);
        scene.friction(0.3, 0.5);
        scene.ground();
        const int ball = scene.sphere(R, 1, {0, 0, R * (1 + h)});
        tc::Stepper s = scene.stepper();
        double up = 0;
        for (int k = 0; k < 700; ++k) {
          s.step();
          up = std::max(up, velocity(s, ball).z());
        }
        INFO("R " << R << " g " << g << " h/R " << h);
        const double fell = std::sqrt(2 * g * h * R);
        if (h > 5e-5)
          CHECK(up == Approx(0.5 * fell).epsilon(1e-2));
        else
          CHECK(up < 1e-9 * fell);
      }
}

TEST_CASE("stepping: a box dropped flat lands at the surface in one step and lies still") {
  for (const double dt : {1e-2, 1e-3})
    for (const double h : {0.5, 1e-3, 1e-6}) {
      Scene scene(dt);
      scene.friction(0.5);
      scene.ground();
      const int box = scene.box({1, 1, 1}, 1, {0, 0, 0.5 + h});
      tc::Stepper s = scene.stepper();
      run(s, std::sqrt(2 * h / kGravity) + 3 * dt);
      INFO("dt " << dt << " h " << h);
      CHECK(position(s, box).z() == Approx(0.5).margin(1e-9));
      CHECK(velocity(s, box).norm() < 1e-8);
      const Vector3d at = position(s, box);
      run(s, 1);
      CHECK((position(s, box) - at).norm() < 1e-9);
      CHECK(s.counts().unsolved == 0);
    }
}

TEST_CASE(
    "stepping: a gap that an impact without restitution closes leaves those of others alone") {
  // Both meet the ground within one step; one of them bounces there.
  const auto balls = [](bool both) {
    Scene scene(1e-2);
    scene.meetings = {{0, 1, 0.2, 0.5}, {2, 1, 0.2, 0}};
    scene.ground();
    scene.sphere(0.1, 1, {0, 0, 0.6}, {1, 0, 0});
    if (both) {
      scene.sphere(0.1, 1, {5, 0, 0.601});
      scene.surfaces.back().material = 2;
    }
    return scene.stepper();
  };
  tc::Stepper alone = balls(false), beside = balls(true);
  bool flew = false;
  for (int k = 0; k < 100; ++k) {
    alone.step();
    beside.step();
    CHECK((position(alone, 1) - position(beside, 1)).norm() < 1e-12);
    CHECK((velocity(alone, 1) - velocity(beside, 1)).norm() < 1e-11);
    // Its way of the step of the impact is left to it; the other one's gap is closed there.
    if (!flew && velocity(beside, 1).z() > 0) {
      flew = true;
      CHECK(position(beside, 1).z() > 0.1 + 1e-3);
      CHECK(position(beside, 2).z() == Approx(0.1).margin(1e-9));
    }
  }
  CHECK(flew);
}
