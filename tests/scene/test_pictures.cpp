// Pictures: well-formed, and no text over another. SPDX-License-Identifier: BSD-3-Clause
#include <tinyxml2.h>

#include <cmath>
#include <filesystem>
#include <string>
#include <tether/scene/cost.hpp>
#include <tether/scene/files.hpp>
#include <tether/scene/run.hpp>
#include <vector>

#include "output/thinned.hpp"
#include "picture/canvas.hpp"
#include "run_files.hpp"
#include "support/catch.hpp"

using namespace tether::scene;
using tether::test::content;
using tether::test::folder;
namespace fs = std::filesystem;

namespace {

struct Text {
  std::string words;
  picture::Box box;
};

void collect(const tinyxml2::XMLElement& from, std::vector<Text>& out) {
  for (const auto* e = from.FirstChildElement(); e != nullptr; e = e->NextSiblingElement()) {
    collect(*e, out);
    if (std::string(e->Name()) != "text") continue;
    const std::string words = e->GetText() != nullptr ? e->GetText() : "";
    double characters = 0;
    for (const char c : words) characters += (static_cast<unsigned char>(c) & 0xc0) != 0x80;
    const double size = e->DoubleAttribute("font-size"), width = 0.6 * size * characters;
    const std::string anchor = e->Attribute("text-anchor");
    const double left = e->DoubleAttribute("x") - (anchor == "middle" ? width / 2
                                                   : anchor == "end"  ? width
                                                                      : 0.0);
    const double y = e->DoubleAttribute("y");
    out.push_back({words, {left, y - 0.8 * size, left + width, y + 0.2 * size}});
  }
}

/// Its texts, after they were found to be apart and inside of the picture.
std::vector<Text> texts_of(const std::string& svg) {
  tinyxml2::XMLDocument document;
  REQUIRE(document.Parse(svg.data(), svg.size()) == tinyxml2::XML_SUCCESS);
  const tinyxml2::XMLElement& root = *document.RootElement();
  std::vector<Text> texts;
  collect(root, texts);
  const picture::Box whole{0, 0, root.DoubleAttribute("width"), root.DoubleAttribute("height")};
  for (std::size_t i = 0; i < texts.size(); ++i) {
    INFO("\"" << texts[i].words << "\"");
    CHECK(whole.holds(texts[i].box));
    for (std::size_t k = i + 1; k < texts.size(); ++k) {
      INFO("and \"" << texts[k].words << "\"");
      CHECK_FALSE(texts[i].box.meets(texts[k].box));
    }
  }
  return texts;
}

bool has(const std::vector<Text>& texts, const std::string& words) {
  for (const Text& each : texts)
    if (each.words == words) return true;
  return false;
}

CostRow row(CostMethod method, double setting, double error, double seconds) {
  CostRow out;
  out.method = method;
  out.setting = setting;
  out.error = error;
  out.seconds = seconds;
  return out;
}

}  // namespace

TEST_CASE("texts of a picture of costs are apart wherever its points lie") {
  Scene scene;
  scene.name = "slider-crank";
  CostTable table;
  table.reference_error = 1e-9;
  // From points all over each other to seven decades.
  for (const double spread : {0.0, 0.01, 0.1, 0.5, 1.0}) {
    table.rows.clear();
    double factor = 1;
    for (int k = 0; k < 6; ++k, factor *= 0.1) {
      const double errors = std::pow(factor, spread), times = std::pow(factor, -0.5 * spread);
      table.rows.push_back(row(CostMethod::events, 1e-3 * factor, 1e-3 * errors, 1e-3 * times));
      table.rows.push_back(row(CostMethod::steps, 1e-3 / (k + 1), 2e-3 * errors, 1.1e-3 * times));
      table.rows.push_back(row(CostMethod::accuracy, 1e-2 * factor, 1e-3 * errors, 1e-3 * times));
    }
    INFO("spread " << spread);
    const std::vector<Text> texts = texts_of(cost_picture(scene, table, 1e-4));
    CHECK(has(texts, "slider-crank: what accuracy costs"));
    CHECK(has(texts, "processor time / ms"));
    CHECK(has(texts, "largest error / m, rad"));
    for (const char* method : {"events: tolerance", "steps: step / s", "accuracy: accuracy"})
      CHECK(has(texts, method));
    if (spread == 1) {  // there is room for all
      CHECK(has(texts, "wanted 0.0001"));
      CHECK(has(texts, "trust in the reference"));
      CHECK(has(texts, "0.0001667"));
    }
  }
}

