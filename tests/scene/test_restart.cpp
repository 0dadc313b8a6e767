// Saved states: a run that is continued has the bits and the files of one in one piece.
// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <string>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>
#include <tether/scene/run.hpp>
#include <vector>

#include "run_files.hpp"
#include "support/catch.hpp"

using namespace tether::scene;
using namespace tether::test;
namespace fs = std::filesystem;

namespace {

void outputs(Scene& scene, const fs::path& folder) {
  scene.output["csv"] = (folder / "a.csv").string();
  scene.output["state"] = (folder / "a.state").string();
}

/// A scene that has run to 0.1 s, whose state is saved, and that ends at 0.2 s.
Scene first_half(const std::string& text, const char* name) {
  Scene scene = parse_scene(text, name);
  outputs(scene, folder(name));
  scene.end = 0.1;
  run(scene);
  scene.output["csv"].clear();
  scene.end = 0.2;
  return scene;
}

/// Runs the scene in one piece, and in two with a cut at a part of it; both leave the same files.
void check_cut(Scene scene, double part) {
  INFO(scene.name << ", cut at " << part);
  const fs::path whole = folder("whole"), cut = folder("cut");
  const double end = scene.end;
  if (scene.output.every == 0) scene.output.every = end / 50;
  for (Expect& each : scene.expect) each.time = std::min(each.time, end);
  outputs(scene, whole);
  const RunResult once = run(scene);
  outputs(scene, cut);
  scene.end = part * end;
  const RunResult first = run(scene);
  REQUIRE(first.failure == "");
  scene.end = end;
  RunOptions options;
  options.restart = scene.output["state"];
  const RunResult second = run(scene, options);
  CHECK(second.failure == once.failure);
  CHECK(content(whole / "a.csv") == content(cut / "a.csv"));
  CHECK(content(whole / "a.state") == content(cut / "a.state"));
  CHECK(second.met() == once.met());
  CHECK(second.summary.lowest_change == once.summary.lowest_change);
  CHECK(second.summary.penetration == once.summary.penetration);
}

std::vector<fs::path> shipped() {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(TETHER_SHIPPED_SCENES))
    if (entry.path().extension() == ".toml") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

constexpr const char* kHeadFormat =
    "[scene]\nname = \"{}\"\nend = {}\ngravity = [0.1, 0.2, -9.81]\n";

/// A chain of rods on ball joints, with a spring and drag.
std::string chain(int links, const char* form, double tolerance) {
  std::string text =
      fmt::format(kHeadFormat, fmt::format("chain of {} in {}", links, form), 0.8) +
      fmt::format("[smooth]\ntolerance = {}\nformulation = \"{}\"\n", tolerance, form);
  for (int k = 0; k < links; ++k)
    text += fmt::format(
        "[[body]]\nname = \"rod {0}\"\nshape = \"box\"\nsize = [1, 0.1, 0.15]\nmass = 1\nposition "
        "= "
        "[{1}, 0, 0]\ndrag = {{ linear = 0.1, rotational = 0.01 }}\n[[joint]]\nkind = "
        "\"ball\"\nbodies = [\"rod {0}\", \"{2}\"]\nat = [{3}, 0, 0]\n",
        k, k + 0.5, k == 0 ? "world" : fmt::format("rod {}", k - 1), k);
  return text + fmt::format(
                    "[[spring]]\nbodies = [\"rod {}\", \"world\"]\nat = [[{}, 0, 0], [0, 1, "
                    "1]]\nstiffness = 20\ndamping = 0.5\n",
                    links - 1, links);
}

/// Boxes, balls and capsules that fall, bounce, slide and come to rest.
std::string tumble(int bodies, double friction, double restitution, const char* gyroscopic) {
  std::string text =
      fmt::format(kHeadFormat,
                  fmt::format("{} fall {} {} {}", bodies, friction, restitution, gyroscopic), 0.6) +
      fmt::format("[stepping]\nstep = 2e-3\ngyroscopic = \"{}\"\non_failure = \"warn\"\n",
                  gyroscopic) +
      "[[body]]\nname = \"floor\"\nshape = \"plane\"\nfixed = true\nmaterial = \"a\"\n" +
      fmt::format("[[pair]]\nbetween = [\"a\", \"a\"]\nfriction = {}\nrestitution = {}\n", friction,
                  restitution);
  for (int k = 0; k < bodies; ++k) {
    const char* const shapes[] = {"shape = \"sphere\"\nradius = 0.1\n",
                                  "shape = \"capsule\"\nradius = 0.05\nlength = 0.15\n",
                                  "shape = \"box\"\nsize = [0.2, 0.15, 0.1]\n"};
    text += fmt::format(
        "[[body]]\nname = \"b{}\"\n{}mass = {}\nposition = [{}, {}, {}]\nangular_velocity = [{}, "
        "1, "
        "-2]\norientation = {{ axis = [1, 2, {}], deg = 20 }}\nmaterial = \"a\"\n",
        k, shapes[k % 3], 0.5 + 0.1 * k, 0.13 * (k % 3), 0.11 * (k % 2), 0.15 + 0.22 * k, k, k);
  }
  return text;
}

}  // namespace

