// Runs at the borders: numbers that are none, files of two runs, names, many bodies.
// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <tether/scene/files.hpp>
#include <tether/scene/run.hpp>
#include <vector>

#include "run/judge.hpp"
#include "run_files.hpp"
#include "support/catch.hpp"

using namespace tether::scene;
using namespace tether::test;
namespace fs = std::filesystem;

namespace {

std::string falling(const std::string& more, int bodies = 1) {
  std::string text =
      "[scene]\nname = \"falling\"\nend = 0.1\ngravity = [0, 0, -9.81]\n[stepping]\nstep = 1e-3\n";
  for (int k = 0; k < bodies; ++k)
    text += fmt::format(
        "[[body]]\nname = \"b{}\"\nshape = \"box\"\nsize = [1, 2, 3]\nmass = 1\nposition = [{}, 0, "
        "0]\n",
        k, 10 * k);
  return text + more;
}

long rows(const fs::path& file) {
  const std::string text = content(file);
  return std::count(text.begin(), text.end(), '\n') - 1;
}

/// One body wherever it is told to be.
class Still : public Engine {
 public:
  const char* name() const override { return "still"; }
  double time() const override { return 0; }
  void advance(double) override {}
  const std::vector<BodyState>& bodies() const override { return bodies_; }
  Diagnostics diagnostics() const override { return d; }
  const std::vector<ContactState>& contacts() const override { return contacts_; }
  Counts counts() const override { return {}; }
  std::vector<EffectCost> costs() const override { return {}; }
  void save(std::ostream&) const override {}
  void restore(std::istream&, Restore) override {}
  std::vector<BodyState> bodies_{1};
  Diagnostics d;

 private:
  std::vector<ContactState> contacts_;
};

// Four balls as a pyramid, one of them of 300 kg or `heavy`; more: of [stepping].
std::string pyramid(const std::string& more, const char* heavy = "300",
                    const char* friction = "0.3") {
  std::string text = "[scene]\nend = 0.05\ngravity = [0, 0, -9.81]\n[stepping]\nstep = 5e-3\n" +
                     more + "[[pair]]\nbetween = [\"a\", \"a\"]\nfriction = " + friction +
                     "\n"
                     "[[body]]\nshape = \"plane\"\nfixed = true\nmaterial = \"a\"\n";
  for (const std::string& each :
       {std::string("mass = 1\nposition = [0, 0, 0.1]"),
        std::string("mass = 1\nposition = [0.2, 0, 0.1]"),
        std::string("mass = ") + heavy + "\nposition = [0.1, 0.173, 0.1]",
        std::string(
            "mass = 70\nposition = [0.1, 0.0577, 0.263]\nvelocity = [0.0131, 0.0373, 0.1]")})
    text += fmt::format("[[body]]\nshape = \"sphere\"\nradius = 0.1\nmaterial = \"a\"\n{}\n", each);
  return text;
}

}  // namespace

TEST_CASE("a motion that leaves the range of numbers is a failure, never a success") {
  for (const char* engine : {"[smooth]\n", "[stepping]\n"})
    for (const char* what :
         {"[scene]\ngravity = [0, 0, -1e306]\n", "spin", "[scene]\ngravity = [1e200, 0, 0]\n"}) {
      INFO(engine << what);
      const bool spin = std::string(what) == "spin";
      const Scene scene = parse_scene(
          std::string(spin ? "" : what) + engine +
              "[[body]]\nname = \"b\"\nshape = \"box\"\nsize = [1, 2, 3]\nmass = 1\nposition = "
              "[1, 1, 1e3]\n" +
              (spin ? "angular_velocity = [1e200, 1e199, 0]\n" : "") +
              "[[expect]]\nquantity = \"position\"\nbody = \"b\"\nvalue = [0, 0, 0]\nwithin = "
              "1e300\n",
          "nan.toml");
      const RunResult result = run(scene);
      CHECK(result.failure != "");
      CHECK_FALSE(result.met());
    }
}

