// Jointed scenes against known motions. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <functional>
#include <sstream>
#include <tether/scene/words.hpp>

#include "mechanisms.hpp"
#include "support/catch.hpp"

using namespace tether::scene;
using namespace mechanisms;

namespace {

double energy(const Engine& engine) {
  const Diagnostics d = engine.diagnostics();
  return d.kinetic_energy + d.potential_energy;
}

struct Outcome {
  double error = 0, drift = 0, energy_change = 0;
  Counts counts;
};

Outcome run(const Scene& scene, double end, const std::function<double(const Engine&)>& error) {
  const auto engine = make_smooth_engine(scene);
  Outcome out;
  const double before = energy(*engine);
  const int stops = std::max(1, static_cast<int>(std::ceil(2 * end)));
  for (int k = 1; k <= stops; ++k) {
    engine->advance(end * k / stops);
    out.drift = std::max(out.drift, engine->diagnostics().drift);
  }
  out.energy_change = energy(*engine) - before;
  out.error = error(*engine);
  out.counts = engine->counts();
  return out;
}

Vector3d end_of(const Engine& engine, int rod) {
  const BodyState& b = engine.bodies()[static_cast<std::size_t>(rod)];
  return b.position + b.orientation * Vector3d(0.5, 0, 0);
}

double in_plane(const Vector3d& p, double x, double y) { return std::hypot(p.x() - x, p.y() - y); }

const Formulation kForms[] = {Formulation::index1, Formulation::index0,
                              Formulation::stabilised_index2};

// Every form and tolerance: error below ten times the tolerance, constraints kept, steps bounded.
void meets(const char* what, const std::function<Scene(double)>& make, double end,
           const std::function<double(const Engine&)>& error, long steps) {
  for (const Formulation form : kForms)
    for (const double tolerance : {1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9}) {
      Scene scene = make(tolerance);
      scene.smooth->formulation = form;
      const Outcome out = run(scene, end, error);
      INFO(what << ", " << word(form) << ", tolerance " << tolerance << ", steps "
                << out.counts.steps << ", error in tolerances " << out.error / tolerance);
      CHECK(out.error < 10 * tolerance);
      CHECK(out.drift < 2e-9);
      CHECK(std::abs(out.energy_change) < 1e-9);
      CHECK(out.counts.steps < steps);
    }
}

}  // namespace

TEST_CASE("pendulum against the elliptic functions", "[smooth]") {
  // A point mass on a massless rod of 1 m (A01): inertia does not turn with a distance joint.
  const auto make = [](double tolerance) {
    Scene s = scene(tolerance);
    s.gravity = Vector3d(0, -kGravity, 0);
    s.bodies.push_back(ball("mass", {1, 0, 0}));
    s.joints.push_back(joint(JointKind::distance, 0, kWorld, {1, 0, 0}, {0, 0, 0}));
    keep_energy(s);
    return s;
  };
  meets(
      "pendulum", make, 10,
      [](const Engine& e) {
        return in_plane(e.bodies()[0].position, 0.275087462576117, -0.961419205099125);
      },
      6000);
}

TEST_CASE("a rod on a hinge has the period of the compound pendulum", "[smooth]") {
  // 4 K(1/2) sqrt(l / g), l = 2/3
  const double period = 7.41629870920548767 * std::sqrt(2.0 / 3.0 / kGravity);
  const Outcome out = run(pendulum(1e-8), period, [](const Engine& e) {
    return (e.bodies()[0].position - Vector3d(0.5, 0, 0)).norm();
  });
  CHECK(out.error < 1e-8);
}

TEST_CASE("four-bar linkage through its dead points", "[smooth]") {
  meets(
      "four-bar", [](double tolerance) { return four_bar(2, tolerance); }, 10,
      [](const Engine& e) {
        return in_plane(2 * e.bodies()[0].position, 0.328458111540815, 0.944518538178601);
      },
      6000);
}

TEST_CASE("slider-crank of equal lengths through its dead points", "[smooth]") {
  meets(
      "without gravity", [](double tolerance) { return slider_crank(M_PI / 4, 1, 0, tolerance); },
      10, [](const Engine& e) { return std::abs(e.bodies()[2].position.x() - 0.143670570267); },
      4000);
  meets(
      "with gravity", [](double tolerance) { return slider_crank(0, 6, kGravity, tolerance); }, 10,
      [](const Engine& e) { return std::abs(e.bodies()[2].position.x() + 0.104094678258); }, 8000);
}

