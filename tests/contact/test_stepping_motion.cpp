// Free rotation, impacts, momentum, cost of a step. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <random>
#include <stdexcept>

#include "linalg/allocations.hpp"
#include "stepping_scenes.hpp"
#include "support/catch.hpp"

namespace {

using namespace stepping_scenes;

struct Tumble {
  double energy = 0, momentum = 0;  // largest relative change
  std::vector<double> flips;        // times at which w2 (body axes) changes sign
};

Tumble tumble(tc::Gyroscopic how, const Vector3d& w, double dt, double seconds) {
  Scene scene(dt);
  scene.options.gravity.reset();
  scene.options.gyroscopic = how;
  const Vector3d inertia(1, 2, 3);
  scene.bodies.add(1, inertia.asDiagonal().toDenseMatrix(), Vector3d::Zero(),
                   Quaterniond::Identity(), Vector3d::Zero(), w);
  tc::Stepper s = scene.stepper();
  const double E = tc::kinetic_energy(s.bodies());
  const Vector3d L = tc::angular_momentum(s.bodies());
  Tumble out;
  double last = w[1];
  const long n = std::lround(seconds / dt);
  for (long k = 0; k < n; ++k) {
    s.step();
    out.energy = std::max(out.energy, std::abs(tc::kinetic_energy(s.bodies()) / E - 1));
    out.momentum = std::max(out.momentum, (tc::angular_momentum(s.bodies()) - L).norm() / L.norm());
    const double now = (s.bodies().orientation[0].conjugate() * angular_velocity(s, 0))[1];
    if ((now < 0) != (last < 0)) out.flips.push_back(s.time() - dt * now / (now - last));
    last = now;
  }
  return out;
}

// Balls on a line, all of radius r and mass 1; the first one comes with speed v.
tc::Stepper cradle(int n, double gap, double dt, double restitution) {
  Scene scene(dt);
  scene.options.gravity.reset();
  scene.options.tolerance = 1e-14;
  scene.meetings = {{0, 0, 0, restitution}};
  for (int k = 0; k < n; ++k)
    scene.sphere(0.5, 1, Vector3d(k * (1 + gap) + (k == 0 ? -0.1 : 0), 0, 0),
                 k == 0 ? Vector3d(1, 0, 0) : Vector3d(Vector3d::Zero()));
  return scene.stepper();
}

Scene heap(int side_length, double mu, double restitution, double dt = 2e-3) {
  Scene scene(dt);
  scene.options.tolerance = 1e-6;
  scene.friction(mu, restitution);
  scene.ground();
  for (const double side : {-1.0, 1.0})
    for (const Vector3d& n : {Vector3d(side, 0, 0), Vector3d(0, side, 0)}) {
      scene.bodies.add_fixed(-0.11 * side_length * n +
                             Vector3d(1, 1, 0) * 0.105 * (side_length - 1));
      scene.surfaces.push_back({scene.bodies.size() - 1, tc::Shape::plane(n), 1});
    }
  std::mt19937 generator(3);
  std::uniform_real_distribution<double> jitter(-0.02, 0.02);
  for (int z = 0; z < side_length; ++z)
    for (int y = 0; y < side_length; ++y)
      for (int x = 0; x < side_length; ++x)
        scene.sphere(0.1, 1,
                     Vector3d(0.21 * x, 0.21 * y, 0.15 + 0.22 * z) +
                         Vector3d(jitter(generator), jitter(generator), 0));
  return scene;
}

}  // namespace

TEST_CASE("stepping: free rotation keeps energy and momentum to round-off, flips of order 2") {
  const Vector3d w(0.01, 1, 0);
  const double first = 10.377304882335, second = first + 20.7546097646692;
  double error[2];
  for (const int k : {0, 1}) {
    const Tumble t = tumble(tc::Gyroscopic::momentum, w, k == 0 ? 1e-2 : 1e-3, 100);
    INFO("energy " << t.energy << " momentum " << t.momentum);
    CHECK(t.energy < 1e-12);
    CHECK(t.momentum < 1e-12);
    REQUIRE(t.flips.size() == 5);
    error[k] = std::abs(t.flips[0] - first) + std::abs(t.flips[1] - second);
    CHECK(error[k] < (k == 0 ? 5e-3 : 5e-5));
  }
  CHECK(error[0] / error[1] == Approx(100).epsilon(0.3));
  // Fast: 20 half turns, and several radians a step.
  const Tumble fast = tumble(tc::Gyroscopic::momentum, Vector3d(0.01, 5, 0.01), 1e-2, 100);
  CHECK(fast.flips.size() == 20);
  CHECK(fast.energy < 1e-12);
  CHECK(fast.momentum < 1e-12);
  const Tumble wild = tumble(tc::Gyroscopic::momentum, Vector3d(10, 300, 50), 1e-2, 1);
  CHECK(wild.energy < 1e-11);
  CHECK(wild.momentum < 1e-11);
}

