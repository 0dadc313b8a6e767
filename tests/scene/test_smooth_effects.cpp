// Effects, forms and the engine of jointed scenes. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "smooth_runs.hpp"

using namespace tether::scene;
using namespace mechanisms;

TEST_CASE("prescribed motions", "[smooth]") {
  Motion motion;
  motion.rate = 0.3;
  motion.amplitude = 0.4;
  motion.frequency = 0.5;
  motion.phase = 0.2;
  const auto s_of = [&](double t) {
    return motion.rate * t +
           motion.amplitude * (std::sin(M_PI * t + motion.phase) - std::sin(motion.phase));
  };
  const double speed = motion.rate + motion.amplitude * M_PI * std::cos(motion.phase);
  for (const Formulation form : kForms) {
    INFO(word(form));
    {
      Scene s = pendulum(1e-7);
      s.smooth->formulation = form;
      s.joints[0].motion = motion;
      turn_about(s.bodies[0], {0, 0, 0}, speed);
      const auto engine = make_smooth_engine(s);
      engine->advance(10);
      CHECK(in_plane(engine->bodies()[0].position, 0.5 * std::cos(s_of(10)),
                     0.5 * std::sin(s_of(10))) < 1e-9);
      CHECK(engine->diagnostics().drift < 1e-9);  // energy minus the work of the drive, too
    }
    {
      Scene s = scene(1e-7);
      s.smooth->formulation = form;
      s.bodies.push_back(ball("carriage", {1, 2, 3}));
      s.bodies[0].velocity = Vector3d(0, 0.6, 0.8) * speed;
      s.joints.push_back(joint(JointKind::slider, 0, kWorld, {1, 2, 3}));
      s.joints[0].axis = {0, 0.6, 0.8};
      s.joints[0].motion = motion;
      const auto engine = make_smooth_engine(s);
      engine->advance(10);
      CHECK((engine->bodies()[0].position - Vector3d(1, 2, 3) - Vector3d(0, 0.6, 0.8) * s_of(10))
                .norm() < 1e-9);
    }
    {
      Scene s = scene(1e-7);
      s.smooth->formulation = form;
      s.gravity = Vector3d(0, -kGravity, 0);
      s.bodies.push_back(ball("load", {0, -3, 0}));
      s.bodies[0].velocity = {0, -speed, 0};
      s.joints.push_back(joint(JointKind::distance, 0, kWorld, {0, -3, 0}, {0, 0, 0}));
      s.joints[0].motion = motion;
      keep_energy(s);
      const auto engine = make_smooth_engine(s);
      engine->advance(5);
      CHECK(std::abs(engine->bodies()[0].position.y() + 3 + s_of(5)) < 1e-9);
      CHECK(engine->diagnostics().drift < 1e-9);
    }
  }
}

TEST_CASE("drag and loads", "[smooth]") {
  Scene s = scene(1e-8);
  s.bodies.push_back(ball("drop", {0, 0, 0}, 2));
  s.bodies[0].velocity = {3, 0, 0};
  s.bodies[0].angular_velocity = {0, 0, 5};
  s.bodies[0].drag.emplace();
  s.bodies[0].drag->linear = 0.8;
  s.bodies[0].drag->rotational = 0.004;
  s.loads.push_back({0, Vector3d(0, 1.6, 0), Vector3d::Zero(), {}});
  keep_energy(s);
  const auto engine = make_smooth_engine(s);
  engine->advance(4);
  const double decay = std::exp(-0.4 * 4);
  CHECK(std::abs(engine->bodies()[0].velocity.x() - 3 * decay) < 1e-7);
  CHECK(std::abs(engine->bodies()[0].velocity.y() - 2 * (1 - decay)) < 1e-7);
  CHECK(std::abs(engine->bodies()[0].angular_velocity.z() - 5 * decay) < 1e-7);
  CHECK(engine->diagnostics().drift < 1e-10);  // energy minus work
}

