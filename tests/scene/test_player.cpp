// Pages that play a run: whole, of bounded size, and nothing of a scene is more than text in them.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <tether/scene/cost.hpp>
#include <tether/scene/files.hpp>
#include <tether/scene/run.hpp>

#include "picture/canvas.hpp"
#include "player/film.hpp"
#include "player/page_text.hpp"
#include "run_files.hpp"
#include "support/catch.hpp"

using namespace tether::scene;
using tether::test::content;
using tether::test::folder;
using Json = nlohmann::json;

namespace {

constexpr const char* kBall = R"(
[scene]
name = "a ball"
end = 0.5
gravity = [0, 0, -9.81]
[[body]]
name = "floor"
shape = "plane"
fixed = true
material = "m"
[[body]]
name = "ball"
shape = "sphere"
radius = 0.1
mass = 1
position = [0, 0, 0.1]
velocity = [1, 0, 0]
material = "m"
[[pair]]
between = ["m", "m"]
friction = 0.2
)";

RunResult play(Scene scene, const std::string& file) {
  scene.output["html"] = file;
  return run(scene);
}

std::string page_of(const Scene& scene) {
  const auto file = folder("player") / "page.html";
  CHECK(play(scene, file.string()).failure == "");
  return content(file);
}

std::size_t count(const std::string& text, const std::string& what) {
  std::size_t n = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++n;
  return n;
}

/// The text of the script element with this id.
std::string element(const std::string& page, const std::string& id) {
  const std::size_t tag = page.find("<script id=\"" + id + "\"");
  REQUIRE(tag != std::string::npos);
  const std::size_t from = page.find('>', tag) + 1;
  return page.substr(from, page.find("</script>", from) - from);
}

std::string decoded(const std::string& base64) {
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  REQUIRE(base64.size() % 4 == 0);
  std::string bytes;
  for (std::size_t i = 0; i < base64.size(); i += 4) {
    unsigned four = 0, given = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const std::size_t digit = digits.find(base64[i + k]);
      if (digit == std::string::npos) REQUIRE(base64[i + k] == '=');
      given += digit != std::string::npos;
      four = four << 6 | static_cast<unsigned>(digit == std::string::npos ? 0 : digit);
    }
    for (unsigned k = 0; k + 1 < given; ++k) bytes += static_cast<char>(four >> (16 - 8 * k) & 255);
  }
  return bytes;
}

std::vector<float> floats(const std::string& bytes) {
  std::vector<float> out(bytes.size() / 4);
  std::memcpy(out.data(), bytes.data(), bytes.size());
  return out;
}

/// The data of the page; REQUIREs JSON.
Json data_of(const std::string& page) {
  const Json data = Json::parse(element(page, "film-data"), nullptr, false);
  REQUIRE(data.is_object());
  return data;
}

}  // namespace

TEST_CASE("a page is one document with the data of its run, and asks the network for nothing") {
  const std::string page = page_of(parse_scene(kBall, "ball.toml"));
  CHECK(page.rfind("<!DOCTYPE html>", 0) == 0);
  CHECK(page.find("<title>a ball</title>") != std::string::npos);
  CHECK(count(page, "<script") == 5);
  CHECK(count(page, "</script>") == 5);
  // Sources that the policy does not name fall under its default; scripts and styles are those of
  // the page.
  CHECK(page.find(
            "content=\"default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
            "base-uri 'none'; form-action 'none'\">") != std::string::npos);
  for (const char* link :
       {"http:", "https:", "src=", "href=", "@import", "fetch(", "innerHTML", "eval("})
    CHECK(page.find(link) == std::string::npos);
  const Json data = data_of(page);
  CHECK(data["bodies"].size() == 2);
  CHECK(data["times"].size() == 501);
  // A frame a step of one moving body.
  const std::vector<float> x = floats(decoded(element(page, "film-positions")));
  REQUIRE(x.size() == 3 * 501);
  CHECK(decoded(element(page, "film-orientations")).size() == 8 * 501);
  const double length = data["length"], v = 1, a = 0.2 * 9.81;
  const double slides = v / (3.5 * a), at_rest = v * slides - a * slides * slides / 2;
  const double moved = length * (x[x.size() - 3] - x[0]);
  CHECK(moved == Approx(at_rest + 5. / 7 * v * (0.5 - slides)).margin(1e-3));
  CHECK(decoded(element(page, "film-contacts")).size() % (9 * 4) == 0);
  CHECK(!decoded(element(page, "film-contacts")).empty());
}

