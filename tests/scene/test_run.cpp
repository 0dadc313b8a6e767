// Runs: expectations, files, restarts, effects of no strength. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <tether/scene/cost.hpp>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>
#include <tether/scene/run.hpp>
#include <vector>

#include "run_files.hpp"
#include "support/catch.hpp"
#include "support/comma_locale.hpp"
#include "texts.hpp"

using namespace tether::scene;
using tether::test::content;
using tether::test::folder;
namespace fs = std::filesystem;

namespace {

/// A swinging rod on a hinge, with more text.
std::string rod(const std::string& more) {
  return R"([scene]
name = "rod"
end = 0.5
gravity = [0, 0, -9.81]
[smooth]
tolerance = 1e-7
[[body]]
name = "rod"
shape = "box"
size = [1, 0.1, 0.1]
mass = 1
position = [0.5, 0, 0]
[[joint]]
kind = "hinge"
bodies = ["rod", "world"]
at = [0, 0, 0]
axis = [0, 1, 0]
)" + more;
}

/// A block that slides on a table, with more text.
std::string block(const std::string& more, const std::string& pair = "friction = 0.3\n") {
  return R"([scene]
name = "block"
end = 0.5
gravity = [0, 0, -9.81]
[stepping]
step = 2e-3
[[body]]
name = "table"
shape = "plane"
fixed = true
material = "wood"
[[pair]]
between = ["steel", "wood"]
)" + pair +
         R"(
[[body]]
name = "block"
shape = "box"
size = [0.4, 0.3, 0.1]
mass = 2
position = [0, 0, 0.05]
velocity = [1, 0.5, 0]
material = "steel"
)" + more;
}

/// The bits of all bodies at the end.
std::vector<double> end_state(const std::string& text) {
  const Scene scene = parse_scene(text, "test.toml");
  const auto engine = make_engine(scene);
  engine->advance(scene.end);
  std::vector<double> out;
  for (const BodyState& b : engine->bodies()) {
    const auto add = [&](const auto& v) { out.insert(out.end(), v.data(), v.data() + v.size()); };
    add(b.position), add(b.orientation.coeffs()), add(b.velocity), add(b.angular_velocity);
  }
  return out;
}

double largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
  REQUIRE(a.size() == b.size());
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

}  // namespace

TEST_CASE("expectations that hold and that do not") {
  const std::string expect =
      "[[expect]]\nquantity = \"drift\"\nat_most = 1e-6\n"                  // holds
      "[[expect]]\nquantity = \"speed\"\nbody = \"rod\"\nat_least = 100\n"  // not
      "[[expect]]\ntime = 0\nquantity = \"position\"\nbody = \"rod\"\nvalue = [0.5, 0, 0]\nwithin "
      "= 0\n"  // holds
      "[[expect]]\nthroughout = true\nquantity = \"distance_moved\"\nbody = \"rod\"\nat_most = "
      "1e-3\n"                                                                // not
      "[[expect]]\nquantity = \"energy_change\"\nvalue = 0\nwithin = 1e-4\n"  // holds
      "[[expect]]\nthroughout = true\nquantity = \"speed\"\nbody = \"rod\"\nat_least = "
      "0.5\n"  // at the end, but not at the start
      "[[expect]]\ntime = 0\nquantity = \"orientation\"\nbody = \"rod\"\nvalue = [-1, 0, 0, "
      "0]\nwithin = 0\n";  // holds: the same as [1, 0, 0, 0]
  const Scene scene = parse_scene(rod(expect), "test.toml");
  const RunResult result = run(scene);
  REQUIRE(result.failure.empty());
  REQUIRE(result.judgements.size() == 7);
  CHECK(result.judgements[0].verdict == Verdict::met);
  CHECK(result.judgements[1].verdict == Verdict::missed);
  CHECK(result.judgements[2].verdict == Verdict::met);
  CHECK(result.judgements[3].verdict == Verdict::missed);
  CHECK(result.judgements[4].verdict == Verdict::met);
  CHECK(result.judgements[5].verdict == Verdict::missed);
  CHECK(result.judgements[5].time == 0);
  CHECK(result.judgements[6].verdict == Verdict::met);
  CHECK_FALSE(result.met());
  CHECK(result.time == Approx(0.5));
}

