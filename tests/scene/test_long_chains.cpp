// Smooth scenes of many bodies. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>

#include "smooth_runs.hpp"

using namespace tether::scene;
using namespace mechanisms;

namespace {

/// Rods of 1 m on ball joints, in a line along x from (0, y, 0), at rest; every third one is
/// hinged.
void add_chain(Scene& s, int links, double y) {
  const int first = static_cast<int>(s.bodies.size());
  for (int i = 0; i < links; ++i) {
    s.bodies.push_back(rod("rod " + std::to_string(first + i), {double(i), y, 0}, {i + 1.0, y, 0}));
    Joint j = joint(i % 3 == 2 ? JointKind::hinge : JointKind::ball, i ? first + i - 1 : kWorld,
                    first + i, {double(i), y, 0});
    j.axis = Vector3d(0, 1, 0);
    s.joints.push_back(j);
  }
}

Scene chains(int links, int chains, double tolerance) {
  Scene s = scene(tolerance);
  s.gravity = Vector3d(0, 0, -kGravity);
  for (int i = 0; i < chains; ++i) add_chain(s, links, i);
  return s;
}

}  // namespace

TEST_CASE("many joints move as few do: one chain beside nine others", "[smooth]") {
  // Alone its rows are dense, with the others sparse.
  const double tolerance = 1e-8;
  const Scene alone = chains(6, 1, tolerance), among = chains(6, 10, tolerance);
  const auto one = make_smooth_engine(alone), many = make_smooth_engine(among);
  for (const double t : {0.1, 0.4}) {
    one->advance(t);
    many->advance(t);
    for (std::size_t k = 0; k < 60; ++k) {
      const BodyState &a = one->bodies()[k % 6], &b = many->bodies()[k];
      INFO("t = " << t << ", body " << k);
      CHECK((a.position - b.position + Vector3d(0, double(k / 6), 0)).norm() < 1e-6);
      CHECK((a.velocity - b.velocity).norm() < 1e-5);
      CHECK((a.angular_velocity - b.angular_velocity).norm() < 1e-5);
    }
  }
  CHECK(many->diagnostics().drift < 1e-10);
  CHECK(many->counts().steps < 1.5 * double(one->counts().steps));
}

TEST_CASE("a chain of 300 links keeps its joints and its energy", "[smooth]") {
  // Dense rows would cost the cube of the links.
  Scene s = chains(300, 1, 1e-6);
  keep_energy(s);
  const auto engine = make_smooth_engine(s);
  const double energy =
      engine->diagnostics().kinetic_energy + engine->diagnostics().potential_energy;
  engine->advance(0.3);
  const Diagnostics d = engine->diagnostics();
  CHECK(d.drift < 1e-10);
  CHECK(d.kinetic_energy > 1);
  CHECK(std::abs(d.kinetic_energy + d.potential_energy - energy) < 1e-6 * d.kinetic_energy);
  // The far end falls freely, the first rod turns about its joint.
  CHECK(engine->bodies()[290].position.z() < engine->bodies()[0].position.z());
  CHECK(engine->counts().steps < 400);
}