TEST_CASE("the page of an event run has its forces") {
  Scene scene = parse_scene(kBall, "events.toml");
  scene.engine = EngineKind::event;
  scene.bodies[1].velocity.setZero();
  const std::string page = page_of(scene);
  const std::vector<float> x = floats(decoded(element(page, "film-contacts")));
  REQUIRE(x.size() % 9 == 0);
  REQUIRE(x.size() >= 9 * 100);
  for (std::size_t k = 0; k < x.size(); k += 9) {
    CHECK(std::abs(std::abs(x[k + 5]) - 9.81) < 1e-4);
    CHECK(std::abs(x[k + 3]) + std::abs(x[k + 4]) < 1e-4);
  }
}

TEST_CASE("texts of a scene stay texts on its page") {
  Scene scene = parse_scene(kBall, "hostile.toml");
  const std::string evil =
      "</script><script>alert(1)</script><!--<script>\"'&`${x}\\u003c\n\x1b]0;t\x07";
  scene.name = evil + "\xff\xc0\xaf\xed\xa0\x80\xe2\x80\xa8";
  scene.bodies[1].name = evil;
  const std::string page = page_of(scene), data = element(page, "film-data");
  CHECK(count(page, "<script") == 5);
  CHECK(count(page, "</script>") == 5);
  CHECK(count(page, "<!--") == 1);  // that Tether has written it
  CHECK(page.find('\x1b') == std::string::npos);
  for (const char c : {'<', '>', '&', '\'', '\x07', '\x7f', '\xe2'})
    CHECK(data.find(c) == std::string::npos);
  CHECK(data_of(page)["bodies"][1]["name"] == evil);
  // Bytes that are no UTF-8 (cut, overlong, surrogate) are U+FFFD.
  const std::string name = data_of(page)["name"];
  CHECK(name.rfind(evil + "\xef\xbf\xbd", 0) == 0);
  CHECK(name.substr(name.size() - 3) == "\xe2\x80\xa8");
  const std::size_t title = page.find("<title>") + 7;
  const std::string shown = page.substr(title, page.find("</title>") - title);
  CHECK(shown.find('<') == std::string::npos);
  CHECK(shown.find_first_of("\x1b\x07\n\"'") == std::string::npos);
  CHECK(picture::markup_text("a<b> & \xc3\xa4\xff") == "a&#60;b&#62; &#38; \xc3\xa4\xef\xbf\xbd");
}

TEST_CASE("numbers that JSON lacks are null, base 64 is that of RFC 4648") {
  CHECK(player::script_text(std::nan("")) == "null");
  CHECK(player::script_text(-INFINITY) == "null");
  CHECK(player::script_text(std::vector<double>{0.5, INFINITY, -1e-300}) == "[0.5,null,-1e-300]");
  CHECK(player::script_text("\xe2\x80\xa8 \xc3\xa4 \xf0\x9f\x98\x80 <") ==
        "\"\\u2028 \\u00e4 \\ud83d\\ude00 \\u003c\"");
  CHECK(player::base64(std::vector<std::int16_t>{}) == "");
  CHECK(player::base64(std::vector<std::int16_t>{0x6f66}) == "Zm8=");
  CHECK(player::base64(std::vector<std::int16_t>{0x6f66, 0x626f}) == "Zm9vYg==");
  CHECK(player::base64(std::vector<std::int16_t>{0x6f66, 0x626f, 0x7261}) == "Zm9vYmFy");
  CHECK(player::base64(std::vector<float>{1}) == "AACAPw==");
}