TEST_CASE("a restart anywhere gives the bits of a run in one piece: shipped scenes") {
  for (const fs::path& file : shipped()) {
    Scene scene = read_scene(file.string());
    scene.output = Output{};
    scene.end = std::min(scene.end, 0.5);
    check_cut(scene, 0.37);
  }
}

TEST_CASE("a restart anywhere gives the bits of a run in one piece: variations") {
  for (const char* form : {"index1", "index0"})
    for (const double part : {0.1, 0.513, 0.98}) {
      check_cut(parse_scene(chain(1, form, 1e-6), "chain.toml"), part);
      check_cut(parse_scene(chain(3, form, 1e-4), "chain.toml"), part);
    }
  for (const char* gyroscopic : {"momentum", "explicit", "implicit", "none"})
    for (const double restitution : {0.0, 0.5})
      check_cut(parse_scene(tumble(6, 0.4, restitution, gyroscopic), "tumble.toml"),
                0.3 + 0.5 * restitution);
  check_cut(parse_scene(tumble(9, 0, 0.9, "momentum"), "tumble.toml"), 0.611);
}

TEST_CASE(
    "a restart anywhere gives the bits of a run in one piece: behind an anchor of the history") {
  Scene scene = parse_scene(chain(1, "index1", 1e-10), "chain.toml");
  scene.end = 50;
  scene.output.every = 1;
  const RunResult whole = run(scene);
  REQUIRE(whole.counts.steps > 10000);  // of 5000 each
  check_cut(scene, 0.9);
  // The way to a state is repeated from its anchor, not from the start.
  outputs(scene, folder("behind"));
  scene.end = 49;
  run(scene);
  scene.end = 50;
  RunOptions options;
  options.restart = scene.output["state"];
  CHECK(run(scene, options).counts.steps < 5500);
}

TEST_CASE(
    "a restart anywhere gives the bits of a run in one piece: joints that drift by rounding") {
  // The record of the state's own time is written again, from what the state holds.
  Scene scene = read_scene(std::string(TETHER_SHIPPED_SCENES) + "/belt.toml");
  scene.output = Output{};
  scene.end = 1.2;
  scene.output.every = 0.024;
  for (const double part : {0.13, 0.37, 0.71}) check_cut(scene, part);
}

TEST_CASE("saving changes nothing, however often") {
  for (const std::string& text : {chain(2, "index1", 1e-6), tumble(5, 0.4, 0.3, "momentum")}) {
    Scene scene = parse_scene(text, "saved.toml");
    scene.output["csv"] = (folder("rarely") / "a.csv").string();
    const std::string rarely = scene.output["csv"];
    run(scene);
    outputs(scene, folder("often"));
    scene.output.checkpoint = scene.end / 17;
    run(scene);
    CHECK(content(rarely) == content(scene.output["csv"]));
  }
}