TEST_CASE("what is named with zero strength equals what is not named", "[smooth]") {
  const auto end = [](const Scene& s) {
    const auto engine = make_smooth_engine(s);
    engine->advance(2);
    return engine->bodies();
  };
  const auto same = [](const std::vector<BodyState>& a, const std::vector<BodyState>& b) {
    bool equal = a.size() == b.size();
    for (std::size_t i = 0; equal && i < a.size(); ++i)
      equal = a[i].position == b[i].position && a[i].velocity == b[i].velocity &&
              a[i].orientation.coeffs() == b[i].orientation.coeffs() &&
              a[i].angular_velocity == b[i].angular_velocity;
    return equal;
  };
  struct Named {
    const char* what;
    std::function<void(Scene&)> name;
    bool works;  // has power: with the energy kept, its work is one unknown more
  };
  Spring spring;
  spring.first = 0;
  spring.second = 1;
  spring.at = {0.5, 0.3, 0};
  spring.at_second = {1.5, -0.4, 0};
  const Named kinds[] = {
      {"gravity", [](Scene& s) { s.gravity = Vector3d::Zero(); }, false},
      {"spring and damper", [&](Scene& s) { s.springs.push_back(spring); }, false},
      {"drag", [](Scene& s) { s.bodies[1].drag.emplace(); }, true},
      {"load",
       [](Scene& s) {
         s.loads.push_back({1, Vector3d::Zero(), Vector3d::Zero(), {}});
       },
       true},
      {"recorded invariant",
       [](Scene& s) {
         s.invariants.push_back({InvariantKind::momentum, false, {}});
       },
       false},
  };
  for (const Formulation form : kForms)
    for (const bool energy_kept : {false, true}) {
      // Two rods on hinges, swung by their start alone.
      Scene base = chain(2, 1e-7);
      base.smooth->formulation = form;
      base.gravity.reset();
      if (!energy_kept) base.invariants.clear();
      turn_about(base.bodies[0], {0, 0, 0}, 2);
      base.bodies[1].velocity = {0, 2 + 0.5 * -3, 0};
      base.bodies[1].angular_velocity = {0, 0, -3};
      const std::vector<BodyState> without = end(base);
      CHECK((without[1].position - base.bodies[1].position).norm() > 0.5);
      for (const Named& each : kinds) {
        INFO(each.what << ", " << word(form) << (energy_kept ? ", energy kept" : ""));
        Scene scene = base;
        each.name(scene);
        const std::vector<BodyState> with = end(scene);
        if (each.works && energy_kept)
          CHECK((with[1].position - without[1].position).norm() < 1e-6);
        else
          CHECK(same(with, without));
      }
    }
}

TEST_CASE("a prescribed motion of the free course changes nothing", "[smooth]") {
  // Without gravity a rod goes round evenly; a drive at that speed has nothing to do.
  for (const Formulation form : kForms) {
    Scene s = pendulum(1e-8);
    s.smooth->formulation = form;
    s.gravity.reset();
    turn_about(s.bodies[0], {0, 0, 0}, 1.5);
    const auto free = make_smooth_engine(s);
    s.joints[0].motion.emplace().rate = 1.5;
    const auto driven = make_smooth_engine(s);
    free->advance(4);
    driven->advance(4);
    INFO(word(form));
    CHECK((free->bodies()[0].position - driven->bodies()[0].position).norm() < 1e-7);
    CHECK(in_plane(driven->bodies()[0].position, 0.5 * std::cos(6.0), 0.5 * std::sin(6.0)) < 1e-9);
  }
}

TEST_CASE("plain IDA without projection", "[smooth]") {
  Scene s = pendulum(1e-8);
  s.smooth->projection = false;
  const auto engine = make_smooth_engine(s);
  engine->advance(5);
  CHECK(engine->counts().projections == 0);
  CHECK(engine->diagnostics().drift < 1e-3);
  CHECK(engine->diagnostics().drift > 1e-14);
}

TEST_CASE("every form against plain IDA at a tight tolerance", "[smooth]") {
  struct Case {
    const char* what;
    std::function<Scene(double)> make;
    double end;  // before drift is felt in plain IDA
  };
  const Case cases[] = {
      {"slider-crank", [](double tol) { return slider_crank(0.5, 2, kGravity, tol, 1.3); }, 2},
      {"four-bar", [](double tol) { return four_bar(1, tol, 0.2, 1); }, 0.5},
      {"three rods", [](double tol) { return chain(3, tol); }, 1},
      {"Bricard", bricard, 1},
      {"governor", governor, 0.3},
  };
  for (const Case& each : cases)
    for (const Formulation form : kForms) {
      Scene tight = each.make(1e-10), scene = each.make(1e-7);
      tight.smooth->formulation = scene.smooth->formulation = form;
      tight.smooth->projection = false;
      const auto reference = make_smooth_engine(tight), engine = make_smooth_engine(scene);
      reference->advance(each.end);
      engine->advance(each.end);
      CHECK(reference->counts().projections == 0);
      CHECK(engine->counts().projections > 0);
      double error = 0, moved = 0;
      for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
        const BodyState &x = engine->bodies()[b], &y = reference->bodies()[b];
        error = std::max({error, (x.position - y.position).norm(),
                          x.orientation.angularDistance(y.orientation)});
        moved = std::max(moved, (x.position - scene.bodies[b].position).norm());
      }
      INFO(each.what << ", " << word(form) << ": apart by " << error << " m or rad");
      CHECK(error < 1e-6);
      CHECK(moved > 0.01);
    }
}

