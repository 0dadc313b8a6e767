// Runs of the event engine at their borders: cut, bounded, refused. SPDX-License-Identifier:
// BSD-3-Clause
#include "event_runs.hpp"

using namespace event_runs;

TEST_CASE("event: a run that is cut inside accumulating impacts goes on with its bits") {
  const std::string text =
      "[scene]\nengine = \"event\"\nend = 2\ngravity = [0, 0, -9.81]\n" + ball(1, 0.5);
  const Scene scene = parse_scene(text, "test");
  const auto whole = make_engine(scene);
  for (const double cut : {1.0, 1.35, 1.3545, 1.354565, 1.5}) goes_on_with_its_bits(scene, cut, 2);
  whole->advance(2);
  CHECK(whole->counts().events == 20);
}

TEST_CASE("event: a storm of events is bounded by its work") {
  const std::string text =
      "[scene]\nengine = \"event\"\nend = 90\ngravity = [0, 0, -9.81]\n[event]\nmax_events = 50\n" +
      ball(1, 0.99);
  const auto engine = make_engine(parse_scene(text, "test"));
  CHECK_THROWS_AS(engine->advance(90), SimulationError);
  CHECK(engine->counts().events == 51);
}

TEST_CASE("event: a motion too fast for its length of time ends with its reason") {
  CHECK_THROWS_WITH(run(R"(
[[body]]
name = "pendulum"
mass = 1
inertia = [1, 1, 1]
position = [0, 0, -1]
velocity = [1e150, 0, 0]
[[joint]]
kind = "distance"
bodies = ["pendulum", "world"]
at = [[0, 0, -1], [0, 0, 0]]
)",
                        1e-6, 1),
                    Catch::Contains("100000 steps") && Catch::Contains("too fast"));
}

TEST_CASE("event: a start with impacts is one of the times of events") {
  const auto engine = run(R"(
[[body]]
name = "floor"
shape = "plane"
fixed = true
material = "floor"
[[body]]
name = "ball"
shape = "sphere"
radius = 0.1
mass = 1
position = [0, 0, 0.1]
velocity = [0, 0, -1]
material = "ball"
[[pair]]
between = ["floor", "ball"]
restitution = 0.5
)",
                          1e-6, 0.05);
  REQUIRE(engine->events().size() == 1);
  CHECK(engine->events()[0].time == 0);
  CHECK(engine->counts().events == 1);
  CHECK(engine->counts().impacts == 1);
}

TEST_CASE("event: the plan names the engine, and what it does not have is refused by name") {
  const Scene bounces = parse_scene("[scene]\ngravity = [0, 0, -9.81]\n" + ball(1, 0.5), "test");
  CHECK(make_plan(bounces).engine == EngineKind::stepping);
  CHECK(make_plan(bounces).no_event.empty());
  const std::string boxes = R"(
[[body]]
name = "a"
shape = "box"
size = [1, 1, 1]
fixed = true
material = "m"
[[body]]
name = "b"
shape = "box"
size = [1, 1, 1]
density = 1
position = [0, 0, 2]
material = "m"
[[pair]]
between = ["m", "m"]
)";
  const Scene stack = parse_scene(boxes, "test");
  CHECK(make_plan(stack).engine == EngineKind::stepping);
  CHECK(make_plan(stack).no_event.empty());
  std::string many = boxes;
  for (int k = 0; k < 20; ++k)
    many += "[[body]]\nshape = \"box\"\nsize = [1, 1, 1]\ndensity = 1\nposition = [0, 0, " +
            std::to_string(4 + 2 * k) + "]\nmaterial = \"m\"\n";
  CHECK(make_plan(parse_scene(many, "test")).no_event.find("potential contact") !=
        std::string::npos);
  CHECK_THROWS_AS(make_plan(parse_scene("[scene]\nengine = \"event\"\n" + many, "test")),
                  std::invalid_argument);
}

TEST_CASE("event: what joints drive into a wall is named") {
  const std::string text =
      "[[body]]\nname = \"wall\"\nshape = \"plane\"\nnormal = [-1, 0, 0]\nposition = [1.6, 0, 0]\n"
      "fixed = true\nmaterial = \"floor\"\n"
      "[[body]]\nname = \"piston\"\nshape = \"sphere\"\nradius = 0.1\nmass = 1\nmaterial = "
      "\"body\"\n"
      "velocity = [2, 0, 0]\n[[joint]]\nkind = \"slider\"\nbodies = [\"piston\", \"world\"]\n"
      "axis = [1, 0, 0]\nmotion = { rate = 2 }\n" +
      pair("friction = 0.3");
  CHECK_THROWS_WITH(run(text, 1e-6, 1),
                    Catch::Contains("t = 0.75") &&
                        Catch::Contains("no impulses keep \"piston\" and \"wall\" apart: joints"));
}

TEST_CASE("event: a box slides from one plate onto another whose top is in the same plane") {
  const auto plate = [](const std::string& name, double x) {
    return "[[body]]\nname = \"" + name + "\"\nshape = \"box\"\nsize = [1, 1, 0.2]\nposition = [" +
           number(x) + ", 0, -0.1]\nfixed = true\nmaterial = \"floor\"\n";
  };
  const std::string text =
      plate("first", 0) + plate("second", 1) +
      "[[body]]\nname = \"box\"\nshape = \"box\"\nsize = [0.2, 0.2, 0.1]\nmass = 1\n"
      "position = [0.2, 0.05, 0.05]\nvelocity = [1.818, 0, 0]\nmaterial = \"body\"\n" +
      pair("friction = 0.2\nrestitution = 0.4");
  for (const double tolerance : {1e-5, 1e-7}) {
    CAPTURE(tolerance);
    const auto engine = run(text, tolerance, 0.8);
    const BodyState& box = engine->bodies()[2];
    CHECK(of_kind(*engine, Kind::impact).empty());
    CHECK(std::abs(box.velocity.x() - (1.818 - 0.2 * 9.81 * 0.8)) < 10 * tolerance);
    CHECK(std::abs(box.position.x() - (0.2 + 1.818 * 0.8 - 0.1 * 9.81 * 0.64)) < 10 * tolerance);
  }
}
