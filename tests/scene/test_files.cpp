// Scene files: what is read, what is refused and where. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>
#include <vector>

#include "support/catch.hpp"
#include "texts.hpp"

using namespace tether::scene;
using Eigen::Vector3d;
using texts::kJointed;
using texts::kTouching;
using texts::with;

namespace {

/// A scene around one body, whose fields are given.
Scene body(const std::string& fields) { return parse_scene("[[body]]\n" + fields, "body.toml"); }

/// The only problem of a text.
Problem problem(const std::string& text) {
  try {
    parse_scene(text, "bad.toml");
  } catch (const SceneError& e) {
    INFO(e.what());
    REQUIRE(e.problems().size() == 1);
    CHECK(e.problems()[0].place.file == "bad.toml");
    return e.problems()[0];
  }
  FAIL("accepted:\n" << text);
  return {};
}

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

}  // namespace

TEST_CASE("every field of a scene is read") {
  const Scene s = parse_scene(kJointed, "everything.toml");
  CHECK(s.name == "everything");
  CHECK(s.end == 2.5);
  CHECK(*s.gravity == Vector3d(0.1, -0.2, -9.81));
  REQUIRE(s.smooth);
  CHECK(s.smooth->tolerance == 1e-8);
  CHECK(s.smooth->formulation == Formulation::index0);
  CHECK_FALSE(s.smooth->projection);
  CHECK(s.smooth->max_step == 0.01);
  CHECK(s.smooth->max_steps == 5000);
  CHECK(s.output["csv"] == "a.csv");
  CHECK(s.output.checkpoint == 0.5);

  REQUIRE(s.bodies.size() == 4);
  CHECK(s.bodies[0].fixed);
  CHECK(s.bodies[0].shapes[0].normal.isApprox(Vector3d(1, 2, 3).normalized()));
  const Body& rod = s.bodies[1];
  CHECK(rod.orientation.angularDistance(Eigen::Quaterniond::Identity()) == Approx(77 * M_PI / 180));
  CHECK(rod.velocity == Vector3d(1, 2, 3));
  CHECK(rod.angular_velocity == Vector3d(0.1, 0.2, 0.3));
  CHECK(rod.drag->quadratic == 0.2);
  CHECK(s.bodies[2].shapes.size() == 3);
  CHECK(s.bodies[2].inertia(1, 2) == 0.3);

  REQUIRE(s.joints.size() == 5);
  CHECK(s.joints[0].axis.isApprox(Vector3d(0, 0.6, 0.8)));
  CHECK(s.joints[0].motion->rate == Approx(M_PI / 6));
  CHECK(s.joints[0].motion->phase == Approx(M_PI / 2));
  CHECK(s.joints[0].second == -1);
  CHECK(s.joints[1].name == "joint 2");
  CHECK(*s.joints[1].length == 2.5);
  CHECK(s.joints[1].at_second == Vector3d(3, 0, 0));
  CHECK(s.joints[4].first == -1);
  CHECK(*s.springs[0].rest == 0.5);
  CHECK(s.loads[0].torque == Vector3d(4, 5, 6));
  CHECK(s.invariants[0].project);
  CHECK_FALSE(s.invariants[1].project);
  CHECK(s.expect[0].throughout);
  CHECK(s.expect[1].time == 2.5);
  CHECK(*s.expect[1].at_least == -1);
  CHECK(s.expect[2].place.line > s.expect[1].place.line);

  const Scene t = parse_scene(kTouching, "box.toml");
  CHECK(t.stepping->law == tether::contact::Law::maximum_dissipation);
  CHECK(t.stepping->gyroscopic == Gyroscopic::implicit_step);
  CHECK(t.stepping->restitution_law == RestitutionLaw::poisson);
  CHECK(t.stepping->restitution_threshold == 0.02);
  CHECK(t.stepping->impact_threshold == 0.03);
  CHECK(t.stepping->acceptance == 10);
  CHECK(t.stepping->max_halvings == 2);
  CHECK(t.stepping->max_sweeps == 500);
  CHECK(t.stepping->accuracy == 1e-3);
  CHECK(t.stepping->on_failure == OnFailure::warn);
  CHECK(t.stepping->threads == 2);
  CHECK(t.pairs[0].friction == 0.3);
  CHECK(t.pairs[0].restitution == 0.5);
}