TEST_CASE("the order of bodies does not matter", "[smooth]") {
  const Scene first = slider_crank(0, 6, kGravity, 1e-8);
  Scene second = first;
  std::swap(second.bodies[0], second.bodies[2]);
  const auto other = [](int b) { return b == 0 ? 2 : b == 2 ? 0 : b; };
  for (Joint& j : second.joints) {
    j.first = other(j.first);
    j.second = other(j.second);
  }
  std::swap(second.joints[0], second.joints[3]);
  const auto a = make_smooth_engine(first), b = make_smooth_engine(second);
  a->advance(3);
  b->advance(3);
  CHECK((a->bodies()[2].position - b->bodies()[0].position).norm() < 1e-7);
}

TEST_CASE("a slider between two free bodies keeps momentum, angular momentum and energy",
          "[smooth]") {
  for (const Formulation form : kForms) {
    Scene s = scene(1e-8);
    s.smooth->formulation = form;
    s.bodies = {rod("rail", {-1, 0, 0}, {1, 0, 0}, 2), rod("sled", {0.3, -0.2, 0}, {0.3, 0.4, 0})};
    Joint slider = joint(JointKind::slider, 1, 0, {0.3, 0, 0});
    slider.axis = Vector3d::UnitX();
    s.joints = {slider};
    // Both turn about the z axis through the origin, and the sled glides along the rail.
    for (Body& each : s.bodies) turn_about(each, Vector3d::Zero(), 1.5);
    s.bodies[1].velocity.x() += 0.4;
    const auto engine = make_smooth_engine(s);
    const Diagnostics start = engine->diagnostics();
    engine->advance(1);
    const Diagnostics end = engine->diagnostics();
    INFO(static_cast<int>(form));
    CHECK((end.momentum - start.momentum).norm() < 1e-6);
    CHECK((end.angular_momentum - start.angular_momentum).norm() < 1e-6);
    CHECK(std::abs(end.kinetic_energy - start.kinetic_energy) < 1e-6);
    // The sled has moved along the rail, which has turned.
    CHECK((engine->bodies()[1].position - engine->bodies()[0].position).norm() > 0.5);
  }
}

TEST_CASE("a kept energy takes up the work of a driven distance", "[smooth]") {
  // A pendulum on a rope that is drawn in and let out.
  const auto end = [](bool kept) {
    Scene s = scene(1e-9);
    s.gravity = Vector3d(0, 0, -kGravity);
    s.bodies = {ball("bob", {1, 0, 0})};
    s.joints.push_back(joint(JointKind::distance, 0, kWorld, {1, 0, 0}));
    s.joints.back().motion.emplace();
    s.joints.back().motion->amplitude = 0.2;
    s.joints.back().motion->frequency = 0.7;
    s.bodies[0].velocity.x() = 0.2 * 2 * std::acos(-1.0) * 0.7;
    if (kept) keep_energy(s);
    const auto engine = make_smooth_engine(s);
    engine->advance(2);
    const Diagnostics d = engine->diagnostics();
    CHECK(d.drift < 1e-7);
    return std::make_pair(engine->bodies()[0].position, d.kinetic_energy + d.potential_energy);
  };
  const auto [with, energy] = end(true);
  const auto [without, plain] = end(false);
  CHECK((with - without).norm() < 1e-6);
  CHECK(std::abs(energy - plain) < 1e-6);
  CHECK(std::abs(energy) > 0.1);  // work has been done
}

