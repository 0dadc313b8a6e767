// Tests: the planar joint against free fall in a slope, and pairs that do not touch.
// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <tether/scene/files.hpp>
#include <tether/scene/run.hpp>

#include "support/catch.hpp"

using namespace tether::scene;

namespace {

void check_expectations(const std::string& text) {
  const Scene scene = parse_scene(text, "test.toml");
  CHECK(write_scene(parse_scene(write_scene(scene), "again.toml")) == write_scene(scene));
  const RunResult result = run(scene);
  CHECK(result.failure.empty());
  REQUIRE_FALSE(result.judgements.empty());
  for (const Judgement& each : result.judgements) CHECK(each.verdict == Verdict::met);
}

}  // namespace

// Normal (1/2, 0, sqrt(3)/2): the centre falls by g/2 along (sqrt(3)/2, 0, -1/2) and keeps what it
// has across; the spin about the normal stays, the moments of the tilted inertia are the joint's.
TEST_CASE("a planar joint leaves two ways and a turn: free fall in a slope, in both engines") {
  const std::string body =
      "[[body]]\nname = \"b\"\nmass = 2\ninertia = [1, 2, 2.5, 0.2, -0.1, 0.3]\n"
      "velocity = [0, 0.5, 0]\nangular_velocity = [1.5, 0, 2.598076211353316]\n"
      "[[joint]]\nkind = \"planar\"\nbodies = [\"b\", \"world\"]\nat = [0.3, 0.2, 0.1]\n"
      "axis = [1, 0, 1.7320508075688772]\n";
  const auto expects = [](double within) {
    const std::string w = std::to_string(within);
    return "[[expect]]\nquantity = \"position\"\nbody = \"b\"\nvalue = [2.1239273, 0.5, -1.22625]\n"
           "within = " +
           w +
           "\n[[expect]]\nquantity = \"angular_velocity\"\nbody = \"b\"\n"
           "value = [1.5, 0, 2.598076]\nwithin = " +
           w + "\n[[expect]]\nquantity = \"drift\"\nat_most = 1e-9\n";
  };
  const std::string head = "[scene]\nend = 1\ngravity = [0, 0, -9.81]\n";
  check_expectations(head + "[smooth]\ntolerance = 1e-7\n" + body + expects(1e-5));
  check_expectations(head + "[stepping]\nstep = 1e-3\n" + body + expects(6e-3));
}

TEST_CASE("bodies of a pair that does not touch pass through each other, in both engines") {
  for (const std::string engine : {"stepping", "event"})
    check_expectations(
        "[scene]\nend = 1\ngravity = [0, 0, -10]\nengine = \"" + engine +
        "\"\n[[body]]\nname = \"floor\"\nshape = \"plane\"\nfixed = true\nmaterial = \"a\"\n"
        "position = [0, 0, -10]\n[[body]]\nname = \"shelf\"\nshape = \"plane\"\nfixed = true\n"
        "material = \"c\"\nposition = [0, 0, -1]\n"
        "[[body]]\nname = \"ball\"\nshape = \"sphere\"\nradius = 0.1\nmass = 1\nmaterial = \"b\"\n"
        "[[pair]]\nbetween = [\"a\", \"b\"]\nfriction = 0.1\n"
        "[[pair]]\nbetween = [\"b\", \"c\"]\ntouch = false\n"
        "[[expect]]\nquantity = \"position\"\nbody = \"ball\"\nvalue = [0, 0, -5]\nwithin = "
        "0.01\n");
  CHECK_THROWS_AS(
      parse_scene("[[body]]\nshape = \"sphere\"\nradius = 1\nmass = 1\nmaterial = \"a\"\n"
                  "[[pair]]\nbetween = [\"a\", \"a\"]\ntouch = false\nfriction = 1\n",
                  "test.toml"),
      SceneError);
}
