// Plans: exactly the effects that a scene names. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <string>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>
#include <vector>

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
  try {
    make_plan(scene);
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "";
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
  CHECK(effects(kSphere + kFloor + kPair) == Names{"contact"});
  CHECK(effects(kSphere + kFloor + kPair + "friction = 0.1\n") == Names{"contact", "friction"});
  CHECK(effects(kSphere + kFloor + kPair + "restitution = 0.1\n") ==
        Names{"contact", "restitution"});
  CHECK(effects(kSphere + kFloor + kPair + "rolling = 1e-3\n") ==
        Names{"contact", "rolling friction"});
  CHECK(effects(kSphere + kFloor + kPair + "torsional = 1e-3\n") ==
        Names{"contact", "torsional friction"});
  CHECK(effects("[stepping]\nlaw = \"frictionless\"\n" + kSphere + kFloor + kPair +
                "friction = 0.1\n") == Names{"contact"});
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
        Names{"gravity", "contact", "friction", "restitution", "gyroscopic term"});
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
  CHECK(both.why == "bodies touch; it has joints, too; steps in parts within an accuracy of 0.001");
  CHECK(plan("[stepping]\n" + kSphere + kHinge).engine == EngineKind::stepping);
}

TEST_CASE("what no engine has is refused by name") {
  CHECK(refusal("[smooth]\n" + kSphere + kFloor + kPair).find("smooth engine") !=
        std::string::npos);
  CHECK(refusal(kTouching + "[[invariant]]\nkind = \"energy\"\n").find("project = false") !=
        std::string::npos);
  CHECK(refusal(kTouching + "[[invariant]]\nkind = \"energy\"\nproject = false\n").empty());
}
