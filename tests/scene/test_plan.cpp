// Plans: exactly the effects that a scene names. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <string>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>
#include <vector>

#include "linalg/thrown.hpp"
#include "support/catch.hpp"
#include "texts.hpp"

using namespace tether::scene;
using Names = std::vector<std::string>;
using texts::kJointed;
using texts::kTouching;
using texts::with;

namespace {

Plan plan(const std::string& text) { return make_plan(parse_scene(text, "plan.toml")); }

Names effects(const std::string& text) {
  Names names;
  for (const Effect& effect : plan(text).effects) names.push_back(effect.name);
  return names;
}

std::string refusal(const std::string& text) {
  const Scene scene = parse_scene(text, "plan.toml");
  return tether::test::thrown([&] { make_plan(scene); });
}

const std::string kSphere =
    "[[body]]\nshape = \"sphere\"\nradius = 1\nmass = 1\nmaterial = \"a\"\n";
const std::string kFloor = "[[body]]\nfixed = true\nshape = \"plane\"\nmaterial = \"b\"\n";
const std::string kPair = "[[pair]]\nbetween = [\"a\", \"b\"]\n";
const std::string kGravity = "[scene]\ngravity = [0, 0, -9.81]\n";

const std::string kHinge =
    "[[joint]]\nkind = \"hinge\"\nbodies = [\"body 1\", \"world\"]\nat = [0, 0, 0]\n"
    "axis = [0, 0, 1]\n";
const std::string kBall =
    "[[joint]]\nkind = \"ball\"\nbodies = [\"box\", \"world\"]\nat = [0, 0, 0]\n";

}  // namespace

TEST_CASE("the plan lists exactly the effects that the scene names") {
  CHECK(effects(kSphere).empty());
  CHECK(effects(kGravity + kSphere) == Names{"gravity"});
  CHECK(effects(kSphere + kFloor + kPair) == Names{"contact", "impacts"});
  CHECK(effects(kSphere + kFloor + kPair + "friction = 0.1\n") ==
        Names{"contact", "friction", "impacts"});
  CHECK(effects(kSphere + kFloor + kPair + "restitution = 0.1\n") ==
        Names{"contact", "impacts", "restitution"});
  CHECK(effects(kSphere + kFloor + kPair + "rolling = 1e-3\n") ==
        Names{"contact", "impacts", "rolling friction"});
  CHECK(effects(kSphere + kFloor + kPair + "torsional = 1e-3\n") ==
        Names{"contact", "impacts", "torsional friction"});
  CHECK(effects("[stepping]\nlaw = \"frictionless\"\n" + kSphere + kFloor + kPair +
                "friction = 0.1\n") == Names{"contact", "impacts"});
  CHECK(effects(with(kSphere, "mass = 1", "mass = 1\ninertia = [1, 2, 2]")) ==
        Names{"gyroscopic term"});
  CHECK(effects("[stepping]\ngyroscopic = \"none\"\n" +
                with(kSphere, "mass = 1", "mass = 1\ninertia = [1, 2, 2]"))
            .empty());
  CHECK(effects(kSphere + "drag = { linear = 1 }\n") == Names{"drag"});
  CHECK(effects(kSphere + "[[load]]\nbody = \"body 1\"\nforce = [1, 0, 0]\n") == Names{"loads"});
  CHECK(effects(kSphere + "[[invariant]]\nkind = \"energy\"\n") == Names{"invariants"});

  const std::string spring =
      "[[spring]]\nbodies = [\"body 1\", \"world\"]\nat = [[0, 0, 0], [0, 0, 1]]\n";
  CHECK(effects(kSphere + spring + "stiffness = 1\n") == Names{"springs"});
  CHECK(effects(kSphere + spring + "damping = 1\n") == Names{"dampers"});
  CHECK(effects(kSphere + spring + "damping = 1\nstiffness = 1\n") == Names{"springs", "dampers"});
  CHECK(effects(kSphere + spring + "stiffness = 0\n") == Names{"springs"});

  CHECK(effects(kSphere + kHinge) == Names{"joints"});
  CHECK(effects(kSphere + kHinge + "motion = { rate_rad = 1 }\n") ==
        Names{"joints", "prescribed motion"});
  CHECK(effects(kJointed) == Names{"gravity", "gyroscopic term", "joints", "prescribed motion",
                                   "springs", "dampers", "drag", "loads", "invariants"});
  CHECK(effects(kTouching) ==
        Names{"gravity", "contact", "friction", "impacts", "restitution", "gyroscopic term"});
}

