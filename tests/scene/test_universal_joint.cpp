// The universal joint against the closed form of a Cardan shaft. SPDX-License-Identifier:
// BSD-3-Clause
#include <cmath>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>

#include "smooth_runs.hpp"

using namespace mechanisms;

namespace {

/// The shaft `in` along x and the shaft `out` at the angle `beta` to it in the plane of x and y,
/// each hinged to the world; the cross between them has its arm on `in` along z, normal to that
/// plane: tan(angle of out) = tan(angle of in) cos(beta).
struct CardanShaft {
  double beta;
  Vector3d along() const { return {std::cos(beta), std::sin(beta), 0}; }
  /// Rate of out over that of in, at the angle of in.
  double ratio(double angle) const {
    const double c = std::cos(angle), s = std::sin(angle);
    return std::cos(beta) / (c * c + std::pow(std::cos(beta) * s, 2));
  }

  Scene scene(double tolerance, double speed) const {
    Scene s = mechanisms::scene(tolerance);
    s.bodies.push_back(rod("in", {-1, 0, 0}, {0, 0, 0}, 2, 0.5));
    s.bodies.push_back(rod("out", {0, 0, 0}, along(), 1, 0.3));
    s.bodies[0].angular_velocity = speed * Vector3d::UnitX();
    s.bodies[1].angular_velocity = speed * ratio(0) * along();
    s.joints.push_back(hinge(0, kWorld, {-1, 0, 0}, Vector3d::UnitX()));
    s.joints.push_back(hinge(1, kWorld, along(), along()));
    Joint cross = joint(JointKind::universal, 0, 1, Vector3d::Zero());
    cross.axis = Vector3d::UnitZ();
    cross.axis_second = along().cross(Vector3d::UnitZ());
    s.joints.push_back(cross);
    return s;
  }
};

/// Angle by which a body has turned about `axis` since `start`, from -pi to pi.
double turned(const BodyState& now, const Body& start, const Vector3d& axis) {
  const Eigen::Quaterniond change = now.orientation * start.orientation.conjugate();
  return std::remainder(2 * std::atan2(change.vec().dot(axis), change.w()),
                        2 * 3.14159265358979324);
}

}  // namespace

TEST_CASE("a driven Cardan shaft turns by tan(out) = tan(in) cos(beta), in every form",
          "[joints]") {
  for (const double beta : {0.2, 0.7, 1.2})
    for (const Formulation form : kForms)
      for (const double tolerance : {1e-6, 1e-8}) {
        const CardanShaft shaft{beta};
        const double speed = 3;
        Scene s = shaft.scene(tolerance, speed);
        s.smooth->formulation = form;
        s.joints[0].motion.emplace().rate = speed;
        const auto engine = make_smooth_engine(s);
        double error = 0, drift = 0;
        for (int k = 1; k <= 20; ++k) {
          const double t = 0.15 * k, in = speed * t;
          engine->advance(t);
          const double out = turned(engine->bodies()[1], s.bodies[1], shaft.along());
          const double expected = std::atan2(std::sin(in) * std::cos(beta), std::cos(in));
          error =
              std::max(error, std::abs(std::remainder(out - expected, 2 * 3.14159265358979324)));
          drift = std::max(drift, engine->diagnostics().drift);
        }
        INFO("beta " << beta << ", " << word(form) << ", tolerance " << tolerance << ", error "
                     << error << ", drift " << drift);
        CHECK(error < 10 * tolerance);
        CHECK(drift < 2e-9);
        CHECK(engine->counts().steps < 3000);
      }
}

TEST_CASE("a free Cardan shaft keeps its energy: the speed follows from the angle", "[joints]") {
  const CardanShaft shaft{0.9};
  for (const Formulation form : kForms) {
    Scene s = shaft.scene(1e-8, 2);
    s.smooth->formulation = form;
    keep_energy(s);
    const auto engine = make_smooth_engine(s);
    // Moments of inertia about the shafts: thin times mass in rod().
    const double J_in = 1.0, J_out = 0.3;
    const double twice = J_in * 4 + J_out * std::pow(2 * shaft.ratio(0), 2);
    for (int k = 1; k <= 5; ++k) {
      engine->advance(0.6 * k);
      const double in = turned(engine->bodies()[0], s.bodies[0], Vector3d::UnitX());
      const double speed = std::sqrt(twice / (J_in + J_out * std::pow(shaft.ratio(in), 2)));
      CHECK(std::abs(engine->bodies()[0].angular_velocity.x() - speed) < 1e-6);
      CHECK(engine->diagnostics().drift < 2e-9);
    }
  }
}

