// Repetition in scene files: the same scenes as those that are spelt out, within bounds.
// SPDX-License-Identifier: BSD-3-Clause
#include <string>
#include <tether/scene/files.hpp>
#include <tether/scene/vary.hpp>

#include "linalg/thrown.hpp"
#include "support/catch.hpp"

using namespace tether::scene;

namespace {

const std::string kHead = "[scene]\nend = 1\ngravity = [0, 0, -9.81]\n";

std::string written(const std::string& text) {
  return write_scene(parse_scene(text, "repeat.toml"));
}

std::string ball(const std::string& name, const std::string& position,
                 const std::string& more = "") {
  return "[[body]]\nname = \"" + name +
         "\"\nshape = \"sphere\"\nradius = 0.1\nmass = 1\nposition = " + position + "\n" + more;
}

std::string error(const std::string& text) {
  return tether::test::thrown<SceneError>([&] { parse_scene(text, "repeat.toml"); });
}

}  // namespace

TEST_CASE(
    "a repeated body is as many bodies, each a step further, with numbers behind their name") {
  CHECK(written(kHead + ball("ball", "[1, 2, 3]", "repeat = { count = 3, step = [0.5, 0, -1] }\n") +
                ball("last", "[9, 9, 9]")) ==
        written(kHead + ball("ball 1", "[1, 2, 3]") + ball("ball 2", "[1.5, 2, 2]") +
                ball("ball 3", "[2, 2, 1]") + ball("last", "[9, 9, 9]")));
  CHECK(written(kHead + ball("ball", "[1, 2, 3]", "repeat = { count = 1 }\n")) ==
        written(kHead + ball("ball 1", "[1, 2, 3]")));
}

TEST_CASE("rows of rows of rows: the last direction is the fastest") {
  std::string spelt = kHead;
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 2; ++k)
        spelt += ball("b " + std::to_string(i + 1) + "." + std::to_string(j + 1) + "." +
                          std::to_string(k + 1),
                      "[" + std::to_string(i) + ", " + std::to_string(2 * j) + ", " +
                          std::to_string(4 * k) + "]");
  CHECK(written(kHead +
                ball("b", "[0, 0, 0]",
                     "repeat = [{ count = 2, step = [1, 0, 0] }, { count = 3, step = [0, 2, 0] }, "
                     "{ count = 2, step = [0, 0, 4] }]\n")) == spelt.substr(0, 0) + written(spelt));
}

TEST_CASE("a chain: joints and springs count the bodies between which they are") {
  const std::string repeated =
      kHead + ball("link {i}", "[1, 0, 0]", "repeat = { count = 3, step = [1, 0, 0] }\n") +
      R"([[joint]]
name = "pin {i}"
kind = "ball"
bodies = ["link {i}", "link {i+1}"]
at = [1.5, 0, 0]
repeat = { count = 2, step = [1, 0, 0] }
[[spring]]
name = "back {i} of {x}"
bodies = ["link {i+2}", "link {i}"]
at = [[3, 0, 0], [1, 0, 0]]
stiffness = 5
repeat = { count = 1, step = [1, 0, 0] }
[[load]]
body = "link {i-1}"
force = [0, 0, 1]
repeat = { count = 4 }
)";
  CHECK(error(repeated).find("\"link 0\"") != std::string::npos);
  std::string right = repeated;
  right.replace(right.find("{i-1}"), 5, "{i}");
  right.replace(right.find("count = 4"), 9, "count = 3");
  std::string spelt = kHead;
  for (const char* i : {"1", "2", "3"})
    spelt += ball(std::string("link ") + i, std::string("[") + i + ", 0, 0]");
  for (int i = 1; i <= 2; ++i)
    spelt += "[[joint]]\nname = \"pin " + std::to_string(i) +
             "\"\nkind = \"ball\"\nbodies = [\"link " + std::to_string(i) + "\", \"link " +
             std::to_string(i + 1) + "\"]\nat = [" + std::to_string(i) + ".5, 0, 0]\n";
  spelt +=
      "[[spring]]\nname = \"back 1 of {x}\"\nbodies = [\"link 3\", \"link 1\"]\nat = [[3, 0, 0], "
      "[1, 0, 0]]\n"
      "stiffness = 5\n";
  for (const char* i : {"1", "2", "3"})
    spelt += std::string("[[load]]\nbody = \"link ") + i + "\"\nforce = [0, 0, 1]\n";
  CHECK(written(right) == written(spelt));
}