TEST_CASE("stepping: the other gyroscopic steps, for comparison") {
  const Vector3d w(0.01, 1, 0);
  const Tumble none = tumble(tc::Gyroscopic::none, w, 1e-2, 100);
  CHECK(none.flips.empty());
  const Tumble plain = tumble(tc::Gyroscopic::explicit_step, w, 1e-2, 100);
  CHECK(plain.energy == Approx(6.0e-2).epsilon(0.05));
  CHECK(plain.flips.at(0) == Approx(10.410).margin(0.01));
  const Tumble implicit = tumble(tc::Gyroscopic::implicit_step, w, 1e-2, 100);
  CHECK(implicit.energy == Approx(5.5e-2).epsilon(0.05));
  CHECK(implicit.flips.at(0) == Approx(10.360).margin(0.01));
}

TEST_CASE("stepping: bouncing ball") {
  const double e = 0.5, h = 1, R = 0.1;
  for (const double dt : {1e-3, 1e-2}) {
    Scene scene(dt);
    scene.friction(0, e);
    scene.ground();
    const int ball = scene.sphere(R, 1, Vector3d(0, 0, R + h));
    tc::Stepper s = scene.stepper();
    std::vector<double> peaks;
    double last = 0, energy = kGravity * h;
    for (long k = 0; k < std::lround(3 / dt); ++k) {
      s.step();
      const double v = velocity(s, ball).z();
      if (last > 0 && v <= 0) peaks.push_back(position(s, ball).z() - R);
      last = v;
      const double now = 0.5 * v * v + kGravity * (position(s, ball).z() - R);
      CHECK(now <= energy + kGravity * std::abs(v) * dt);
      energy = now;
    }
    const double impact = std::sqrt(2 * kGravity * h);
    REQUIRE(peaks.size() >= 3);
    for (int k = 0; k < 3; ++k)
      CHECK(std::abs(peaks[static_cast<std::size_t>(k)] - h * std::pow(e, 2 * k + 2)) <
            impact * dt);
    CHECK(std::abs(velocity(s, ball).z()) < 1e-9);
    CHECK(position(s, ball).z() - R == Approx(0).margin(0.1 * dt));
  }
}

TEST_CASE("stepping: cradle with gaps passes the speed on, touching balls obey one Newton law") {
  {
    tc::Stepper s = cradle(5, 0.05, 1e-2, 1);
    run(s, 2);
    for (int k = 0; k < 5; ++k) CHECK(velocity(s, k).x() == Approx(k == 4 ? 1 : 0).margin(1e-12));
  }
  const int n = GENERATE(3, 5);
  const double e = GENERATE(1.0, 0.5, 0.0);
  tc::Stepper s = cradle(n, 0, 1e-3, e);
  run(s, 0.3);
  for (int k = 0; k < n; ++k)
    CHECK(velocity(s, k).x() == Approx(k == 0 ? (1 - (n - 1) * e) / n : (1 + e) / n).margin(1e-12));
}

TEST_CASE("stepping: restitution never creates energy") {
  // Boxes tumble on the ground with friction: Newton's law may create energy there.
  std::mt19937 generator(7);
  std::normal_distribution<double> normal;
  const auto vector = [&] {
    return Vector3d(normal(generator), normal(generator), normal(generator));
  };
  for (int trial = 0; trial < 40; ++trial) {
    Scene scene(1e-3);
    scene.options.gravity.reset();
    scene.friction(trial % 4 * 0.5, 1);
    scene.ground();
    for (int k = 0; k < 2; ++k) {
      const Vector3d size = Vector3d(1, 0.3, 0.1) + 0.05 * vector().cwiseAbs();
      scene.bodies.add(1 + k, box_inertia(1 + k, size), Vector3d(5 * k, 0, 1),
                       Quaterniond::UnitRandom(), 3 * vector() - Vector3d(0, 0, 5), 5 * vector());
      scene.surfaces.push_back({k + 1, tc::Shape::box(size), 0});
    }
    // Only box and plane: boxes pass through each other.
    scene.meetings.erase(scene.meetings.begin());
    tc::Stepper s = scene.stepper();
    double energy = tc::kinetic_energy(s.bodies());
    for (int k = 0; k < 1000; ++k) {
      s.step();
      const double now = tc::kinetic_energy(s.bodies());
      CHECK(now <= energy * (1 + 1e-9));
      energy = now;
    }
  }
}