TEST_CASE("a run in two parts has the bits and the files of one") {
  for (const std::string& text : {rod(""), block("")}) {
    Scene scene = parse_scene(text, "test.toml");
    INFO(scene.name);
    const fs::path all = folder(scene.name + "_all"), parts = folder(scene.name + "_parts");
    const auto outputs = [&](const fs::path& path) {
      scene.output["csv"] = (path / "a.csv").string();
      scene.output["vtk"] = (path / "a.pvd").string();
      scene.output["state"] = (path / "a.state").string();
      scene.output.every = 0.05;
      scene.output.checkpoint = 0.2;
    };
    outputs(all);
    REQUIRE(run(scene).failure.empty());

    // The part up to 0.2 s; a run that ends there leaves the same state as one that passes.
    outputs(parts);
    scene.end = 0.2;
    REQUIRE(run(scene).failure.empty());
    scene.end = 0.5;
    RunOptions options;
    options.restart = scene.output["state"];
    REQUIRE(run(scene, options).failure.empty());

    CHECK(content(all / "a.csv") == content(parts / "a.csv"));
    CHECK(content(all / "a.state") == content(parts / "a.state"));
    CHECK(content(all / "a.pvd") == content(parts / "a.pvd"));
    CHECK(content(all / "a.csv").size() > 1000);
    long films = 0;
    for (const auto& entry : fs::directory_iterator(all / "a")) {
      const fs::path name = entry.path().filename();
      CHECK(content(entry.path()) == content(parts / "a" / name));
      films += name.string().rfind("bodies", 0) == 0;
    }
    CHECK(films == 11);  // t = 0 and ten records

    // Nothing is left to run; and a state of another scene is refused.
    CHECK(run(scene, options).failure.empty());
    const Scene other = parse_scene(scene.name == "rod" ? block("") : rod(""), "other.toml");
    CHECK_THROWS_AS(run(other, options), std::runtime_error);
    std::ofstream(scene.output["state"], std::ios::binary) << "tether state 1\nshort";
    CHECK_THROWS_AS(run(scene, options), std::runtime_error);
    fs::remove_all(all);
    fs::remove_all(parts);
  }
}

TEST_CASE("an effect without strength changes nothing") {
  const std::string spring =
      "[[spring]]\nbodies = [\"rod\", \"world\"]\nat = [[1, 0, 0], [0, 0, 2]]\nstiffness = ";
  const std::vector<double> plain = end_state(rod(""));
  CHECK(end_state(rod(spring + "0\n")) == plain);
  CHECK(end_state(rod("[[load]]\nbody = \"rod\"\nforce = [0, 0, 0]\n")) == plain);
  CHECK(largest_difference(end_state(rod(spring + "1\n")), plain) > 1e-3);  // and with it something

  const std::vector<double> sliding = end_state(block(""));
  CHECK(end_state(block("drag = { linear = 0 }\n")) == sliding);
  CHECK(end_state(block("[[load]]\nbody = \"block\"\nforce = [0, 0, 0]\n")) == sliding);
  CHECK(end_state(block("", "friction = 0.3\nrestitution = 0\n")) == sliding);
  CHECK(largest_difference(end_state(block("drag = { linear = 1 }\n")), sliding) > 1e-3);
  const std::vector<double> icy = end_state(block("", ""));
  CHECK(end_state(block("", "friction = 0\n")) == icy);
  CHECK(largest_difference(icy, sliding) > 1e-2);

  // No gravity, and one of no strength.
  const std::string free =
      "[[body]]\nmass = 1\nshape = \"box\"\nsize = [1, 2, 3]\nvelocity = [1, 2, "
      "3]\nangular_velocity = [3, 2, 1]\n";
  for (const char* engine : {"[smooth]\n", "[stepping]\n"})
    CHECK(end_state(engine + free) ==
          end_state(std::string("[scene]\ngravity = [0, 0, 0]\n") + engine + free));
}

TEST_CASE("what accuracy costs: tighter settings have smaller errors and take more steps") {
  CostOptions options;
  options.tolerances = {1e-4, 1e-6, 1e-8};
  const CostTable smooth = cost(parse_scene(rod(""), "test.toml"), options);
  REQUIRE(smooth.rows.size() == 3);
  CHECK(smooth.smooth);
  for (std::size_t i = 0; i < 3; ++i) {
    INFO(smooth.rows[i].setting << " " << smooth.rows[i].error);
    CHECK(smooth.rows[i].failure.empty());
    CHECK(smooth.rows[i].error < 1e3 * smooth.rows[i].setting);
    if (i == 0) continue;
    CHECK(smooth.rows[i].error < smooth.rows[i - 1].error);
    CHECK(smooth.rows[i].steps > smooth.rows[i - 1].steps);
  }
  CHECK(smooth.reference_error < smooth.rows[2].error);
  REQUIRE(smooth.cheapest(1e-3) != nullptr);
  CHECK(smooth.cheapest(smooth.rows[2].error)->error <= smooth.rows[2].error);
  CHECK(smooth.cheapest(0) == nullptr);

  options.tolerances.clear();
  options.steps = {1e-3, 8e-3, 4e-3, 2e-3};
  const CostTable stepping = cost(parse_scene(block(""), "test.toml"), options);
  REQUIRE(stepping.rows.size() == 4);
  CHECK_FALSE(stepping.smooth);
  for (std::size_t i = 1; i < 4; ++i) {
    const double ratio = stepping.rows[i - 1].error / stepping.rows[i].error;
    INFO(ratio);
    CHECK(stepping.rows[i].setting == Approx(stepping.rows[i - 1].setting / 2));
    CHECK(ratio > 1.5);  // first order, measured against a step that is not zero either
    CHECK(ratio < 3);
  }
  options.steps = {0};
  CHECK_THROWS_AS(cost(parse_scene(block(""), "test.toml"), options), std::invalid_argument);
}