TEST_CASE("a rotation that steps do not resolve is a warning") {
  const auto warnings = [](double spin, double step) {
    return run(parse_scene(
                   fmt::format("[scene]\nend = 0.5\n[stepping]\nstep = {0}\n[[body]]\nname = "
                               "\"box\"\nshape = \"box\"\nsize = [1, 2, 3]\nmass = 1\n"
                               "angular_velocity = [{1}, {2}, {1}]\n",
                               step, 0.1 * spin, spin),
                   "spin.toml"))
        .warnings;
  };
  CHECK(warnings(1e5, 1e-2).size() == 1);  // it gains 80 % of energy
  CHECK_THAT(warnings(1e5, 1e-2)[0],
             Catch::Contains("body \"box\" turns by 1.86e+03 rad in a step") &&
                 Catch::Contains("should be below 5.4e-07 s"));
  CHECK(warnings(1e3, 1e-4).empty());
}

TEST_CASE("a contact problem that is used above what the scene accepts is a warning") {
  const auto warnings = [](const char* tolerance, const char* acceptance) {
    const std::string text = pyramid(
        fmt::format("max_halvings = 1\ntolerance = {}\nacceptance = {}\n", tolerance, acceptance),
        "3e3", "1");
    return run(parse_scene(text, "pyramid.toml")).warnings;
  };
  const auto beyond = warnings("1e-17", "1.5");  // below rounding
  REQUIRE(beyond.size() == 1);
  CHECK_THAT(beyond[0],
             Catch::Contains("above the 1.5e-17") && Catch::Contains("stepping.acceptance"));
  CHECK(warnings("1e-17", "1e7") == std::vector<std::string>());
}

TEST_CASE("sweeps of a contact problem end where the scene says") {
  const auto counts = [](const char* more) {
    return run(parse_scene(pyramid(more), "pyramid.toml")).counts;
  };
  const Counts few = counts("max_sweeps = 3\n"), many = counts("");
  CHECK(few.sweeps <= 3 * few.contact_problems);
  CHECK(many.sweeps > 3 * many.contact_problems);
}

TEST_CASE("what is no number is never met") {
  const double nan = std::nan("");
  Scene scene = parse_scene(falling(""), "judge.toml");
  const auto expectation = [&](Quantity quantity) {
    Expect e;
    e.time = 1;
    e.throughout = true;
    e.quantity = quantity;
    e.body = 0;
    e.value.assign(static_cast<std::size_t>(components(quantity)), 0.5);
    e.within = 10;
    e.at_most = 100;
    e.at_least = -100;
    return e;
  };
  scene.end = 1;
  scene.expect = {expectation(Quantity::position), expectation(Quantity::orientation),
                  expectation(Quantity::energy), expectation(Quantity::drift)};
  for (int component = 0; component < 3; ++component) {
    Judge judge(scene);
    Still engine;
    judge.judge(0.2, true, engine, 0);
    engine.bodies_[0].position[component] = nan;
    engine.bodies_[0].orientation.coeffs()[component] = nan;
    engine.d.kinetic_energy = engine.d.drift = nan;
    judge.judge(0.5, true, engine, 0);
    const Still well;
    judge.judge(1, true, well, 0);  // and right again at the end
    for (const Judgement& j : judge.judgements()) {
      CHECK(j.verdict == Verdict::missed);
    }
  }
}

TEST_CASE("steps longer than the time between records leave no row twice") {
  Scene scene = parse_scene(falling(""), "rows.toml");
  const fs::path file = folder("rows") / "a.csv";
  scene.output["csv"] = file.string();
  for (const double step : {1e-3, 7e-3, 0.02}) {
    scene.stepping->step = step;
    scene.output.every = 0;
    run(scene);
    CHECK(rows(file) == 1 + std::lround(std::ceil(0.1 / step - 1e-9)));
  }
  scene.output.every = 0.03;  // 0, 0.03, 0.06, 0.09 and the end
  scene.stepping->step = 1e-3;
  run(scene);
  CHECK(rows(file) == 5);
}