TEST_CASE("stepping: collisions keep linear and angular momentum") {
  std::mt19937 generator(5);
  std::normal_distribution<double> normal;
  const auto vector = [&] {
    return Vector3d(normal(generator), normal(generator), normal(generator));
  };
  Scene scene(1e-3);
  scene.options.gravity.reset();
  scene.options.tolerance = 1e-6;  // momentum does not depend on it
  scene.options.error_reduction = 0;
  scene.friction(0.5, 0.3);
  for (int x = 0; x < 3; ++x)
    for (int y = 0; y < 3; ++y)
      for (int z = 0; z < 3; ++z) {
        const Vector3d at = 0.22 * Vector3d(x - 1, y - 1, z - 1) + 0.005 * vector();
        scene.sphere(0.1, 1, at, -2 * at + 0.3 * vector(), vector());
      }
  tc::Stepper s = scene.stepper();
  const Vector3d P = tc::momentum(s.bodies()), L = tc::angular_momentum(s.bodies());
  run(s, 0.5);
  CHECK(s.counts().contact_problems > 50);
  CHECK((tc::momentum(s.bodies()) - P).norm() < 1e-12);
  CHECK((tc::angular_momentum(s.bodies()) - L).norm() < 1e-12);
}

TEST_CASE("stepping: penetration is taken back without any energy") {
  Scene scene(1e-2);
  scene.options.gravity.reset();
  scene.friction(0.5);
  scene.ground();
  const int ball = scene.sphere(0.5, 1, Vector3d(0, 0, 0.4));
  tc::Stepper s = scene.stepper();
  double depth = 0.1;
  for (int k = 0; k < 30; ++k) {
    s.step();
    CHECK(tc::kinetic_energy(s.bodies()) == 0);
    depth -= std::min(0.2 * depth, 1.0 * 1e-2);  // the fifth part, at 1 m/s at most
    CHECK(0.5 - position(s, ball).z() == Approx(depth).margin(1e-9));
  }
}

TEST_CASE("stepping: capsules, points and hulls lie still on a plane") {
  Scene scene(1e-2);
  scene.friction(0.4);
  scene.ground();
  const Quaterniond lying(AngleAxisd(radians(90), Vector3d::UnitY()));
  scene.bodies.add(1, Vector3d(0.2, 0.2, 0.1).asDiagonal().toDenseMatrix(), Vector3d(0, 0, 0.1),
                   lying);
  scene.surfaces.push_back({1, tc::Shape::capsule(0.1, 1), 0});
  scene.meetings = {{0, 1, 0.4, 0}};
  std::vector<Vector3d> legs;
  for (const double x : {-0.5, 0.5})
    for (const double y : {-0.5, 0.5}) legs.emplace_back(x, y, -1);
  // A table with its load off centre.
  scene.bodies.add(3, Matrix3d::Identity(), Vector3d(3.1, 0.07, 1));
  for (Vector3d& p : legs) p -= Vector3d(0.1, 0.07, 0);
  scene.surfaces.push_back({2, tc::Shape::touching_points(legs), 0});
  tc::Stepper s = scene.stepper();
  run(s, 2);
  CHECK((position(s, 1) - Vector3d(0, 0, 0.1)).norm() < 1e-12);
  CHECK((position(s, 2) - Vector3d(3.1, 0.07, 1)).norm() < 1e-10);
  // The legs' forces are not determined, their sum and moments about the centre of mass are.
  double sum = 0;
  Vector3d moment = Vector3d::Zero();
  for (std::size_t k = 0; k < s.contacts().points.size(); ++k) {
    if (s.contacts().points[k].first != 2) continue;
    sum += s.contacts().impulses[k].z();
    moment += s.contacts().points[k].r1.cross(s.contacts().impulses[k]);
  }
  const double weight = 3 * kGravity * 1e-2;
  CHECK(sum == Approx(weight).epsilon(1e-9));
  CHECK(moment.norm() < 1e-9 * weight);
}