TEST_CASE("a scene written with its defaults reads as the same scene, to the last bit") {
  for (const std::string& text : {kJointed, kTouching, std::string("[[body]]\nfixed = true\n")}) {
    const std::string once = write_scene(parse_scene(text, "a.toml"));
    const Scene again = parse_scene(once, "a.toml");
    CHECK(write_scene(again) == once);
    const Scene first = parse_scene(text, "a.toml");
    for (std::size_t i = 0; i < first.bodies.size(); ++i) {
      CHECK(first.bodies[i].inertia == again.bodies[i].inertia);
      CHECK(first.bodies[i].mass == again.bodies[i].mass);
      CHECK(first.bodies[i].orientation.coeffs() == again.bodies[i].orientation.coeffs());
      CHECK(first.bodies[i].place.line > 0);
    }
  }
}

TEST_CASE("defaults are those of scene.hpp") {
  const Scene s = parse_scene(
      "[smooth]\n[output]\n[[body]]\nshape = \"sphere\"\nradius = 1\nmass = 1\n", "a.toml");
  const Scene d;
  CHECK(s.end == d.end);
  CHECK_FALSE(s.gravity);
  CHECK(s.smooth->tolerance == SmoothOptions{}.tolerance);
  CHECK(s.output.every == d.output.every);
  CHECK(s.bodies[0].name == "body 1");
  const Scene t = parse_scene("[stepping]\n[[body]]\nfixed = true\n", "a.toml");
  CHECK(t.stepping->step == SteppingOptions{}.step);
  CHECK(t.stepping->gyroscopic == Gyroscopic::momentum);
}

TEST_CASE("mass and inertia come from the shapes") {
  const double pi = M_PI;
  const Body sphere = body("shape = \"sphere\"\nradius = 0.5\ndensity = 1000\n").bodies[0];
  CHECK(sphere.mass == Approx(4.0 / 3 * pi * 0.125 * 1000));
  CHECK(sphere.inertia.isApprox(0.4 * sphere.mass * 0.25 * Eigen::Matrix3d::Identity()));

  const Body box = body("shape = \"box\"\nsize = [1, 2, 3]\nmass = 12\n").bodies[0];
  CHECK(box.inertia.diagonal().isApprox(Vector3d(13, 10, 5)));

  // A capsule of length 0 is nearly a sphere; its general formula against a box-free integral.
  const Body capsule =
      body("shape = \"capsule\"\nradius = 0.3\nlength = 1e-9\nmass = 2\n").bodies[0];
  CHECK(capsule.inertia.isApprox(0.4 * 2 * 0.09 * Eigen::Matrix3d::Identity(), 1e-8));

  // Unequal numbers: each moment has its own.
  const Body ellipsoid =
      body("shape = \"ellipsoid\"\nhalf_axes = [1, 2, 3]\ndensity = 5\n").bodies[0];
  CHECK(ellipsoid.mass == Approx(5 * 4.0 / 3 * pi * 6).epsilon(1e-14));
  CHECK(ellipsoid.inertia.diagonal().isApprox(ellipsoid.mass / 5 * Vector3d(13, 10, 5), 1e-14));
  const Body cylinder =
      body("shape = \"cylinder\"\nradius = 2\nlength = 3\ndensity = 5\n").bodies[0];
  CHECK(cylinder.mass == Approx(60 * pi).epsilon(1e-14));
  CHECK(cylinder.inertia.diagonal().isApprox(cylinder.mass * Vector3d(1.75, 1.75, 2), 1e-14));

  // A cube as a hull, with points inside its faces and its volume, in any order.
  const std::string corners =
      "points = [[1,1,1], [0,0,0.5], [1,1,-1], [0,0,1], [1,-1,1], [1,0,0], [1,-1,-1], [-1,1,1], "
      "[-1,1,-1], [-1,-1,1], [-1,-1,-1], [0,1,1], [0.1,0.2,0.3]]\n";
  const Body hull = body("shape = \"convex\"\nmass = 6\n" + corners).bodies[0];
  CHECK(hull.inertia.isApprox(4 * Eigen::Matrix3d::Identity(), 1e-12));
  CHECK(body("shape = \"convex\"\ndensity = 2\n" + corners).bodies[0].mass == Approx(16));

  // Two halves of a box are the box.
  const Body halves =
      body(
          "mass = 12\nshapes = [{ shape = \"box\", size = [1, 2, 1.5], position = [0, 0, 0.75] },"
          "{ shape = \"box\", size = [2, 1, 1.5], position = [0, 0, -0.75], orientation = { axis = "
          "[0, 0, 1], deg = 90 } }]\n")
          .bodies[0];
  CHECK(halves.inertia.isApprox(box.inertia, 1e-12));
}