TEST_CASE("a step that is longer than the run is taken once") {
  for (const double step : {1.0, 1e6, 1e12, 1e100, 1e300}) {
    INFO(step);
    Scene scene = parse_scene(falling(""), "long.toml");
    scene.gravity.reset();
    scene.bodies[0].velocity.x() = 1e-3;
    scene.stepping->step = step;
    const RunResult result = run(scene);
    CHECK(result.failure.empty());
    CHECK(result.counts.steps == 1);
    CHECK(result.time == step);
  }
}

TEST_CASE("a restart of a run that is over judges it as that run did") {
  const fs::path path = folder("over");
  for (const double within : {1e-3, 1e-9}) {
    Scene scene = parse_scene(
        falling("[[expect]]\nquantity = \"position\"\nbody = \"b0\"\nvalue = [0, 0, -0.0495]\n"
                "within = " +
                fmt::format("{}", within) + "\n"),
        "over.toml");
    scene.output["state"] = (path / "a.state").string();
    const RunResult first = run(scene);
    RunOptions options;
    options.restart = scene.output["state"];
    int looks = 0;
    options.record = [&](const Engine& engine) { looks += engine.time() == first.time; };
    const RunResult again = run(scene, options);
    CHECK(again.failure.empty());
    CHECK(again.met() == first.met());
    CHECK(first.met() == (within == 1e-3));
    REQUIRE(again.judgements.size() == 1);
    CHECK(again.judgements[0].verdict != Verdict::open);
    CHECK(again.judgements[0].value == first.judgements[0].value);
    CHECK(again.summary.end_energy == first.summary.end_energy);
    CHECK(looks == 1);
    scene.end = 0.05;  // behind which the state lies
    CHECK_THROWS_WITH(run(scene, options), Catch::Contains("nothing is left to run"));
  }
}

TEST_CASE("the table of many bodies has the first of them, and says so") {
  Scene scene = parse_scene(falling("", 230), "many.toml");
  scene.end = 2e-3;
  const fs::path file = folder("many") / "a.csv";
  scene.output["csv"] = file.string();
  const RunResult result = run(scene);
  std::ifstream in(file);
  std::string header;
  std::getline(in, header);
  CHECK(header.find(",b199.wz_rad_per_s") != std::string::npos);
  CHECK(header.find(",b200.") == std::string::npos);
  REQUIRE(result.remarks.size() == 1);
  CHECK(result.remarks[0].find("first 200 of 230") != std::string::npos);
}

TEST_CASE("two runs at the same time do not write the same files; one after the other does") {
  Scene scene = parse_scene(falling(""), "lock.toml");
  const fs::path path = folder("lock");
  const auto with = [&](const char* csv, const char* state) {
    Scene out = scene;
    out.output["csv"] = (path / csv).string();
    out.output["state"] = (path / state).string();
    return out;
  };
  const Scene first = with("a.csv", "a.state");
  RunOptions options;
  int refused = 0, ran = 0;
  options.progress = [&](double t) {
    if (t < 0.05 || refused > 0) return;
    for (const Scene& other : {with("a.csv", "b.state"), with("b.csv", "a.state")}) {
      CHECK_THROWS_WITH(run(other), Catch::Contains("another run"));
      ++refused;
    }
    ran += run(with("b.csv", "b.state")).failure.empty();
  };
  REQUIRE(run(first, options).failure == "");
  CHECK(refused == 2);
  CHECK(ran == 1);
  CHECK(content(path / "a.csv") == content(path / "b.csv"));
  CHECK(run(first).failure == "");
  // Nothing is left behind, and what a killed run left keeps nobody out.
  CHECK_FALSE(fs::exists(path / "a.csv.lock"));
  std::ofstream(path / "a.csv.lock") << "1\n";
  CHECK(run(first).failure == "");
}