TEST_CASE("slider-crank of equal lengths from other starts", "[smooth]") {
  // Crank angles at t = 10 of the reduced equation (design/hard_cases_more.md).
  meets(
      "at rest", [](double tolerance) { return slider_crank(M_PI / 4, 0, kGravity, tolerance); },
      10,
      [](const Engine& e) {
        return std::abs(e.bodies()[2].position.x() - 2 * std::cos(0.746757721449060));
      },
      8000);
  meets(
      "over and over", [](double tolerance) { return slider_crank(M_PI / 4, 4, 0, tolerance); }, 10,
      [](const Engine& e) {
        return std::abs(e.bodies()[2].position.x() - 2 * std::cos(42.6381845060193));
      },
      14000);
}

TEST_CASE("errors follow the tolerance through dead points", "[smooth]") {
  // By IDA's own rule for step sizes single tolerances end with 12 to 20 times their tolerance.
  for (const Formulation form : {Formulation::index1, Formulation::index0}) {
    double previous = 0;
    for (double tolerance = 1e-4; tolerance > 0.9e-9; tolerance /= std::sqrt(10.0)) {
      Scene scene = slider_crank(0, 6, kGravity, tolerance);
      scene.smooth->formulation = form;
      const Outcome out = run(scene, 10, [](const Engine& e) {
        return std::abs(e.bodies()[2].position.x() + 0.104094678258);
      });
      INFO(word(form) << ", tolerance " << tolerance << ", error in tolerances "
                      << out.error / tolerance);
      CHECK(out.error < tolerance);
      if (previous > 0) {
        CHECK(previous / out.error > 2.5);
        CHECK(previous / out.error < 5);
      }
      previous = out.error;
    }
  }
}

TEST_CASE("four-bar linkage at speed from the side", "[smooth]") {
  // IDA's own first step is 1e-12 s, in which index 2 has no multipliers but rounding.
  meets(
      "fast four-bar", [](double tolerance) { return four_bar(1, tolerance, -1, 8); }, 10,
      [](const Engine& e) {
        return in_plane(2 * e.bodies()[0].position, -0.028189367516752, -0.999602600816447);
      },
      8000);
}

TEST_CASE("slider-crank close to equal lengths turns back at its dead points", "[smooth]") {
  // The coupler is a millionth longer: at 90 degrees it turns round within 1e-3 rad of the crank,
  // and both rods go on together, the slider near 0. Pivots of the joints fall to 1.4e-3.
  meets(
      "without gravity",
      [](double tolerance) { return slider_crank(0.9, 3, 0, tolerance, 1.000001); }, 3,
      [](const Engine& e) {
        return in_plane(e.bodies()[1].position, -0.341013291007, 0.365663007915) +
               std::abs(e.bodies()[2].position.x() - 1.466214516e-6);
      },
      5600);
  meets(
      "with gravity",
      [](double tolerance) { return slider_crank(0.9, 3, kGravity, tolerance, 1.000001); }, 3,
      [](const Engine& e) {
        return in_plane(e.bodies()[1].position, 0.331587016265, -0.487630501124) +
               std::abs(e.bodies()[2].position.x() - 0.442117529582);
      },
      6700);
}

TEST_CASE("double pendulum", "[smooth]") {
  meets(
      "double pendulum", double_pendulum, 1,
      [](const Engine& e) {
        return in_plane(e.bodies()[1].position, -1.444818849943475, -1.321794461381465);
      },
      3000);
}

TEST_CASE("five rods", "[smooth]") {
  for (const double tolerance : {1e-5, 1e-8}) {
    const Outcome out = run(chain(5, tolerance), 2, [](const Engine& e) {
      return in_plane(end_of(e, 4), -4.596001576614814, -0.756076430632311);
    });
    CHECK(out.error < 10 * tolerance);
    CHECK(std::abs(out.energy_change) < 1e-10);
  }
}