TEST_CASE(
    "a page has a bounded number of frames, the first and the last record, and the largest "
    "errors") {
  struct Moving : Engine {
    double t = 0;
    std::vector<BodyState> states{1};
    std::vector<ContactState> none;
    const char* name() const override { return "test"; }
    double time() const override { return t; }
    void advance(double to) override { t = to; }
    const std::vector<BodyState>& bodies() const override { return states; }
    Diagnostics diagnostics() const override { return {}; }
    const std::vector<ContactState>& contacts() const override { return none; }
    Counts counts() const override { return {}; }
    std::vector<EffectCost> costs() const override { return {}; }
    void save(std::ostream&) const override {}
    void restore(std::istream&, Restore) override {}
  };
  for (const int records : {1, 2, 3, 1999, 2000, 2001, 2002, 7777, 8001, 100000}) {
    for (const std::size_t bytes : {player::Film::kMostBytes, std::size_t{500}}) {
      Moving engine;
      player::Film film({0}, {}, bytes);
      for (int k = 0; k < records; ++k) {
        engine.t = k;
        engine.states[0].position.x() = k;
        Diagnostics d;
        d.drift = k == records / 3 ? 7 : 1;
        film.record(engine, d);
      }
      film.finish();
      const std::vector<player::Film::Frame>& frames = film.frames();
      CAPTURE(records, bytes, frames.size());
      CHECK(frames.size() <= player::Film::kMostFrames + 1);
      CHECK(frames.size() >= std::min<std::size_t>(static_cast<std::size_t>(records), 10));
      const std::vector<float> x = floats(decoded(film.joined(&player::Film::Frame::positions)));
      REQUIRE(x.size() == 3 * frames.size());
      CHECK(x.front() == 0);
      CHECK(x[x.size() - 3] == static_cast<float>(records - 1));
      double drift = 0;
      for (std::size_t i = 0; i < frames.size(); ++i) {
        CHECK(x[3 * i] == static_cast<float>(frames[i].time));
        if (i > 0) CHECK(frames[i - 1].time < frames[i].time);
        drift = std::max(drift, frames[i].d.drift);
      }
      CHECK(drift == 7);
    }
  }
}

TEST_CASE("pages hold scenes of every size and place: lengths are those of the scene") {
  for (const double scale : {1e-8, 1.0, 1e8}) {
    Scene scene = parse_scene(kBall, "scaled.toml");
    scene.end *= std::sqrt(scale);
    scene.stepping.emplace().step = 1e-3 * std::sqrt(scale);
    scene.bodies[1].shapes[0].radius *= scale;
    scene.bodies[1].position *= scale;
    scene.bodies[1].inertia *= scale * scale;
    scene.bodies[1].velocity *= std::sqrt(scale);
    const std::string page = page_of(scene);
    CAPTURE(scale);
    CHECK(data_of(page)["length"].get<double>() / scale == Approx(0.1 * std::sqrt(3)));
    for (const float x : floats(decoded(element(page, "film-positions")))) CHECK(std::abs(x) < 10);
  }
}