TEST_CASE("stepping: a body may touch at hundreds of points") {
  Scene scene(1e-2);
  scene.friction(0.3);
  scene.ground();
  std::vector<Vector3d> rim;
  for (int k = 0; k < 300; ++k)
    rim.emplace_back(0.5 * std::cos(2 * kPi * k / 300), 0.5 * std::sin(2 * kPi * k / 300), 0);
  scene.bodies.add(1, Vector3d(1, 1, 2).asDiagonal().toDenseMatrix(), Vector3d::Zero(),
                   Quaterniond::Identity(), Vector3d::Zero(), Vector3d(0, 0, 1));
  scene.surfaces.push_back({1, tc::Shape::touching_points(rim), 0});
  tc::Stepper s = scene.stepper();
  s.step();
  CHECK(s.contacts().points.size() == 300);
  run(s, 2);  // I w/(mu m g R) = 1.36 s until it stops
  double sum = 0;
  for (const Vector3d& p : s.contacts().impulses) sum += p.z();
  CHECK(sum == Approx(kGravity * 1e-2).epsilon(1e-8));
  CHECK(position(s, 1).norm() < 1e-9);
  CHECK(angular_velocity(s, 1).norm() < 1e-9);
}

TEST_CASE("stepping: the grid finds the pairs that all pairs of balls have") {
  Scene scene = heap(6, 0.3, 0);
  tc::Stepper s = scene.stepper();
  run(s, 0.4);
  const tc::BodySet before = s.bodies();
  s.step();
  int touching = 0;
  for (int i = 5; i < before.size(); ++i)
    for (int j = i + 1; j < before.size(); ++j)
      touching += (before.position[static_cast<std::size_t>(i)] -
                   before.position[static_cast<std::size_t>(j)])
                      .norm() < 0.2 + 1e-4;
  const auto& points = s.contacts().points;
  const auto gaps = s.contacts().gaps;
  int found = 0;
  for (std::size_t k = 0; k < points.size(); ++k) found += points[k].second > 4 && gaps[k] < 1e-4;
  CHECK(touching > 20);
  CHECK(found == touching);
}

TEST_CASE("stepping: nothing is allocated in steady state") {
  Scene scene = heap(5, 0.3, 0.2);
  scene.options.max_assembled = 0;
  tc::Stepper s = scene.stepper();
  run(s, 2);
  const long before = tether::test::allocations();
  for (int k = 0; k < 100; ++k) s.step();
  CHECK(tether::test::allocations() == before);
}

TEST_CASE("stepping: a run repeats bit by bit, for any number of threads, and from a saved state") {
  Scene scene = heap(5, 0.3, 0.2);
  tc::Stepper a = scene.stepper();
  scene.options.threads = 2;
  tc::Stepper b = scene.stepper();
  run(a, 0.4);
  run(b, 0.4);
  a.start_anew(a.counts().steps);
  Scene again = scene;
  again.bodies = b.bodies();
  tc::Stepper c = again.stepper();
  c.start_anew(b.counts().steps);
  run(a, 0.2);
  run(c, 0.2);
  for (int i = 0; i < a.bodies().size(); ++i) {
    CHECK((position(a, i).array() == position(c, i).array()).all());
    CHECK((velocity(a, i).array() == velocity(c, i).array()).all());
  }
  CHECK(a.time() == c.time());
}

TEST_CASE("stepping: bodies and memory are all that a run goes on from") {
  // They bounce, rest and are pushed apart: all three warm starts have something to keep.
  Scene scene = heap(4, 0.3, 0.6);
  tc::Stepper whole = scene.stepper();
  run(whole, 0.31);
  const tc::StepperMemory memory = whole.memory();
  CHECK(memory.contacts.ids.size() == whole.contacts().points.size());
  Scene again = scene;
  again.bodies = whole.bodies();
  tc::Stepper part = again.stepper();
  part.set_memory(memory);
  CHECK(part.contacts().gaps == whole.contacts().gaps);
  CHECK(part.penetration() == whole.penetration());
  CHECK(part.residual() == whole.residual());
  for (int k = 0; k < 200; ++k) {
    whole.step(), part.step();
    REQUIRE(part.residual() == whole.residual());
  }
  for (int i = 0; i < whole.bodies().size(); ++i) {
    CHECK((position(whole, i).array() == position(part, i).array()).all());
    CHECK((velocity(whole, i).array() == velocity(part, i).array()).all());
  }
  CHECK(whole.time() == part.time());
  tc::StepperMemory other = memory;
  other.spins.resize(memory.spins.size() + 1);
  CHECK_THROWS_AS(part.set_memory(other), std::invalid_argument);
  tc::BodySolver solver;
  CHECK_THROWS_AS(solver.set_warm_start({{1, 2}, {}}), std::invalid_argument);
}