TEST_CASE("a free top keeps energy and angular momentum for 100 s", "[smooth]") {
  const Scene scene = top({1, 1, 1}, 1e-6);
  const auto engine = make_smooth_engine(scene);
  const Diagnostics start = engine->diagnostics();
  for (int k = 1; k <= 100; ++k) {
    engine->advance(k);
    const Diagnostics now = engine->diagnostics();
    CHECK(std::abs(now.kinetic_energy - start.kinetic_energy) < 1e-9);
    CHECK((now.angular_momentum - start.angular_momentum).norm() < 1e-9);
  }
  const BodyState& b = engine->bodies()[0];
  const Vector3d w = b.orientation.conjugate() * b.angular_velocity;
  CHECK((w - Vector3d(-0.509766254382673, -1.319143042240931, 0.867921201128947)).norm() < 1e-4);

  // T-handle: 20.7546 s from flip to flip, the first at half of that.
  const auto handle = make_smooth_engine(top({0.01, 1, 0}, 1e-8));
  handle->advance(10.3773 - 0.01);
  const auto along = [&] {
    const BodyState& h = handle->bodies()[0];
    return (h.orientation.conjugate() * h.angular_velocity).y();
  };
  CHECK(along() > 0);
  handle->advance(10.3773 + 0.01);
  CHECK(along() < 0);
  handle->advance(100);
  CHECK(std::abs(handle->diagnostics().kinetic_energy - 0.5 * (1e-4 + 2)) < 1e-9);
}

TEST_CASE("a spring without rest length makes ellipses", "[smooth]") {
  Scene s = scene(1e-8);
  s.bodies.push_back(ball("mass", {1, 0, 0}, 2));
  s.bodies[0].velocity = {0, 0.5, 0};
  Spring spring;
  spring.first = 0;
  spring.second = kWorld;
  spring.at = {1, 0, 0};
  spring.at_second = {0, 0, 0};
  spring.stiffness = 18;  // frequency 3
  spring.rest = 0;
  s.springs.push_back(spring);
  keep_energy(s);
  s.invariants.push_back({InvariantKind::angular_momentum, true, {}});
  const Outcome out = run(s, 20, [](const Engine& e) {
    return in_plane(e.bodies()[0].position, std::cos(60.0), 0.5 / 3 * std::sin(60.0));
  });
  CHECK(out.error < 1e-6);
  CHECK(out.drift < 1e-12);
}

TEST_CASE("Bricard's linkage, redundant everywhere", "[smooth]") {
  meets(
      "Bricard", bricard, 7,
      [](const Engine& e) {
        return (end_of(e, 1) - Vector3d(-0.784913056605, -0.981403582262, -0.191955746785)).norm();
      },
      5000);
}

TEST_CASE("flyball governor: stiff springs with dampers, energy by their work", "[smooth]") {
  for (const double tolerance : {1e-5, 1e-7}) {
    const auto engine = make_smooth_engine(governor(tolerance));
    const double Lz = engine->diagnostics().angular_momentum.z();
    CHECK(std::abs(Lz - 53.8689986584) < 1e-9);
    engine->advance(5);
    CHECK(std::abs(engine->bodies()[3].position.z() - 0.535563103722) < 10 * tolerance);
    CHECK(std::abs(engine->bodies()[3].angular_velocity.z() - 6.022496499759) < 100 * tolerance);
    CHECK(std::abs(engine->diagnostics().angular_momentum.z() - Lz) < 1e-9);
    CHECK(engine->diagnostics().drift < 1e-9);
  }
}

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

TEST_CASE("a saved run and a restored one go on with the same bits", "[smooth]") {
  for (const Formulation form : kForms) {
    Scene s = four_bar(1, 1e-6);
    s.smooth->formulation = form;
    const auto a = make_smooth_engine(s);
    a->advance(0.613);
    std::stringstream state;
    a->save(state);
    a->advance(2);
    const auto b = make_smooth_engine(s);
    b->advance(0.2);
    b->restore(state);
    CHECK(b->time() == 0.613);
    b->advance(2);
    for (std::size_t k = 0; k < s.bodies.size(); ++k) {
      CHECK(a->bodies()[k].position == b->bodies()[k].position);
      CHECK(a->bodies()[k].orientation.coeffs() == b->bodies()[k].orientation.coeffs());
      CHECK(a->bodies()[k].velocity == b->bodies()[k].velocity);
      CHECK(a->bodies()[k].angular_velocity == b->bodies()[k].angular_velocity);
    }
  }
  std::stringstream state;
  make_smooth_engine(pendulum(1e-6))->save(state);
  CHECK_THROWS_AS(make_smooth_engine(four_bar(1, 1e-6))->restore(state), std::runtime_error);
  std::stringstream nonsense("nonsense");
  CHECK_THROWS_AS(make_smooth_engine(four_bar(1, 1e-6))->restore(nonsense), std::runtime_error);
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