TEST_CASE("what the smooth engine refuses", "[smooth]") {
  const auto refused = [](const Scene& s, const std::string& words) {
    try {
      make_smooth_engine(s);
    } catch (const std::invalid_argument& error) {
      INFO(error.what());
      CHECK(std::string(error.what()).find(words) != std::string::npos);
      return;
    }
    FAIL("accepted; expected: " << words);
  };
  Scene s = pendulum(1e-6);
  s.pairs.emplace_back();
  refused(s, "no contacts");

  s = pendulum(1e-6);
  s.bodies[0].velocity = {0.1, 0, 0};
  refused(s, "velocity of joint \"hinge 0 -1\"");

  s = double_pendulum(1e-6);
  s.joints[1].length = 1.01;
  refused(s, "position of joint");

  s = pendulum(1e-6);
  s.bodies[0].inertia.setZero();
  refused(s, "moments of inertia");

  s = pendulum(1e-6);
  s.joints[0].first = kWorld;
  refused(s, "joins nothing");

  s = pendulum(1e-6);
  s.invariants.push_back({InvariantKind::momentum, true, {}});
  refused(s, "momentum is not invariant");

  s = pendulum(1e-6);
  s.invariants.push_back({InvariantKind::angular_momentum, true, {}});
  refused(s, "angular momentum");

  s = pendulum(1e-6);
  s.joints[0].kind = JointKind::ball;
  s.joints[0].motion.emplace();
  refused(s, "no motion");

  s = pendulum(1e-6);
  s.bodies[0].fixed = true;
  refused(s, "");
}

TEST_CASE("costs name only the effects of the scene", "[smooth]") {
  const auto engine = make_smooth_engine(top({1, 1, 1}, 1e-6));
  engine->advance(10);
  for (const EffectCost& cost : engine->costs()) {
    CHECK(cost.seconds >= 0);
    CHECK(cost.effect != "gravity");
    CHECK(cost.effect != "joints");
    CHECK(cost.effect != "springs");
  }
}

TEST_CASE("a mechanism of any size, time and mass moves alike", "[smooth]") {
  // Two rods under their weight, energy kept: the same numbers in its own units.
  const auto rods = [](double length, double time, double mass, Formulation form) {
    Scene s;
    s.end = 4 * time;
    s.gravity = Vector3d(0, 0, -9.81 * length / (time * time));
    s.smooth.emplace();
    s.smooth->formulation = form;
    for (int k = 0; k < 2; ++k) {
      Body rod;
      rod.name = k == 0 ? "first" : "second";
      rod.mass = mass;
      rod.inertia = Vector3d(0.01, 0.1, 0.1).asDiagonal();
      rod.inertia *= mass * length * length;
      rod.position = {(0.5 + k) * length, 0, 0};
      s.bodies.push_back(rod);
    }
    Joint hinge;
    hinge.kind = JointKind::hinge;
    hinge.first = 0;
    hinge.axis = {0, 1, 0};
    Joint ball;
    ball.first = 0;
    ball.second = 1;
    ball.at = {length, 0, 0};
    s.joints = {hinge, ball};
    s.invariants = {Invariant{}};
    return s;
  };
  for (const Formulation form : kForms) {
    Scene tight = rods(1, 1, 1, form);
    tight.smooth->tolerance = 1e-9;
    const auto reference = make_smooth_engine(tight),
               plain = make_smooth_engine(rods(1, 1, 1, form));
    reference->advance(4);
    plain->advance(4);
    for (const double length : {1e-8, 1e-6, 1e-3, 1e4, 1e6, 1e8})
      for (const double rate : {1.0, 1e-4, 1e5}) {
        const double time = std::sqrt(length) / rate, mass = length < 1 ? 1e-9 : 1e7;
        INFO("length " << length << " time " << time << " formulation " << static_cast<int>(form));
        const auto e = make_smooth_engine(rods(length, time, mass, form));
        e->advance(4 * time);
        CHECK(e->time() == Approx(4 * time).epsilon(1e-14));
        for (std::size_t b = 0; b < 2; ++b) {
          const BodyState &found = e->bodies()[b], &wanted = reference->bodies()[b];
          CHECK((found.position / length - wanted.position).norm() < 1e-5);
          CHECK((found.velocity * time / length - wanted.velocity).norm() < 3e-5);
          CHECK(found.orientation.angularDistance(wanted.orientation) < 1e-5);
        }
        const double energy = mass * length * length / (time * time);
        const Diagnostics d = e->diagnostics();
        CHECK(std::abs(d.kinetic_energy + d.potential_energy) < 1e-9 * energy);
        CHECK(d.drift < 1e-9 * std::max({length, length / time, 1 / time, energy, 1.0}));
        CHECK(e->counts().steps < 2 * plain->counts().steps);
      }
  }
}