TEST_CASE("the plan chooses the engine and counts") {
  CHECK(plan(kSphere).engine == EngineKind::smooth);
  CHECK(plan("[stepping]\n" + kSphere).engine == EngineKind::stepping);
  const Plan touching = plan(kTouching);
  CHECK(touching.engine == EngineKind::stepping);
  CHECK(touching.bodies == 2);
  CHECK(touching.moving == 1);
  CHECK(touching.pairs == 1);
  CHECK(touching.unknowns == 6);
  const Plan jointed = plan(kJointed);
  CHECK(jointed.engine == EngineKind::smooth);
  CHECK(jointed.moving == 3);
  CHECK(jointed.rows == 6 + 1 + 5 + 3 + 6);
  CHECK(jointed.invariants == 1);

  // Three of one material and a floor of another: 3 with the floor, 3 among themselves.
  std::string spheres = kFloor + kPair + "[[pair]]\nbetween = [\"a\", \"a\"]\n";
  for (int i = 0; i < 3; ++i) spheres += kSphere;
  CHECK(plan(spheres).pairs == 6);

  const Plan both = plan(kTouching + kBall);
  CHECK(both.engine == EngineKind::stepping);
  CHECK(both.rows == 3);
  CHECK(both.why == "bodies touch; it has joints, too; sub-steps within an accuracy of 0.001");
  CHECK(plan("[stepping]\n" + kSphere + kHinge).engine == EngineKind::stepping);
}

TEST_CASE("what no engine has is refused by name") {
  CHECK(refusal("[smooth]\n" + kSphere + kFloor + kPair).find("smooth engine") !=
        std::string::npos);
  CHECK(refusal(kTouching + "[[invariant]]\nkind = \"energy\"\n").find("project = false") !=
        std::string::npos);
  CHECK(refusal(kTouching + "[[invariant]]\nkind = \"energy\"\nproject = false\n").empty());
}

TEST_CASE(
    "bodies that begin inside each other are named, the deepest first, and not those that rest") {
  const auto ball = [](const char* name, double z, const char* material = "a") {
    return std::string("[[body]]\nname = \"") + name +
           "\"\nshape = \"sphere\"\nradius = 0.5\nmass = 1\nmaterial = \"" + material +
           "\"\nposition = [0, 0, " + std::to_string(z) + "]\n";
  };
  const auto found = [](const std::string& text) {
    return overlaps_at_start(parse_scene(text, "start.toml"));
  };
  const std::string floor =
      "[[body]]\nname = \"floor\"\nfixed = true\nshape = \"plane\"\nmaterial = \"b\"\n";
  const std::string pairs =
      "[[pair]]\nbetween = [\"a\", \"b\"]\n[[pair]]\nbetween = [\"a\", \"a\"]\n";
  for (const std::string engine : {"stepping", "event"}) {
    const std::string head = "[scene]\ngravity = [0, 0, -9.81]\nengine = \"" + engine + "\"\n";
    CHECK(found(head + floor + ball("low", 0.5) + ball("high", 1.5) + pairs).empty());
    CHECK(found(head + floor + ball("low", 0.4999) + ball("high", 1.5) + pairs).empty());
    const Names deep = found(head + floor + ball("low", 0.44) + ball("high", 1.34) + pairs);
    REQUIRE(deep.size() == 2);
    CHECK(deep[0].find("\"low\" begins 0.1 m inside \"high\"") == 0);
    CHECK(deep[1].find("\"low\" begins 0.06 m inside \"floor\"") == 0);
    // Bodies that a joint connects, and those that do not touch, may be inside of others.
    CHECK(found(head + ball("low", 0.4) + ball("high", 1) + floor + pairs +
                "[[joint]]\nkind = \"hinge\"\nbodies = [\"low\", \"high\"]\nat = [0, 0, 1]\n"
                "axis = [1, 0, 0]\n")
              .size() == 1);
    CHECK(found(head + floor + ball("low", 0.44) +
                "[[pair]]\nbetween = [\"a\", \"b\"]\ntouch = false\n")
              .empty());
  }
  std::string many = floor + pairs;
  for (int k = 0; k < 9; ++k) many += ball(std::to_string(k).c_str(), 0.3);
  CHECK(found(many).size() == 6);
  CHECK(found(many).back().find("40 more pairs") == 0);  // 9 on the floor, 36 of balls
}

TEST_CASE("bodies with shapes that nothing can touch are named where a scene has contacts") {
  const auto found = [](const std::string& text) {
    return bodies_out_of_touch(parse_scene(text, "touch.toml"));
  };
  const std::string bare = "[[body]]\nname = \"bare\"\nshape = \"sphere\"\nradius = 1\nmass = 1\n";
  CHECK(found(bare).empty());
  CHECK(found(kSphere + kFloor + kPair).empty());
  CHECK(found(kSphere + kFloor + kPair + bare) == Names{"bare"});
  CHECK(found(kSphere + kFloor + kPair + "touch = false\n") == Names{"body 1", "body 2"});
  // One body of a material that only meets itself.
  CHECK(found(kSphere + "[[pair]]\nbetween = [\"a\", \"a\"]\n") == Names{"body 1"});
  CHECK(found(kSphere + kSphere + "[[pair]]\nbetween = [\"a\", \"a\"]\n").empty());
  CHECK(found(kSphere + kFloor + kFloor + kPair).empty());
}