TEST_CASE("outputs that collide with each other or with an input are refused") {
  const Scene good = parse_scene(falling(""), "names.toml");
  const fs::path path = folder("names");
  const auto refused = [&](auto change) {
    Scene scene = good;
    change(scene.output);
    for (std::string* name :
         {&scene.output["csv"], &scene.output["vtk"], &scene.output["svg"], &scene.output["state"]})
      if (!name->empty()) *name = (path / *name).string();
    CHECK_THROWS_AS(run(scene), std::invalid_argument);
    CHECK(fs::is_empty(path));
  };
  refused([](Output& o) { o["csv"] = o["svg"] = "a"; });
  refused([](Output& o) { o["csv"] = "a", o["state"] = "./a"; });
  refused([](Output& o) { o["csv"] = "a.pvd", o["vtk"] = "a.vtu"; });
  refused([](Output& o) { o["csv"] = "a", o["vtk"] = "a.pvd"; });
  refused([](Output& o) { o["csv"] = "s.new", o["state"] = "s"; });
  refused([](Output& o) { o["svg"] = "s", o["state"] = "s.new"; });
  refused([](Output& o) { o["vtk"] = "a", o["csv"] = "a/bodies_000001.vtp"; });
  refused([](Output& o) { o["csv"] = "x/.."; });

  // The scene itself, under another name, too.
  Scene scene = good;
  scene.file = (path / "scene.toml").string();
  std::ofstream(scene.file) << "precious";
  fs::create_symlink(scene.file, path / "link");
  for (const char* name : {"scene.toml", "link", "./scene.toml"}) {
    scene.output["csv"] = (path / name).string();
    CHECK_THROWS_AS(run(scene), std::invalid_argument);
  }
  CHECK(content(scene.file) == "precious");
}

TEST_CASE("a picture has the name that is asked for, whatever shells make of it") {
  Scene scene = parse_scene(falling(""), "picture.toml");
  const fs::path path = folder("picture");
  const fs::path before = fs::current_path();
  fs::current_path(path);
  scene.output["svg"] = "| touch pwned; cat > x";
  const auto largest_child = [] {
    rusage used{};
    getrusage(RUSAGE_CHILDREN, &used);
    return used.ru_maxrss;
  };
  const long before_it = largest_child();
  run(scene);
  CHECK(largest_child() == before_it);  // no other program has run
  fs::current_path(before);
  CHECK_FALSE(fs::exists(path / "pwned"));
  CHECK_FALSE(fs::exists(path / "x"));
  CHECK(content(path / scene.output["svg"]).find("<svg") != std::string::npos);
}

// A carriage that strikes a spring of 1e6 N on a millionth of a metre oscillates with the tolerance
// for its amplitude; the energy of .5 J came to twice and twenty times as much without a word.
TEST_CASE("run: energy that nothing takes or gives is kept, or the summary says so") {
  const auto warned = [](const std::string& engine, const std::string& spring) {
    return run(parse_scene("[scene]\nend = 0.02\n" + engine +
                               "[[body]]\nname = \"b\"\nmass = 1\ninertia = [1, 1, 1]\n"
                               "velocity = [1, 0, 0]\n[[joint]]\nkind = \"slider\"\n"
                               "bodies = [\"b\", \"world\"]\naxis = [1, 0, 0]\nspring = { " +
                               spring + " }\n",
                           "spring.toml"))
        .warnings;
  };
  const std::string soft = "stiffness_table = [[1e-2, 100]]",
                    hard = "stiffness_table = [[1e-6, 1e6]]", linear = "stiffness = 1e12",
                    damped = "stiffness = 1e4, damping = 200";
  for (const std::string engine : {"[smooth]\n", "engine = \"event\"\n"}) {
    INFO(engine);
    CHECK(warned(engine, soft).empty());
    CHECK(warned(engine, damped).empty());
    for (const std::string& spring : {hard, linear}) {
      INFO(spring);
      const std::vector<std::string> said = warned(engine, spring);
      REQUIRE(said.size() == 1);
      CHECK(said[0].find("the tolerance does not resolve the motion") != std::string::npos);
    }
  }
}