TEST_CASE("a picture of costs takes any name and any table") {
  Scene scene;
  scene.name = "a < b & \"c\" </svg> \xff\xc3\x28\xed\xa0\x80\x01 \xc3\xa9";
  CostTable table;
  CHECK(has(texts_of(cost_picture(scene, table)), "no run got through"));
  table.rows.push_back(row(CostMethod::smooth, 1e-6, 0, 0));
  const std::vector<Text> texts = texts_of(cost_picture(scene, table));
  CHECK(texts.front().words.find("a < b & \"c\" </svg> ") == 0);
  CHECK(texts.front().words.find("\xc3\xa9: what") != std::string::npos);
  scene.name = std::string(300, 'W');
  texts_of(cost_picture(scene, table));
}

TEST_CASE("a picture shows joints that hold at its end") {
  // The rod carries twice the weight of the ball where it breaks, at 0.33 s.
  const auto rods = [](double end) {
    Scene scene = parse_scene(
        "[scene]\nend = 1\ngravity = [0, 0, -9.81]\n[[body]]\nname = \"ball\"\nmass = 2\n"
        "inertia = [0.1, 0.1, 0.1]\nposition = [0.7, 0, 0]\n[[joint]]\nname = \"rod\"\n"
        "kind = \"distance\"\nbodies = [\"ball\", \"world\"]\nat = [[0.7, 0, 0], [0, 0, 0]]\n"
        "break_force = 39.24\n",
        "rod.toml");
    scene.end = end;
    scene.output["svg"] = (folder("pictures") / "rod.svg").string();
    CHECK(run(scene).failure == "");
    return content(scene.output["svg"]).find("stroke=\"#404040\" stroke-width=\"2\"") !=
           std::string::npos;
  };
  CHECK(rods(0.2));
  CHECK(!rods(0.6));
}

TEST_CASE("a picture of numbers at the ends of their range comes to its end") {
  // Ticks up to infinity were counted without end: of ratios beyond 1e308, and of their margins.
  Scene scene = parse_scene(
      "[scene]\nend = 0.02\ngravity = [0, 1e150, -9.81]\n[stepping]\nstep = 1e-3\n[[body]]\nshape "
      "= \"sphere\"\nradius = 1\nmass = 1\n",
      "far.toml");
  scene.output["svg"] = (folder("pictures") / "far.svg").string();
  CHECK(run(scene).failure == "");
  CHECK(has(texts_of(content(scene.output["svg"])), "energy / J"));
  for (const double least : {5e-324, 1e-300, 1.0, 1e300})
    for (const double most : {5e-324, 1.0, 1e300, 1e308}) {
      CAPTURE(least, most);
      CostTable table;
      table.rows = {row(CostMethod::steps, 1e-3, least, least),
                    row(CostMethod::steps, 1e-4, most, most)};
      CHECK(has(texts_of(cost_picture(scene, table)), "largest error / m, rad"));
      for (const bool logarithmic : {false, true}) {
        const picture::Range range = picture::range_of({least, -most, most}, logarithmic);
        CHECK(std::isfinite(range.high - range.low));
        CHECK(range.low < range.high);
        CHECK((!logarithmic || range.low > 0));
      }
    }
}

TEST_CASE("texts of the pictures of all shipped scenes are apart") {
  std::size_t scenes = 0;
  for (const auto& entry : fs::directory_iterator(TETHER_SHIPPED_SCENES)) {
    if (entry.path().extension() != ".toml") continue;
    Scene scene = read_scene(entry.path().string());
    if (scene.bodies.size() > 100) continue;  // slow, and without names
    INFO(entry.path());
    // Their beginning; the pictures in the repository are of all of them.
    scene.end *= 0.003;
    scene.expect.clear();
    scene.output = Output{};
    scene.output.every = scene.end / 100;
    scene.output["svg"] = (folder("pictures") / "a.svg").string();
    run(scene);
    const std::vector<Text> texts = texts_of(content(scene.output["svg"]));
    CHECK(has(texts, "t / s"));
    CHECK(has(texts, "energy / J"));
    CHECK(has(texts, "kinetic"));
    ++scenes;
  }
  CHECK(scenes > 10);
}