TEST_CASE("unit vectors and quaternions are made exact; what is far from one is refused") {
  const Scene s = body("fixed = true\norientation = { wxyz = [0.7071, 0, 0.7071, 0] }\n");
  CHECK(std::abs(s.bodies[0].orientation.norm() - 1) < 1e-15);
  CHECK(problem("[[body]]\nfixed = true\norientation = { wxyz = [1, 1, 0, 0] }\n").place.line == 3);
  CHECK(
      problem("[[body]]\nfixed = true\norientation = { axis = [0, 0, 0], deg = 1 }\n").place.line ==
      3);
}

TEST_CASE("a wrong value is named with its place, field, value and what is allowed") {
  struct Case {
    std::string old, now;
    std::string field, value, allowed;
  };
  const std::vector<Case> cases = {
      {"end = 2.5", "end = -1", "scene: end", "-1", "> 0, s"},
      {"end = 2.5", "end = nan", "scene: end", "nan", "> 0, s"},
      {"end = 2.5", "end = inf", "scene: end", "inf", "finite"},
      {"end = 2.5", "end = \"long\"", "scene: end", "\"long\"", "number"},
      {"end = 2.5", "end = 2000-01-01", "scene: end", "date", "number"},
      {"gravity = [0.1, -0.2, -9.81]", "gravity = -9.81", "scene: gravity", "-9.81", "3 finite"},
      {"gravity = [0.1, -0.2, -9.81]", "gravity = [0, 0]", "gravity", "[0, 0]", "3 finite"},
      {"name = \"everything\"", "name = 3", "scene: name", "3", "text"},
      {"name = \"everything\"", "name = \"a,b\"", "scene: name", "a,b", "comma"},
      {"tolerance = 1e-8", "tolerance = 0", "smooth: tolerance", "0", "1e-14"},
      {"\"index0\"", "\"index3\"", "smooth: formulation", "index3", "index1, index0"},
      {"projection = false", "projection = 0", "smooth: projection", "0", "true or false"},
      {"radius = 0.1", "radius = 0", "body \"rod\": radius", "0", "> 0, m"},
      {"density = 1234.5", "density = 1\nmass = 1", "body \"rod\": density", "1", "not both"},
      {"{ axis = [1, 1, 0], deg = 77 }", "{ axis = [1, 1, 0], deg = 7, rad = 1 }",
       "orientation: deg", "7", "not both"},
      {"inertia = [2, 3, 4, 0.1, 0.2, 0.3]", "inertia = [1, 1, 3]", "body \"compound\": inertia",
       "[1, 1, 3]", "triangle"},
      {"inertia = [2, 3, 4, 0.1, 0.2, 0.3]", "inertia = [1, 1]", "body \"compound\": inertia",
       "[1, 1]", "3 or 6"},
      {"kind = \"hinge\"", "kind = \"revolute\"", "joint \"pin\": kind", "revolute", "hinge"},
      {"bodies = [\"rod\", \"world\"]", "bodies = [\"rot\", \"world\"]", "joint \"pin\": bodies",
       "rot", "did you mean \"rod\"?"},
      {"bodies = [\"rod\", \"world\"]", "bodies = [\"rod\", \"rod\"]", "bodies", "rod",
       "different"},
      {"kind = \"energy\"", "kind = \"enrgy\"", "invariant 1: kind", "enrgy", "\"energy\"?"},
      {"value = [1, 2, 3]", "value = [1, 2]", "expect 1: value", "[1, 2]", "3 finite"},
      {"body = \"rod\"\nforce", "body = \"world\"\nforce", "load 1: body", "world", "rod"},
  };
  for (const Case& c : cases) {
    const std::string text = with(kJointed, c.old, c.now);
    INFO(c.now);
    const Problem p = problem(text);
    INFO(p.message());
    const auto before = static_cast<std::ptrdiff_t>(kJointed.find(c.old));
    CHECK(p.place.line == 1 + std::count(kJointed.begin(), kJointed.begin() + before, '\n'));
    CHECK(p.place.column > 0);
    CHECK(contains(p.field, c.field));
    CHECK(contains(p.value, c.value));
    CHECK(contains(p.allowed, c.allowed));
  }
}