TEST_CASE("a heap at rest stays at rest behind a restart") {
  std::string text =
      "[scene]\nend = 1\ngravity = [0, 0, -9.81]\n[stepping]\nstep = 2e-3\n[[body]]\nname = "
      "\"floor\"\nshape = \"plane\"\nfixed = true\nmaterial = \"a\"\n[[pair]]\nbetween = [\"a\", "
      "\"a\"]\nfriction = 0.5\n";
  for (int k = 0; k < 5; ++k)
    text += fmt::format(
        "[[body]]\nshape = \"box\"\nsize = [0.2, 0.3, 0.1]\nmass = 1\nmaterial = \"a\"\nposition = "
        "[{}, 0, {}]\n",
        0.03 * (k % 2), 0.06 + 0.11 * k);
  Scene scene = parse_scene(text, "heap.toml");
  outputs(scene, folder("rest"));
  REQUIRE(run(scene).failure == "");
  scene.end = 1.3;
  scene.output.every = 2e-3;
  RunOptions options;
  options.restart = scene.output["state"];
  double before = 0, fastest = 0;
  options.record = [&](const Engine& engine) {
    double speed = 0;
    for (const BodyState& b : engine.bodies()) speed = std::max(speed, b.velocity.norm());
    if (before == 0) before = std::max(speed, 1e-9);
    fastest = std::max(fastest, speed);
  };
  REQUIRE(run(scene, options).failure == "");
  CHECK(before < 1e-4);
  CHECK(fastest < 10 * before);
}

TEST_CASE("a saved state that is damaged, cut or longer is refused") {
  for (const std::string& text : {chain(1, "index1", 1e-4), tumble(2, 0.4, 0, "momentum")}) {
    Scene scene = first_half(text, "damaged");
    RunOptions options;
    options.restart = scene.output["state"];
    const std::string good = content(scene.output["state"]);
    scene.output["state"].clear();
    const auto refused = [&](const std::string& bytes) {
      std::ofstream(options.restart, std::ios::binary) << bytes;
      CHECK_THROWS_AS(run(scene, options), std::runtime_error);
    };
    for (std::size_t k = 0; k < good.size(); k += 1 + good.size() / 150) {
      std::string bad = good;
      bad[k] = static_cast<char>(bad[k] ^ (1 << (k % 8)));
      INFO("byte " << k);
      refused(bad);
      if (k % 3 == 0) refused(good.substr(0, k));
    }
    refused(good + '\0');
    std::ofstream(options.restart, std::ios::binary) << good;
    CHECK(run(scene, options).failure == "");
  }
}

TEST_CASE("a saved state of another scene is refused unless forced") {
  const Scene scene = first_half(tumble(3, 0.4, 0, "momentum"), "other");
  const auto refused = [&](const char* what, auto change) {
    INFO(what);
    Scene other = scene;
    change(other);
    RunOptions options;
    options.restart = scene.output["state"];
    other.output["state"].clear();
    CHECK_THROWS_WITH(run(other, options), Catch::Contains("another"));
    options.force = true;
    CHECK(run(other, options).failure == "");
  };
  refused("gravity", [](Scene& s) { (*s.gravity)[0] = 0.11; });
  refused("friction", [](Scene& s) { s.pairs[0].friction = 0.41; });
  refused("shape", [](Scene& s) { s.bodies[1].shapes[0].radius = 0.11; });
  refused("step", [](Scene& s) { s.stepping->step = 1e-3; });
  // These do not move it: its name, records, expectations, threads.
  Scene same = scene;
  same.name = "the same";
  same.output["state"].clear();
  same.output.every = 0.03;
  same.stepping->threads = 2;
  RunOptions options;
  options.restart = scene.output["state"];
  CHECK(run(same, options).failure == "");
}