TEST_CASE("texts of the pictures in the repository are apart") {
  std::size_t pictures = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(TETHER_SHIPPED_SCENES) / "figures")) {
    if (entry.path().extension() != ".svg") continue;
    INFO(entry.path());
    texts_of(content(entry.path()));
    ++pictures;
  }
  CHECK(pictures > 10);
}

namespace {

constexpr const char* kMechanism = R"(
[scene]
name = "a < b & c"
end = 0.2
gravity = [0, 0, -9.81]
[[body]]
name = "bob 1"
mass = 1
inertia = [1, 1, 1]
position = [1, 0, 0]
[[body]]
name = "bob 2"
mass = 1
inertia = [1, 1, 1]
position = [1, 0, 0.01]
[[body]]
name = "wall"
shape = "plane"
fixed = true
[[joint]]
kind = "distance"
bodies = ["bob 1", "world"]
at = [[1, 0, 0], [0, 0, 0]]
[[spring]]
bodies = ["bob 2", "world"]
at = [[1, 0, 0.01], [0, 0, 1]]
stiffness = 10
)";

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t found = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1))
    ++found;
  return found;
}

}  // namespace

TEST_CASE("every shipped scene stands in the README of the examples, and that in the first one") {
  const fs::path scenes = TETHER_SHIPPED_SCENES;
  const std::string listed = content(scenes.parent_path() / "README.md");
  for (const auto& entry : fs::directory_iterator(scenes)) {
    if (entry.path().extension() != ".toml") continue;
    INFO(entry.path());
    CHECK(count(listed, "(scenes/" + entry.path().filename().string() + ")") > 0);
  }
  CHECK(count(content(scenes.parent_path().parent_path() / "README.md"),
              "[Scenes](examples/README.md)") == 1);
}

TEST_CASE("texts of a scene stay texts in its picture") {
  Scene scene = parse_scene(kMechanism, "picture.toml");
  scene.bodies[0].name = "bob < & >";  // no file has such a name
  scene.output["svg"] = (folder("pictures") / "a.svg").string();
  run(scene);
  const std::vector<Text> texts = texts_of(content(scene.output["svg"]));
  CHECK(has(texts, "a < b & c"));
  CHECK(has(texts, "bob < & >"));
  CHECK(has(texts, "bob 2"));
  CHECK(has(texts, "0.2 m"));
  CHECK(has(texts, "t = 0 (outline) to 0.2 s"));
}

TEST_CASE("ground is hatched where it is, and what the world holds has a bearing") {
  Scene scene = parse_scene(kMechanism, "picture.toml");
  scene.output["svg"] = (folder("pictures") / "a.svg").string();
  run(scene);
  // The ground, the bearing of the rod, the end of the spring.
  CHECK(count(content(scene.output["svg"]), "url(#hatch)") == 3);
  scene.bodies.pop_back();
  scene.springs.clear();
  run(scene);
  CHECK(count(content(scene.output["svg"]), "url(#hatch)") == 1);
  scene.joints.clear();
  run(scene);
  CHECK(count(content(scene.output["svg"]), "hatch") == 0);
}

TEST_CASE("a picture of a run that ends at its start is one") {
  Scene scene = parse_scene(kMechanism, "picture.toml");
  scene.output["svg"] = (folder("pictures") / "a.svg").string();
  RunOptions options;
  options.interrupted = [] { return true; };
  run(scene, options);
  texts_of(content(scene.output["svg"]));
}

TEST_CASE("a thinned run keeps its last record and the errors of all") {
  struct Record {
    Diagnostics d;
    int number = 0;
    static std::size_t bytes() { return 1; }
  };
  for (int records = 1; records <= 40; ++records) {
    Thinned<Record> thinned(4);
    for (int k = 1; k <= records; ++k) {
      Record now;
      now.number = k;
      now.d.drift = k == (2 * records + 2) / 3 ? 1 : 0;
      thinned.add(now);
    }
    thinned.finish();
    INFO(records << " records");
    const std::vector<Record>& kept = thinned.all();
    CHECK(kept.size() <= 5);
    CHECK(kept.front().number == 1);
    CHECK(kept.back().number == records);
    double drift = 0;
    for (const Record& each : kept) drift = std::max(drift, each.d.drift);
    CHECK(drift == 1);
  }
}