TEST_CASE("repetitions: each point of a list of points moves") {
  const std::string bodies = kHead + ball("a", "[0, 0, 0]") + ball("b", "[1, 0, 0]");
  const auto spring = [](const std::string& name, const std::string& at) {
    return "[[spring]]\nname = \"" + name +
           "\"\nbodies = [\"a\", \"b\"]\nstiffness = 5\nat = " + at + "\n";
  };
  CHECK(written(bodies + spring("s", "[[0, 0, 0], [1, 0, 0]]") +
                "repeat = { count = 2, step = [0, 0.25, -0.5] }\n") ==
        written(bodies + spring("s 1", "[[0, 0, 0], [1, 0, 0]]") +
                spring("s 2", "[[0, 0.25, -0.5], [1, 0.25, -0.5]]")));
}

TEST_CASE("repetitions that are wrong, or too many, are refused by place before anything is made") {
  const auto refused = [](const std::string& repeat, const std::string& because) {
    const std::string said = error(kHead + ball("b", "[0, 0, 0]", "repeat = " + repeat + "\n"));
    CAPTURE(repeat, said);
    CHECK(said.find("repeat.toml:10:") != std::string::npos);
    CHECK(said.find(because) != std::string::npos);
  };
  for (const char* count :
       {"0", "-1", "1.5", "1e9", "inf", "nan", "100001", "9223372036854775807", "\"2\"", "true"})
    refused(std::string("{ count = ") + count + " }", "whole number");
  refused("{ step = [1, 0, 0] }", "needs count");
  refused("{ count = 2, step = 1 }", "[x, y, z]");
  refused("{ count = 2, step = [1, 0] }", "[x, y, z]");
  refused("{ count = 2, step = [1, 0, nan] }", "[x, y, z]");
  refused("{ count = 2, size = 3 }", "has no size");
  refused("7", "must be");
  refused("[]", "must be");
  refused("[{ count = 1 }, { count = 1 }, { count = 1 }, { count = 1 }]", "must be");
  refused("[{ count = 99999 }, { count = 99999 }, { count = 99999 }]", "more than 100000");
  std::string points;
  for (int k = 0; k < 1000; ++k) points += "[0, 0, 1], ";
  refused("{ count = 5000 }\npoints = [" + points + "]", "numbers and texts");
  const std::string nowhere = kHead + "[[body]]\nname = \"b\"\nmass = 1\ninertia = [1, 1, 1]\n";
  CHECK(error(nowhere + "repeat = { count = 2, step = [0, 1e-3, 0] }\n")
            .find("moves position or at: give one of them") != std::string::npos);
  CHECK(error(nowhere + "repeat = { count = 2 }\n").empty());
  // Together, too; and kinds that have no repetition do not know the word.
  std::string many = kHead;
  for (int k = 0; k < 3; ++k)
    many += "[[load]]\nbody = \"b\"\nforce = [0, 0, 1]\nrepeat = { count = 40000 }\n";
  CHECK(error(many + ball("b", "[0, 0, 0]")).find("more than 100000") != std::string::npos);
  CHECK(error(kHead + ball("b", "[0, 0, 0]") +
              "[[expect]]\nquantity = \"energy\"\nat_most = 1\nrepeat = { count = 2 }\n")
            .find("unknown key") != std::string::npos);
  CHECK(error(kHead + "body = 3\n") != "");
}

TEST_CASE("numbers of a repetition can be varied") {
  const std::string text =
      kHead + ball("b", "[0, 0, 0]", "repeat = { count = 3, step = [1, 0, 0] }\n");
  const Scene scene =
      parse_scene_with(text, "vary", {{"body.b.repeat.count", 5}, {"body.repeat.step.x", 0.5}});
  REQUIRE(scene.bodies.size() == 5);
  CHECK(scene.bodies[4].position.x() == 2);
  CHECK_THROWS_AS(parse_scene_with(text, "vary", {{"body.b.repeat.count", 1.5}}), SceneError);
}
