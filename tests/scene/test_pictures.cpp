// Pictures: well-formed, and no text over another. SPDX-License-Identifier: BSD-3-Clause
#include <tinyxml2.h>

#include <cmath>
#include <string>
#include <tether/scene/cost.hpp>
#include <tether/scene/files.hpp>
#include <vector>

#include "picture/canvas.hpp"
#include "support/catch.hpp"

using namespace tether::scene;

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

CostRow row(Method method, double setting, double error, double seconds) {
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
      table.rows.push_back(row(Method::events, 1e-3 * factor, 1e-3 * errors, 1e-3 * times));
      table.rows.push_back(row(Method::steps, 1e-3 / (k + 1), 2e-3 * errors, 1.1e-3 * times));
      table.rows.push_back(row(Method::accuracy, 1e-2 * factor, 1e-3 * errors, 1e-3 * times));
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
  table.rows.push_back(row(Method::smooth, 1e-6, 0, 0));
  const std::vector<Text> texts = texts_of(cost_picture(scene, table));
  CHECK(texts.front().words.find("a < b & \"c\" </svg> ") == 0);
  CHECK(texts.front().words.find("\xc3\xa9: what") != std::string::npos);
  scene.name = std::string(300, 'W');
  texts_of(cost_picture(scene, table));
}