TEST_CASE("an unknown key is refused, and the nearest one suggested") {
  const Problem pos = problem("[[body]]\nfixed = true\npos = [0, 0, 1]\n");
  CHECK(pos.place.line == 3);
  CHECK(pos.place.column == 1);
  CHECK(
      contains(pos.message(), "body 1: pos = [0, 0, 1]: unknown key; did you mean \"position\"?"));
  CHECK(
      contains(problem("[[bodies]]\nfixed = true\n[[body]]\nfixed = true\n").allowed, "\"body\""));
  CHECK(contains(
      problem("[[body]]\nfixed = true\nshape = \"box\"\nsize = [1, 1, 1]\nradius = 1\n").allowed,
      "unknown key"));
  CHECK(contains(problem("[scene]\nzzzzzzzzzzz = 1\n[[body]]\nfixed = true\n").allowed,
                 "known: name, end, gravity"));
}

TEST_CASE("all problems are named in one go, in the order of the file") {
  try {
    parse_scene("[scene]\nend = -1\n[[body]]\nmass = 0\n[smooth]\nstep = 1\n", "a.toml");
    FAIL();
  } catch (const SceneError& e) {
    REQUIRE(e.problems().size() >= 3);
    int line = 0;
    for (const Problem& p : e.problems()) {
      CHECK(p.place.line >= line);
      line = p.place.line;
    }
    CHECK(contains(e.what(), "a.toml:2:7: scene: end = -1: must be a finite number > 0, s\n"));
  }
}

TEST_CASE("what is not TOML is refused at its place") {
  CHECK(problem("[scene\n").place.line == 1);
  CHECK(problem("a = 1\na = 2\n").place.line == 2);
  CHECK(contains(problem("a = \n").message(), "bad.toml:1:"));
  CHECK(problem(std::string("a = \"\0\"", 8)).place.line == 1);
  CHECK(problem("a = \xff\xfe\n").place.line == 1);
  CHECK(problem("x = " + std::string(100000, '[')).place.line == 1);
  CHECK(problem("x" + std::string(100000, '.') + "y = 1").place.line == 1);
  CHECK(problem("x = 99999999999999999999999\n").place.line == 1);
}