TEST_CASE("messages, tables and states are the same in a host whose numbers have a comma") {
  const fs::path file = folder("comma") / "a.csv";
  const auto said = [&] {
    std::vector<std::string> all;
    const auto failure = [&](const std::string& text) {
      try {
        Scene scene = parse_scene(text, "comma.toml");
        scene.output["csv"] = file.string();
        scene.output["state"] = (file.parent_path() / "a.state").string();
        all.push_back(run(scene).failure);
        all.push_back(content(file));
        all.push_back(content(scene.output["state"]));
      } catch (const std::exception& e) {
        all.emplace_back(e.what());
      }
    };
    failure(rod(""));
    failure(block(""));
    // Too stiff for its steps; a start off its joint; fewer steps than it needs.
    failure(
        block("[[spring]]\nbodies = [\"block\", \"world\"]\nat = [[0, 0, 0.1], [0, 0, 2.5]]\n"
              "stiffness = 1.5e7\n"));
    std::string off = rod("");
    off.replace(off.find("mass = 1"), 8, "mass = 1\nvelocity = [0.5, 0.25, 0]");
    failure(off);
    std::string few = rod("");
    few.replace(few.find("tolerance"), 9, "max_steps = 2\ntolerance");
    failure(few + "[output]\nevery = 0.5\n");
    failure(block("", "friction = -0.125\n"));
    return all;
  };
  const std::vector<std::string> plain = said();
  std::string together;
  for (const std::string& each : plain)
    if (each.size() < 1000) together += each + "\n";
  for (const char* part :
       {"a step of 0.002 s is too long", "off by 0.5", "stopped at t = 5.08", "friction = -0.125"})
    CHECK_THAT(together, Catch::Contains(part));
  const tether::test::CommaLocale here;
  const std::vector<std::string> there = said();
  REQUIRE(there.size() == plain.size());
  for (std::size_t k = 0; k < plain.size(); ++k) {
    INFO("output " << k);
    const bool same = there[k] == plain[k];
    CHECK(same);
    if (!same && plain[k].size() < 1000) CHECK(there[k] == plain[k]);
  }
}

TEST_CASE("files that cannot be written are reported") {
  Scene scene = parse_scene(rod(""), "test.toml");
  scene.output["csv"] = "/proc/nowhere/a.csv";
  CHECK_THROWS_AS(run(scene), std::runtime_error);
  scene.output["csv"] = "/dev/full";
  CHECK_THROWS_WITH(run(scene), Catch::Contains("/dev/full"));
  scene.output["csv"].clear();
  scene.output["svg"] = "/proc/a.svg";
  CHECK_THROWS_WITH(run(scene), Catch::Contains("/proc/a.svg"));
  scene.output["svg"].clear();
  // A state takes the place of another one, never that of a device or a folder.
  scene.output["state"] = folder("state").string();
  CHECK_THROWS_WITH(run(scene), Catch::Contains("no file"));
  CHECK(fs::is_directory(scene.output["state"]));
}

TEST_CASE("times that no run can have are refused") {
  const Scene good = parse_scene(block(""), "test.toml");
  const auto bad = [&](auto change, const char* named) {
    Scene scene = good;
    change(scene);
    INFO(named);
    CHECK_THROWS_WITH(run(scene), Catch::Contains(named));
    CHECK_THROWS_AS(run(scene), std::invalid_argument);
  };
  const double nan = std::nan("");
  bad([&](Scene& s) { s.end = nan; }, "end = nan");
  bad([&](Scene& s) { s.end = 0; }, "end = 0");
  bad([&](Scene& s) { s.end = 1e300; }, "step");
  bad([&](Scene& s) { s.output.every = nan; }, "every = nan");
  bad([&](Scene& s) { s.output.every = -1; }, "every = -1");
  bad([&](Scene& s) { s.output.every = 1e-300; }, "every = 1e-300");
  bad([&](Scene& s) { s.output.checkpoint = 1e-300; }, "checkpoint");
  bad([&](Scene& s) { s.stepping->step = 1e-300; }, "step");
  CostOptions options;
  int begun = 0;
  options.progress = [&](const std::string&, int, int) { ++begun; };
  options.steps = {1e-2, 1e-300};  // before the first of them is run
  CHECK_THROWS_AS(cost(good, options), std::invalid_argument);
  CHECK(begun == 0);
}
