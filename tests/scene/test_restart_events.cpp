// Tables of events of runs that end anywhere and go on. SPDX-License-Identifier: BSD-3-Clause
#include <sstream>
#include <stdexcept>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>
#include <tether/scene/run.hpp>

#include "run_files.hpp"
#include "support/catch.hpp"

using namespace tether::scene;
using namespace tether::test;
namespace fs = std::filesystem;

namespace {

/// Impacts at 0.452, 0.903, 1.129 s, ...; at rest at 1.36 s, which is known an interval before.
Scene ball(const fs::path& folder) {
  Scene scene = parse_scene(
      "[scene]\nengine = \"event\"\nend = 1.5\ngravity = [0, 0, -9.81]\n[event]\ntolerance = 1e-3\n"
      "[output]\nevery = 0.5\ncheckpoint = 0.19\n"
      "[[body]]\nname = \"floor\"\nshape = \"plane\"\nfixed = true\nmaterial = \"a\"\n"
      "[[body]]\nname = \"ball\"\nshape = \"sphere\"\nradius = 0.1\nmass = 1\n"
      "position = [0, 0, 1.1]\nmaterial = \"a\"\n"
      "[[pair]]\nbetween = [\"a\", \"a\"]\nrestitution = 0.5\n",
      "ball.toml");
  scene.output["csv"] = (folder / "a.csv").string();
  scene.output["state"] = (folder / "a.state").string();
  return scene;
}

void check_same_files(const fs::path& a, const fs::path& b) {
  for (const char* name : {"a.csv", "a.events.csv", "a.state"}) {
    INFO(name);
    CHECK(content(a / name) == content(b / name));
  }
}

}  // namespace

TEST_CASE("events between a record and a checkpoint are in the table of a run that is killed") {
  const fs::path whole = folder("events_whole");
  REQUIRE(run(ball(whole)).failure == "");
  const std::string table = content(whole / "a.events.csv");
  REQUIRE(table.find(",rest,") != std::string::npos);
  int restarts = 0;
  for (int kill = 1; kill <= 12; ++kill) {
    INFO("killed at stop " << kill);
    const fs::path part = folder("events_part");
    const Scene scene = ball(part);
    RunOptions options;
    int stops = 0;
    options.record = [&](const Engine&) {
      if (++stops == kill) throw 1;  // nobody tidies up
    };
    bool killed = false;
    try {
      run(scene, options);
    } catch (const int&) {
      killed = true;
    }
    if (!killed) break;
    options = RunOptions{};
    if (fs::exists(scene.output["state"])) {
      options.restart = scene.output["state"];
      ++restarts;
    }
    REQUIRE(run(scene, options).failure == "");
    check_same_files(whole, part);
  }
  CHECK(restarts >= 8);
}

TEST_CASE("the end of accumulating impacts, found behind a checkpoint, is in the table once") {
  const fs::path whole = folder("rest_whole");
  REQUIRE(run(ball(whole)).failure == "");
  for (int k = 0; k < 16; ++k) {
    const fs::path part = folder("rest_part");
    Scene scene = ball(part);
    scene.end = 1.354 + 4e-5 * k;
    INFO("cut at " << scene.end);
    REQUIRE(run(scene).failure == "");
    // The tables of a run that went on to its end, the state of the cut.
    for (const char* name : {"a.csv", "a.events.csv"})
      fs::copy_file(whole / name, part / name, fs::copy_options::overwrite_existing);
    scene.end = 1.5;
    RunOptions options;
    options.restart = scene.output["state"];
    REQUIRE(run(scene, options).failure == "");
    check_same_files(whole, part);
  }
}

// Out of the plane of the motion, entries of the constraints' Jacobian differ from zero by rounding
// only: which of them had been seen depended on the points that were asked for before.
TEST_CASE("a state that is saved after many records of a plane motion is arrived at again") {
  const Scene scene = read_scene(TETHER_SHIPPED_SCENES "/rocking_egg.toml");
  const auto engine = make_engine(scene);
  for (int k = 1; k <= 15; ++k) {
    engine->advance(0.01 * k);
    std::ostringstream out;
    engine->save(out);
    const auto again = make_engine(scene);
    std::istringstream in(out.str());
    INFO("t = " << engine->time());
    CHECK_NOTHROW(again->restore(in, Engine::Restore::exact));
  }
}