TEST_CASE("a long file, which is read in pieces, means what it means as a whole") {
  constexpr int kBodies = 4000, kLines = 8;
  std::string text = "# of many bodies\n";
  const auto line_of = [](int body) { return 2 + kLines * body; };
  for (int k = 0; k < kBodies; ++k)
    text += "[[body]]\nname = \"b" + std::to_string(k) + "\"\nshape = \"sphere\"\nradius = 1\n" +
            "mass = 2\n  [body.drag]\n  linear = " + std::to_string(k) + "\n\n";
  const std::string end = "[scene]\nname = \"many\"\n";
  const auto changed = [&](int body, const std::string& from, const std::string& to) {
    const std::size_t begin = text.find("\"b" + std::to_string(body) + "\"");
    return std::string(text).replace(text.find(from, begin), from.size(), to) + end;
  };

  const Scene s = parse_scene(text + end, "many.toml");
  CHECK(s.name == "many");
  REQUIRE(s.bodies.size() == kBodies);
  for (int k = 0; k < kBodies; ++k) {
    const Body& body = s.bodies[static_cast<std::size_t>(k)];
    INFO(k);
    REQUIRE(body.name == "b" + std::to_string(k));
    REQUIRE(body.place.line == line_of(k));
    REQUIRE(body.drag->linear == k);
  }

  const Problem wrong = problem(changed(3000, "radius = 1", "radius = -1"));
  CHECK(wrong.place.line == line_of(3000) + 3);
  CHECK(wrong.place.column == 10);
  CHECK(problem(changed(3000, "radius = 1", "radius = ")).place.line == line_of(3000) + 3);
  // These texts are wrong only as a whole.
  CHECK(contains(problem("[scene]\n" + text + end).message(), "redefine"));
  CHECK(problem("[scene]\n" + text + end).place.line == line_of(kBodies) + 1);
  CHECK(problem("body = [{ fixed = true }]\n" + text).place.line == 3);
  CHECK(problem(text + "[body.drag]\nlinear = 1\n").place.line == line_of(kBodies));
  // A text over so many lines has what looks like the beginning of a body.
  const Problem inside =
      problem("[scene]\nname = \"\"\"\n" + text.substr(0, text.size() / 2) + "\"\"\"\n" + text);
  CHECK(inside.place.line == 2);
  CHECK(contains(inside.allowed, "control character"));
}

TEST_CASE("a scene without a body, and names that clash, are refused") {
  CHECK(contains(problem("").message(), "bad.toml:1:1: [[body]]: is missing"));
  CHECK(problem("[[body]]\nfixed = true\nname = \"a\"\n[[body]]\nfixed = true\nname = \"a\"\n")
            .place.line == 4);
  CHECK(contains(problem("[[body]]\nfixed = true\nname = \"world\"\n").allowed, "world"));
}

TEST_CASE("a body that moves has a mass, and its origin is its centre of mass") {
  CHECK(contains(problem("[[body]]\nshape = \"sphere\"\nradius = 1\n").message(),
                 "give mass (kg) or density"));
  CHECK(contains(problem("[[body]]\nmass = 1\n").message(), "inertia: is missing"));
  const Problem p = problem(
      "[[body]]\nmass = 1\nshapes = [{ shape = \"sphere\", radius = 1, position = [0, 2, 0] }]\n");
  CHECK(contains(p.message(), "[0, 2, 0]"));
  CHECK(contains(problem("[[body]]\nshape = \"plane\"\nmass = 1\ninertia = [1, 1, 1]\n").message(),
                 "must be true"));
  CHECK(contains(problem("[[body]]\nshape = \"sphere\"\nradius = 1e300\ndensity = 1\n").message(),
                 "finite"));
}

TEST_CASE("materials that can meet need a pair; nothing is mixed") {
  const std::string more =
      "\n[[body]]\nname = \"second\"\nshape = \"sphere\"\nradius = 1\nmass = 1\nmaterial = "
      "\"ice\"\n";
  try {
    parse_scene(kTouching + more, "bad.toml");
    FAIL();
  } catch (const SceneError& e) {
    REQUIRE(e.problems().size() == 2);  // ice-steel, ice-wood; one body of ice does not meet itself
    CHECK(contains(e.what(), "\"ice\" and \"steel\""));
    CHECK(contains(e.what(), "\"ice\" and \"wood\""));
    CHECK(e.problems()[0].place.line == 46);
  }
  // Fixed bodies never meet.
  CHECK_NOTHROW(parse_scene(kTouching + "\n[[body]]\nfixed = true\nname = \"wall\"\nshape = "
                                        "\"plane\"\nmaterial = \"wood\"\n",
                            "a.toml"));
  CHECK(contains(problem(with(kTouching, "\"steel\", \"wood\"", "\"stel\", \"wood\"")).allowed,
                 "did you mean \"steel\"?"));
  CHECK(contains(problem(kTouching + "[[pair]]\nbetween = [\"wood\", \"steel\"]\n").allowed,
                 "same materials"));
}

TEST_CASE("a file that is not there is refused") {
  CHECK_THROWS_AS(read_scene("/nowhere/at/all.toml"), SceneError);
  CHECK_THROWS_AS(read_scene("/"), SceneError);
}