// A disc that rolls about its resting centre lost 38 % of the energy of its motion in steps of 5
// ms, without a word.
TEST_CASE(
    "run: steps too long for what rolls are said, and nothing where energy is lost by a law") {
  const std::string floor =
      "[[body]]\nname = \"floor\"\nshape = \"plane\"\nfixed = true\nmaterial = \"floor\"\n";
  const auto warned = [&](double step, double end, const std::string& body,
                          const std::string& pair) {
    const std::string scene =
        "[scene]\nend = " + std::to_string(end) +
        "\ngravity = [0, 0, -9.81]\n[stepping]\nstep = " + std::to_string(step) + "\n" + floor +
        "[[body]]\nname = \"b\"\nmass = 0.1\nmaterial = \"b\"\n" + body +
        "[[pair]]\nbetween = [\"floor\", \"b\"]\n" + pair;
    std::size_t count = 0;
    for (const std::string& each : run(parse_scene(scene, "rolling.toml")).warnings)
      count += each.find("stepping.step is too long for the motion") != std::string::npos;
    return count == 1;
  };
  const std::string disc =
      "shape = \"cylinder\"\nradius = 0.04\nlength = 0.01\n"
      "position = [0, 0, 0.018379268836956293]\norientation = { axis = [0, 1, 0], deg = 20 }\n"
      "angular_velocity = [16.645939336661293, 0, -8.52733067495695]\n";
  CHECK(warned(5e-3, 2, disc, "friction = 0.8"));
  CHECK(warned(2e-3, 2, disc, "friction = 0.8"));
  CHECK_FALSE(warned(1e-3, 2, disc, "friction = 0.8"));
  const std::string wheel =
      "shape = \"cylinder\"\nradius = 0.04\nlength = 0.01\nposition = [0, 0, 0.04]\n"
      "orientation = { axis = [1, 0, 0], deg = 90 }\n";
  CHECK_FALSE(warned(5e-3, 1, wheel + "velocity = [4, 0, 0]\nangular_velocity = [0, 100, 0]\n",
                     "friction = 0.8"));  // half a radian a step
  CHECK_FALSE(warned(5e-3, 1, wheel + "velocity = [4, 0, 0]\n", "friction = 0.2"));  // slips, rolls
  const std::string box = "shape = \"box\"\nsize = [0.02, 0.05, 0.1]\n";
  CHECK_FALSE(warned(5e-3, 1, box + "position = [0, 0, 0.05]\nvelocity = [2, 0, 0]\n",
                     "friction = 0.3"));  // slides
  CHECK_FALSE(warned(1e-3, 2,
                     "shape = \"box\"\nsize = [0.1, 0.05, 0.2]\nposition = [0, 0, 0.1]\n"
                     "angular_velocity = [0, 1.5, 0]\n",
                     "friction = 0.9"));  // rocks
  CHECK_FALSE(warned(5e-3, 2, "shape = \"sphere\"\nradius = 0.05\nposition = [0, 0, 0.5]\n",
                     "friction = 0.3\nrestitution = 0.5"));  // bounces
  // It tumbles, slides and rolls to rest: what rolling loses falls with the square of the step.
  const std::string coin =
      "shape = \"cylinder\"\nradius = 0.04\nlength = 0.03\nposition = [0, 0, 0.1]\n"
      "angular_velocity = [3, 2, 5]\norientation = { axis = [1, 1, 0], deg = 33 }\n";
  CHECK(warned(2e-3, 3, coin, "friction = 0.5"));
  CHECK_FALSE(warned(5e-4, 3, coin, "friction = 0.5"));
  // Laws that take energy are no errors of steps.
  CHECK_FALSE(warned(5e-3, 2, disc, "friction = 0.8\nrolling = 0.001"));
}