TEST_CASE("a page names joints, springs and points, and survives bodies without shapes") {
  const std::string page = page_of(parse_scene(R"(
[scene]
end = 0.1
[[body]]
name = "point"
mass = 1
inertia = [1, 1, 1]
position = [1, 0, 0]
[[body]]
name = "table"
shape = "points"
points = [[1, 0, 0]]
mass = 1
inertia = [1, 1, 1]
position = [5, 0, 0]
[[joint]]
name = "rod"
kind = "distance"
bodies = ["point", "world"]
at = [[1, 0, 0], [0, 0, 0]]
[[joint]]
kind = "hinge"
name = "door"
bodies = ["table", "world"]
at = [5, 0, 0]
axis = [0, 0, 2]
[[spring]]
name = "coil"
bodies = ["table", "point"]
at = [[5, 0, 0], [1, 0, 0]]
stiffness = 10
[[central_gravity]]
gravitational_parameter = 1
at = [0, 3, 0]
)",
                                               "parts.toml"));
  const Json data = data_of(page);
  CHECK(data["joints"][0]["name"] == "rod");
  CHECK(data["joints"][0]["kind"] == "distance");
  CHECK(data["joints"][1]["name"] == "door");
  CHECK(data["joints"][1]["kind"] == "hinge");
  CHECK(data["joints"][1]["axis"] == Json({0, 0, 1}));
  CHECK(data["springs"][0]["name"] == "coil");
  CHECK(data["bodies"][0]["name"] == "point");
  CHECK(data["bodies"][0]["parts"].empty());
  CHECK(data["bodies"][1]["parts"][0]["dots"].size() == 1);
}

TEST_CASE(
    "a page that cannot be written is said before the run, one beside another output is refused") {
  Scene scene = parse_scene(kBall, "names.toml");
  CHECK_THROWS_WITH(play(scene, "/proc/page.html"), Catch::Contains("/proc/page.html"));
  const auto path = folder("player_names");
  const std::string page = (path / "a").string();
  for (const char* name : {"a", "./a", "a.new", "b/../a"}) {
    scene.output["csv"] = (path / name).string();
    CHECK_THROWS_AS(play(scene, page), std::invalid_argument);
  }
  scene.output["csv"].clear();
  scene.file = page;
  CHECK_THROWS_AS(play(scene, page), std::invalid_argument);
  scene.file.clear();
  CHECK_THROWS_AS(play(scene, path.string() + "/"), std::invalid_argument);
}

TEST_CASE("a page of costs has every point of the table and the command that repeats it") {
  Scene scene = parse_scene(kBall, "it's a ball.toml");
  scene.name = "a < b & \"c\" </script><img src=x>";
  CostOptions options;
  options.steps = {4e-3, 2e-3};
  options.accuracies = {1e-3};
  options.reference = 1e-3;
  CostTable table = cost(scene, options);
  REQUIRE(table.rows.size() == 3);
  table.rows[1].failure = "stuck <b>";
  const std::string page = cost_page(scene, table, 1e-2);
  CHECK(page.find("<img") == std::string::npos);
  CHECK(page.find("<b>") == std::string::npos);
  CHECK(page.find("http:") == page.find("http://www.w3.org/2000/svg"));  // a name, not a link
  CHECK(page.find("stuck &#60;b&#62;") != std::string::npos);
  const auto count = [&](const std::string& part) {
    int n = 0;
    for (std::size_t at = page.find(part); at != std::string::npos; at = page.find(part, at + 1))
      ++n;
    return n;
  };
  // In the table, and in the picture where the run got through.
  const std::string command = "tether cost &#39;it&#39;\\&#39;&#39;s a ball.toml&#39; ";
  CHECK(count("<code>" + command) == 3);
  CHECK(count("<title>" + command) == 2);
  CHECK(count(command + "--accuracies 0.001 --reference 0.001<") == 2);
  CHECK(count(command + "--time-steps 0.004 --reference 0.001<") == 2);
  CHECK(count(fmt::format("<td>{:.2e}<td>", table.rows[0].error)) == 1);
  // Alone it has the same reference, and so the same error.
  CostOptions alone;
  alone.steps = {4e-3};
  alone.reference = table.reference_setting;
  CHECK(cost(scene, alone).rows.at(0).error == table.rows[0].error);
  options.reference.reset();
  table = cost(scene, options);
  alone.reference = table.reference_setting;
  CHECK(cost(scene, alone).rows.at(0).error == table.rows[0].error);
}