TEST_CASE("two universal joints in phase give the speed back", "[joints]") {
  // A middle shaft at beta between parallel ones, its two arms parallel.
  const double beta = 0.5;
  const Vector3d along(std::cos(beta), std::sin(beta), 0), across = along.cross(Vector3d::UnitZ());
  Scene s = mechanisms::scene(1e-7);
  s.bodies.push_back(rod("in", {-1, 0, 0}, {0, 0, 0}, 1, 0.5));
  s.bodies.push_back(rod("middle", {0, 0, 0}, along, 1, 0.5));
  s.bodies.push_back(rod("out", along, along + Vector3d::UnitX(), 1, 0.5));
  s.bodies[0].angular_velocity = s.bodies[2].angular_velocity = Vector3d::UnitX();
  s.bodies[1].angular_velocity = std::cos(beta) * along;
  s.joints.push_back(hinge(0, kWorld, {-1, 0, 0}, Vector3d::UnitX()));
  s.joints[0].motion.emplace().rate = 1;
  s.joints.push_back(hinge(2, kWorld, along + Vector3d::UnitX(), Vector3d::UnitX()));
  s.joints.push_back(joint(JointKind::universal, 0, 1, Vector3d::Zero()));
  s.joints.back().axis = Vector3d::UnitZ();
  s.joints.back().axis_second = across;
  s.joints.push_back(joint(JointKind::universal, 1, 2, along));
  s.joints.back().axis = across;
  s.joints.back().axis_second = Vector3d::UnitZ();
  const auto engine = make_smooth_engine(s);
  for (int k = 1; k <= 6; ++k) {
    engine->advance(k);
    CHECK(std::abs(std::remainder(turned(engine->bodies()[2], s.bodies[2], Vector3d::UnitX()) - k,
                                  2 * 3.14159265358979324)) < 1e-6);
  }
}

TEST_CASE("universal joints in scene files: read, written, planned, refused", "[joints]") {
  const std::string bodies =
      "[[body]]\nname = \"a\"\nshape = \"sphere\"\nradius = 1\nmass = 1\n"
      "[[body]]\nname = \"b\"\nshape = \"sphere\"\nradius = 1\nmass = 1\nposition = [2, 0, 0]\n";
  const std::string joint =
      "[[joint]]\nkind = \"universal\"\nbodies = [\"a\", \"b\"]\nat = [1, 0, 0]\n";
  const Scene s = parse_scene(bodies + joint + "axis = [[0, 0, 2], [0, 1, 0]]\n", "cross.toml");
  REQUIRE(s.joints.size() == 1);
  CHECK(s.joints[0].kind == JointKind::universal);
  CHECK(write_scene(parse_scene(write_scene(s), "again")) == write_scene(s));
  const Plan plan = make_plan(s);
  CHECK(plan.rows == 4);
  REQUIRE(!plan.effects.empty());
  CHECK(plan.effects[0].detail == "1 universal");
  CHECK_THROWS_WITH(parse_scene(bodies + joint, "wrong"), Catch::Contains("axis: is missing"));
  CHECK_THROWS_WITH(parse_scene(bodies + joint + "axis = [[0, 0, 1], [0, 1, 1]]\n", "wrong"),
                    Catch::Contains("at right angles"));
  CHECK_THROWS_WITH(
      parse_scene(bodies + joint + "axis = [[0, 0, 1], [0, 1, 0]]\nmotion = {rate = 1}\n", "wrong"),
      Catch::Contains("motion"));
  Scene by_hand = s;
  by_hand.joints[0].axis_second = {0, 1, 1};
  CHECK_THROWS_WITH(make_smooth_engine(by_hand), Catch::Contains("not at right angles"));
}

TEST_CASE("every kind of joint has a word and rows", "[joints]") {
  for (const auto& [text, kind] : Words<JointKind>::list) {
    Joint each = joint(kind, 0, 1, {0, 0, 0}, {1, 0, 0});
    INFO(text);
    CHECK(joint_rows(each) > 0);
  }
}
