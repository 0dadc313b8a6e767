// The event engine far from the origin. SPDX-License-Identifier: BSD-3-Clause
#include "event_runs.hpp"

using namespace event_runs;

namespace {

// A rod on a hinge, a ball on a spring between its tip and the world, a floor below both; at a
// place. What it says is exact at multiples of 1/16 m, as these are there.
std::string text(const Vector3d& at) {
  const auto place = [&](double x, double y, double z) {
    return "[" + number(at.x() + x) + ", " + number(at.y() + y) + ", " + number(at.z() + z) + "]";
  };
  return "[scene]\nengine = \"event\"\nend = 1\ngravity = [0, 0, -9.81]\n[event]\ntolerance = "
         "1e-8\n"
         "[[body]]\nname = \"floor\"\nshape = \"plane\"\nfixed = true\nmaterial = \"a\"\n"
         "position = " +
         place(0, 0, -0.5) +
         "\n[[body]]\nname = \"rod\"\nshape = \"sphere\"\nradius = 0.0625\nmaterial = \"a\"\nmass "
         "= 1\n"
         "inertia = [0.1, 0.1, 0.01]\nposition = " +
         place(0.25, 0, 0) +
         "\n[[body]]\nname = \"ball\"\nshape = \"sphere\"\nradius = 0.125\nmass = 2\nmaterial = "
         "\"a\"\n"
         "position = " +
         place(-0.25, 0.125, 0.25) +
         "\nvelocity = [0.5, 0, 0]\n[[joint]]\nkind = \"hinge\"\nbodies = [\"rod\", \"world\"]\n"
         "axis = [0, 1, 0]\nat = " +
         place(-0.25, 0, 0.25) +
         "\n[[spring]]\nbodies = [\"ball\", \"rod\"]\nstiffness = 20\nat = [" +
         place(-0.25, 0.125, 0.25) + ", " + place(0.25, 0, 0) + "]\n" +
         "[[pair]]\nbetween = [\"a\", \"a\"]\nfriction = 0.25\nrestitution = 0.5\n";
}

Scene scene_at(const Vector3d& at) { return parse_scene(text(at), "test"); }

}  // namespace

TEST_CASE("event: a scene moved far away moves with the bits of the one near the origin") {
  const Vector3d far(8192, -4096, 16384);
  const Scene scene = scene_at(far);
  REQUIRE(make_plan(scene).engine == EngineKind::event);
  const auto here = make_engine(scene_at(Vector3d::Zero())), there = make_engine(scene);
  double from_weight = 0;
  for (const double t : {0.1, 0.35, 0.6, 1.0}) {
    CAPTURE(t);
    here->advance(t);
    there->advance(t);
    for (std::size_t b = 0; b < 3; ++b) {
      CHECK(there->bodies()[b].position == here->bodies()[b].position + far);
      CHECK(there->bodies()[b].velocity == here->bodies()[b].velocity);
      CHECK(there->bodies()[b].orientation.coeffs() == here->bodies()[b].orientation.coeffs());
    }
    REQUIRE(there->events().size() == here->events().size());
    for (std::size_t k = 0; k < here->events().size(); ++k) {
      CHECK(there->events()[k].time == here->events()[k].time);
      CHECK(there->events()[k].impulse == here->events()[k].impulse);
    }
    // Energy and angular momentum count from the world's origin.
    const Diagnostics a = here->diagnostics(), b = there->diagnostics();
    from_weight = 3 * 9.81 * far.z();
    CHECK(b.potential_energy - a.potential_energy == Approx(from_weight).epsilon(1e-14));
    CHECK(b.kinetic_energy == a.kinetic_energy);
    CHECK((b.angular_momentum - a.angular_momentum - far.cross(a.momentum)).norm() <
          1e-12 * far.norm() * (1 + a.momentum.norm()));
    REQUIRE(there->contacts().size() == here->contacts().size());
    for (std::size_t k = 0; k < here->contacts().size(); ++k)
      CHECK(there->contacts()[k].point == here->contacts()[k].point + far);
    const Forces p = here->forces(), q = there->forces();
    REQUIRE(p.joints.size() == 1);
    REQUIRE(p.springs.size() == 1);
    CHECK(q.joints[0].at == p.joints[0].at + far);
    CHECK(q.joints[0].force == p.joints[0].force);
    CHECK(q.springs[0].at == p.springs[0].at + far);
    CHECK(q.springs[0].at_second == p.springs[0].at_second + far);
  }
  CHECK(here->events().size() >= 4);
  for (const double cut : {0.05, 0.5, 0.9}) goes_on_with_its_bits(scene, cut, 1);
  // The state of one place is none of another.
  std::stringstream state;
  there->save(state);
  CHECK_THROWS_WITH(here->restore(state), Catch::Contains("somewhere else"));
}
