// Jointed scenes against known motions. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>

#include "linalg/thrown.hpp"
#include "smooth_runs.hpp"

using namespace tether::scene;
using namespace mechanisms;
using tether::test::contains;

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
      8000);
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
        CHECK(previous / out.error < 6);
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

TEST_CASE("a four-bar linkage that starts at its dead point", "[smooth]") {
  // All three rods in one line, where the joints have one row less of rank: phi'' = 1.2 g sin phi.
  const double end = 3, speed = 4;
  double phi = M_PI / 2, rate = speed;
  const int steps = 100000;
  const double h = end / steps;
  for (int k = 0; k < steps; ++k) {  // Runge and Kutta's of order 4
    const auto bend = [](double angle) { return 1.2 * kGravity * std::sin(angle); };
    const double a1 = bend(phi), v2 = rate + h / 2 * a1, a2 = bend(phi + h / 2 * rate);
    const double v3 = rate + h / 2 * a2, a3 = bend(phi + h / 2 * v2);
    const double v4 = rate + h * a3, a4 = bend(phi + h * v3);
    phi += h / 6 * (rate + 2 * v2 + 2 * v3 + v4);
    rate += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
  }
  for (const double tolerance : {1e-4, 1e-6, 1e-8}) {
    Scene scene = four_bar(1, tolerance, M_PI / 2, speed);
    scene.smooth->formulation = Formulation::index0;  // has no multipliers, which are none there
    const Outcome out = run(scene, end, [&](const Engine& e) {
      const double x = std::sin(phi), y = std::cos(phi);
      return in_plane(2 * e.bodies()[0].position, x, y) +
             in_plane(2 * (e.bodies()[1].position - Vector3d::UnitX()), x, y);
    });
    INFO("tolerance " << tolerance << ", error in tolerances " << out.error / tolerance);
    CHECK(out.error < tolerance);
    CHECK(out.drift < 2e-9);
    CHECK(std::abs(out.energy_change) < 1e-9);
  }
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

TEST_CASE("smooth: a run that ends at a dead point names the joints that depend on each other") {
  // A ball on two rods in one line, and a third one across it that has nothing to do with that.
  Scene taut = scene(1e-6);
  taut.gravity = Vector3d(0, 0, -9.81);
  taut.bodies.push_back(rod("ball", {0, 0, -0.1}, {0, 0, 0.1}));
  taut.bodies.push_back(rod("beside", {0, 3, -0.1}, {0, 3, 0.1}));
  const auto hold = [&](const char* name, int body, const Vector3d& from, const Vector3d& to) {
    taut.joints.push_back(joint(JointKind::distance, body, kWorld, from, to));
    taut.joints.back().name = name;
  };
  hold("left", 0, {0, 0, 0}, {-1, 0, 0});
  hold("beside", 1, {0, 3, 0}, {0, 4, 0});
  hold("right", 0, {0, 0, 0}, {1, 0, 0});
  const std::string text =
      tether::test::thrown<SimulationError>([&] { make_smooth_engine(taut)->advance(0.5); });
  INFO(text);
  CHECK(contains(text, "singular position"));
  CHECK(contains(text, "\"left\""));
  CHECK(contains(text, "\"right\""));
  CHECK_FALSE(contains(text, "\"beside\""));
}