TEST_CASE("rows and frames from behind a checkpoint, and a row that is cut, are recorded again") {
  Scene scene = parse_scene(tumble(3, 0.4, 0.2, "momentum"), "crash.toml");
  scene.output.every = 0.02;
  scene.output.checkpoint = 0.25;
  const auto film = [&](const fs::path& path) {
    outputs(scene, path);
    scene.output["vtk"] = (path / "f.pvd").string();
  };
  const fs::path whole = folder("no_crash"), part = folder("crash");
  film(whole);
  run(scene);
  film(part);
  RunOptions options;
  options.record = [&](const Engine& engine) {
    if (engine.time() > 0.43) throw 1;  // the end of the process: nobody tidies up
  };
  CHECK_THROWS_AS(run(scene, options), int);
  std::ofstream(scene.output["csv"], std::ios::app | std::ios::binary) << "0.2";
  options = RunOptions{};
  options.restart = scene.output["state"];
  REQUIRE(run(scene, options).failure == "");
  for (const auto& entry : fs::recursive_directory_iterator(whole))
    if (entry.is_regular_file()) {
      const fs::path name = fs::relative(entry.path(), whole);
      INFO(name);
      CHECK(content(entry.path()) == content(part / name));
    }
}

TEST_CASE("rows and frames behind an older checkpoint give way to those of the run that goes on") {
  Scene scene = parse_scene(tumble(3, 0.4, 0.2, "momentum"), "older.toml");
  scene.output.every = 0.02;
  scene.output.checkpoint = 0.25;
  const fs::path whole = folder("older");
  outputs(scene, whole);
  scene.output["vtk"] = (whole / "f.pvd").string();
  const std::string older = (folder("older_state") / "state").string();
  RunOptions options;
  options.record = [&](const Engine& engine) {
    if (engine.time() > 0.3 && !fs::exists(older)) fs::copy_file(scene.output["state"], older);
  };
  REQUIRE(run(scene, options).failure == "");
  REQUIRE(fs::exists(older));
  std::map<fs::path, std::string> before;
  for (const auto& entry : fs::recursive_directory_iterator(whole))
    if (entry.is_regular_file()) before[entry.path()] = content(entry.path());
  options = RunOptions{};
  options.restart = older;
  REQUIRE(run(scene, options).failure == "");
  for (const auto& [path, text] : before) {
    INFO(path);
    CHECK(content(path) == text);
  }
}

TEST_CASE("an interrupted run leaves whole files, and goes on with the bits of one that was not") {
  for (const std::string& text : {chain(2, "index1", 1e-6), tumble(4, 0.4, 0.3, "momentum")}) {
    Scene scene = parse_scene(text, "interrupted.toml");
    const fs::path whole = folder("to_the_end"), part = folder("interrupted");
    outputs(scene, whole);
    run(scene);
    outputs(scene, part);
    RunOptions options;
    int asked = 0;
    options.interrupted = [&] { return ++asked > 150; };
    const RunResult result = run(scene, options);
    CHECK(result.interrupted);
    CHECK(result.failure == "");
    CHECK(result.time > 0);
    CHECK(result.time < scene.end);
    CHECK(content(scene.output["csv"]).back() == '\n');
    RunOptions on;
    on.restart = scene.output["state"];
    CHECK_FALSE(run(scene, on).interrupted);
    CHECK(content(whole / "a.csv") == content(part / "a.csv"));
    CHECK(content(whole / "a.state") == content(part / "a.state"));
  }
}

TEST_CASE("a state is replaced whole or not at all: on a disk that is full the old one stays") {
  Scene scene = parse_scene(tumble(3, 0.4, 0.2, "momentum"), "full.toml");
  scene.output["state"] = (folder("full") / "a.state").string();
  scene.end = 0.1;
  run(scene);
  const std::string before = content(scene.output["state"]);
  RunOptions options;
  options.restart = scene.output["state"];
  scene.end = 0.2;
  // A limit of file sizes is the full disk of a test.
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit usual{};
  REQUIRE(getrlimit(RLIMIT_FSIZE, &usual) == 0);
  rlimit small = usual;
  small.rlim_cur = before.size() / 2;
  REQUIRE(setrlimit(RLIMIT_FSIZE, &small) == 0);
  bool told = false;
  try {
    run(scene, options);
  } catch (const std::runtime_error& e) {
    told = std::string(e.what()).find("cannot write") != std::string::npos;
  }
  setrlimit(RLIMIT_FSIZE, &usual);
  std::signal(SIGXFSZ, handler);
  CHECK(told);
  CHECK(content(scene.output["state"]) == before);
  CHECK(run(scene, options).failure == "");
}