TEST_CASE("stepping: two threads sweep one large island together, with the bits of one") {
  Scene scene = heap(11, 0.3, 0.2, 5e-3);
  scene.options.tolerance = 1e-2;
  tc::Stepper a = scene.stepper();
  scene.options.threads = 2;
  tc::Stepper b = scene.stepper();
  std::size_t contacts = 0;
  for (int k = 0; k < 120; ++k) {
    a.step();
    b.step();
    contacts = std::max(contacts, b.contacts().points.size());
  }
  CHECK(contacts > 2000);  // below 1500 an island has one thread
  bool same = true;
  for (int i = 0; i < a.bodies().size(); ++i)
    same = same && (position(a, i).array() == position(b, i).array()).all() &&
           (velocity(a, i).array() == velocity(b, i).array()).all();
  CHECK(same);
}

TEST_CASE("stepping: only what is asked for is a stage") {
  const auto effects = [](const Scene& scene) {
    std::string all;
    for (const tc::StageCost& c : scene.stepper().costs()) all += std::string(c.effect) + ",";
    return all;
  };
  Scene scene;
  scene.sphere(1, 1, Vector3d::Zero());
  CHECK(effects(scene) == "gravity,motion,");
  scene.options.gravity.reset();
  CHECK(effects(scene) == "motion,");
  scene.bodies.add(1, Vector3d(1, 2, 3).asDiagonal().toDenseMatrix(), Vector3d(5, 0, 0));
  CHECK(effects(scene) == "motion,gyroscopic term,");
  scene.options.gyroscopic = tc::Gyroscopic::none;
  scene.meetings = {{0, 0, 0, 0}};
  CHECK(effects(scene) == "collision,contact,penetration,motion,");
  scene.meetings = {{0, 0, 0, 0.5}};
  CHECK(effects(scene) == "restitution,collision,contact,penetration,motion,");
}

TEST_CASE("stepping: misuse is refused") {
  const auto bad = [](auto change) {
    Scene s;
    s.friction(0.5);
    s.ground();
    s.sphere(1, 1, Vector3d(0, 0, 1));
    change(s);
    CHECK_THROWS_AS(s.stepper(), std::invalid_argument);
  };
  bad([](Scene& s) { s.options.step = 0; });
  bad([](Scene& s) { s.options.tolerance = 0; });
  bad([](Scene& s) { s.options.min_sweeps = -1; });
  bad([](Scene& s) { s.options.error_reduction = 1.5; });
  bad([](Scene& s) { s.surfaces[0].body = 1; });  // a plane that moves
  bad([](Scene& s) { s.surfaces[1].body = 7; });
  bad([](Scene& s) { s.surfaces[1].shape.radius = -1; });
  bad([](Scene& s) { s.meetings[0].friction = -1; });
  bad([](Scene& s) { s.meetings[0].restitution = 1.1; });
  tc::BodySet bodies;
  CHECK_THROWS_AS(bodies.add(0, Matrix3d::Identity(), Vector3d::Zero()), std::invalid_argument);
  CHECK_THROWS_AS(bodies.add(1, Matrix3d::Zero(), Vector3d::Zero()), std::invalid_argument);
}

TEST_CASE("stepping: a turning box that is lifted out of the ground keeps its energy") {
  Scene scene;
  scene.options.gravity.reset();
  scene.friction(0);
  scene.ground();
  const Quaterniond turned(AngleAxisd(radians(30), Vector3d(1, 1, 0).normalized()));
  const int box = scene.box({0.6, 0.2, 0.1}, 1, {0, 0, 0.1}, turned);
  tc::RigidBody& motion = scene.bodies.motion[static_cast<std::size_t>(box)];
  motion.velocity = {0, 0, 1};
  motion.angular_velocity = {4, 2, 7};
  tc::Stepper s = scene.stepper();
  const double energy = tc::kinetic_energy(s.bodies());
  s.step();
  const double deepest = s.penetration();
  CHECK(deepest > 0.02);
  for (int k = 0; k < 10; ++k) s.step();
  CHECK(s.penetration() < 0.9 * deepest);
  CHECK(std::abs(tc::kinetic_energy(s.bodies()) - energy) < 1e-13 * energy);
}
