// Attraction by a point against Kepler's closed form, in both engines. SPDX-License-Identifier:
// BSD-3-Clause
#include <cmath>
#include <string>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>

#include "smooth_runs.hpp"

using namespace mechanisms;

namespace {

constexpr double kPi = 3.14159265358979323846;

/// An ellipse about `centre`, in the plane of the orthonormal vectors p (to the pericentre) and q.
struct Orbit {
  double GM, a, e;
  Vector3d centre = Vector3d::Zero(), p = Vector3d::UnitX(), q = Vector3d::UnitY();

  double period() const { return 2 * kPi * std::sqrt(a * a * a / GM); }
  double eccentric_anomaly(double t) const {  // E - e sin E = M
    const double M = 2 * kPi * t / period();
    double E = M;
    for (int k = 0; k < 50; ++k) E -= (E - e * std::sin(E) - M) / (1 - e * std::cos(E));
    return E;
  }
  Vector3d position(double t) const {
    const double E = eccentric_anomaly(t);
    return centre + a * (std::cos(E) - e) * p + a * std::sqrt(1 - e * e) * std::sin(E) * q;
  }
  Vector3d velocity(double t) const {
    const double E = eccentric_anomaly(t);
    const double rate = std::sqrt(GM / (a * a * a)) / (1 - e * std::cos(E));
    return rate * (-a * std::sin(E) * p + a * std::sqrt(1 - e * e) * std::cos(E) * q);
  }
};

Scene satellite(const Orbit& orbit, double mass = 3) {
  Scene s;
  s.bodies.push_back(ball("satellite", orbit.position(0), mass, 1e-4 * mass * orbit.a * orbit.a));
  s.bodies[0].velocity = orbit.velocity(0);
  s.central_gravity.push_back({orbit.centre, orbit.GM, {}});
  s.end = orbit.period();
  return s;
}

const Orbit kTilted{
    2.5, 1.3, 0.5, Vector3d(0.3, -0.2, 0.4), Vector3d(2, 1, 2) / 3, Vector3d(1, 2, -2) / 3};

}  // namespace

TEST_CASE("a Kepler orbit of the smooth engine is the ellipse in time", "[effects]") {
  for (const double tolerance : {1e-5, 1e-7, 1e-9}) {
    Scene s = satellite(kTilted);
    s.smooth.emplace().tolerance = tolerance;
    const double end = 2.3 * kTilted.period();
    const Outcome out = run(s, end, [&](const Engine& engine) {
      return (engine.bodies()[0].position - kTilted.position(end)).norm();
    });
    INFO("tolerance " << tolerance << ", error in tolerances " << out.error / tolerance);
    // An error of the energy changes the period: after n orbits it is 3 pi n times as large along
    // the orbit, 30 here, of the ten tolerances of other scenes.
    CHECK(out.error < 300 * tolerance);
    CHECK(out.counts.steps < 5000);
  }
}

TEST_CASE("energy of a Kepler orbit is -GM m / 2a, and kept by the projection", "[effects]") {
  Scene s = satellite(kTilted);
  s.smooth.emplace().tolerance = 1e-5;
  keep_energy(s);
  const Outcome out = run(s, 3 * kTilted.period(), [](const Engine& engine) {
    return std::abs(energy(engine) + kTilted.GM * 3 / (2 * kTilted.a));
  });
  CHECK(out.error < 1e-9);
  CHECK(std::abs(out.energy_change) < 1e-9);
}

TEST_CASE("a centre at the origin leaves all of angular momentum, elsewhere one axis of it",
          "[effects]") {
  for (const bool at_origin : {true, false}) {
    Orbit orbit = kTilted;
    if (at_origin) orbit.centre.setZero();
    Scene s = satellite(orbit);
    s.smooth.emplace().tolerance = 1e-6;
    s.invariants.push_back({InvariantKind::angular_momentum, true, {}});
    CHECK(make_plan(s).engine == EngineKind::smooth);
    const auto engine = make_smooth_engine(s);
    const Vector3d before = engine->diagnostics().angular_momentum;
    engine->advance(orbit.period());
    const Vector3d change = engine->diagnostics().angular_momentum - before;
    CHECK(std::abs(change.dot(at_origin ? before.normalized() : orbit.centre.normalized())) < 1e-9);
    if (at_origin) CHECK(change.norm() < 1e-9);

    s.invariants[0].kind = InvariantKind::momentum;
    CHECK_THROWS_WITH(make_smooth_engine(s),
                      Catch::Contains("central gravity pushes from outside"));
  }
}

TEST_CASE("orbits of every size: a satellite of the earth and a speck of dust", "[effects]") {
  for (const Orbit& orbit : {Orbit{3.986004418e14, 7e6, 0.1}, Orbit{1e-18, 1e-6, 0.3}}) {
    Scene s = satellite(orbit, orbit.a > 1 ? 500 : 1e-12);
    s.smooth.emplace().tolerance = 1e-8;
    const auto engine = make_smooth_engine(s);
    const double end = 1.4 * orbit.period();
    engine->advance(end);
    CHECK((engine->bodies()[0].position - orbit.position(end)).norm() < 1e-6 * orbit.a);
    CHECK(engine->counts().steps < 2000);
  }
}

TEST_CASE("a Kepler orbit of the stepping engine is of first order and keeps its size",
          "[effects]") {
  double before = 0;
  for (const int steps : {2000, 4000, 8000}) {
    Scene s = satellite(kTilted);
    s.stepping.emplace().step = kTilted.period() / steps;
    const auto engine = make_stepping_engine(s);
    const double start = energy(*engine);
    CHECK(std::abs(start + kTilted.GM * 3 / (2 * kTilted.a)) < 1e-12);
    const double end = 0.35 * kTilted.period();  // after a whole orbit it would be of second order
    engine->advance(end);
    const double error = (engine->bodies()[0].position - kTilted.position(end)).norm();
    CHECK(error < 40.0 / steps);
    if (before > 0) CHECK(std::abs(before / error - 2) < 0.1);
    before = error;
    CHECK(std::abs(energy(*engine) - start) < 0.01 * std::abs(start));
  }
}

TEST_CASE("central gravity in a scene file: read, written, planned, refused", "[effects]") {
  const std::string body =
      "[[body]]\nname = \"a\"\nshape = \"sphere\"\nradius = 0.1\nmass = 1\n"
      "position = [1, 0, 0]\n";
  const std::string text = body +
                           "[[central_gravity]]\nat = [0, 0, 0.1]\n"
                           "gravitational_parameter = 2.5\n";
  const Scene s = parse_scene(text, "orbit.toml");
  REQUIRE(s.central_gravity.size() == 1);
  CHECK(s.central_gravity[0].at == Vector3d(0, 0, 0.1));
  CHECK(s.central_gravity[0].gravitational_parameter == 2.5);
  CHECK(write_scene(parse_scene(write_scene(s), "again")) == write_scene(s));
  const Plan plan = make_plan(s);
  REQUIRE(plan.effects.size() == 1);
  CHECK(plan.effects[0].name == "central gravity");
  CHECK(plan.effects[0].detail == "1 centre");
  CHECK_THROWS_WITH(parse_scene(body + "[[central_gravity]]\nat = [1, 0, 0]\n"
                                       "gravitational_parameter = -1\n",
                                "wrong"),
                    Catch::Contains("gravitational_parameter = -1"));
  CHECK_THROWS_WITH(parse_scene(body + "[[central_gravity]]\n", "wrong"),
                    Catch::Contains("gravitational_parameter: is missing"));
  CHECK_THROWS_WITH(parse_scene(body + "[[central_gravity]]\nat = [1, 0, 0]\n"
                                       "gravitational_parameter = 1\n",
                                "wrong"),
                    Catch::Contains("the attraction is infinite there"));
}

TEST_CASE("both engines exert the same forces: they meet as the step goes to zero", "[effects]") {
  Scene s;
  s.gravity = Vector3d(0.1, -0.3, -2);
  s.central_gravity.push_back({Vector3d(0, 3, 0), 4.0, {}});
  for (int i = 0; i < 2; ++i) {
    Body body = rod("body " + std::to_string(i), {1.0 * i, 0.2, 0}, {1.0 * i, 0.5, 1});
    body.inertia << 0.2, 0.01, 0.02, 0.01, 0.3, 0.03, 0.02, 0.03, 0.4;
    body.velocity = Vector3d(0.3 - i, 0.1, 0.4);
    body.angular_velocity = Vector3d(1, -0.5 * i, 0.7);
    s.bodies.push_back(body);
  }
  s.bodies[0].drag = {0.3, 0.2, 0.1};
  Spring spring;
  spring.first = 0;
  spring.second = 1;
  spring.at = {0, 0.3, 0.1};
  spring.at_second = {1, 0.4, 1};
  spring.stiffness = 6;
  spring.damping = 0.4;
  s.springs.push_back(spring);
  spring.second = kWorld;
  spring.damping = 0;
  spring.rest = 0.5;
  s.springs.push_back(spring);
  s.loads.push_back({1, Vector3d(0.3, 0.2, -0.1), Vector3d(0.05, -0.02, 0.1), {}});

  Scene smooth = s;
  smooth.smooth.emplace().tolerance = 1e-10;
  const auto reference = make_smooth_engine(smooth);
  reference->advance(1.0);
  double before = 0;
  for (const double step : {1e-3, 5e-4, 2.5e-4}) {
    Scene stepped = s;
    stepped.stepping.emplace().step = step;
    const auto engine = make_stepping_engine(stepped);
    CHECK(std::abs(engine->diagnostics().potential_energy -
                   make_smooth_engine(smooth)->diagnostics().potential_energy) < 1e-12);
    engine->advance(1.0);
    double error = 0;
    for (std::size_t b = 0; b < 2; ++b) {
      error =
          std::max(error, (engine->bodies()[b].position - reference->bodies()[b].position).norm());
      error = std::max(error, engine->bodies()[b].orientation.angularDistance(
                                  reference->bodies()[b].orientation));
    }
    INFO("step " << step << ", error " << error);
    CHECK(error < 10 * step);
    if (before > 0) CHECK(std::abs(before / error - 2) < 0.2);
    before = error;
  }
}
