// Scene files damaged in every way: no crash, no hang, each error names its place.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>
#include <vector>

#include "support/catch.hpp"
#include "texts.hpp"

using namespace tether::scene;

namespace {

using Random = std::mt19937;

// std::uniform_int_distribution differs between libraries; this does not.
std::size_t below(Random& random, std::size_t n) { return n == 0 ? 0 : random() % n; }

const std::vector<std::string> kNasty = {"nan",
                                         "inf",
                                         "-inf",
                                         "0",
                                         "-1",
                                         "1e308",
                                         "-1e308",
                                         "1e-320",
                                         "1e400",
                                         "9223372036854775807",
                                         "9223372036854775808",
                                         "0x7f",
                                         "true",
                                         "\"\"",
                                         "\"x\"",
                                         "'''",
                                         "[]",
                                         "[[]]",
                                         "{}",
                                         "{ a = 1 }",
                                         "[1, 2, 3]",
                                         "[nan, 0, 0]",
                                         "[1e308, 1e308, 1e308]",
                                         "[0, 0, 0]",
                                         "1979-05-27",
                                         "[[body]]",
                                         "[scene]",
                                         "=",
                                         "\n",
                                         "#",
                                         ",",
                                         "]",
                                         "}",
                                         "\"\"\"",
                                         std::string(300, '['),
                                         std::string(1, '\0'),
                                         "\xff",
                                         "\xc3\x28",
                                         "[\"world\", \"world\"]"};

std::vector<std::string> lines(const std::string& text) {
  std::vector<std::string> out(1);
  for (const char c : text) {
    out.back() += c;
    if (c == '\n') out.emplace_back();
  }
  return out;
}

std::string joined(const std::vector<std::string>& parts) {
  std::string out;
  for (const std::string& part : parts) out += part;
  return out;
}

// Processor time alone counts: others use the machine, too, and waiting is no hang.
double processor_seconds(std::clock_t start) {
  return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
}

/// One damage.
std::string damaged(const std::string& text, const std::string& other, Random& random) {
  std::string out = text;
  const std::size_t at = below(random, out.size());
  switch (below(random, 10)) {
    case 0:  // a byte
      if (!out.empty()) out[at] = static_cast<char>(random());
      return out;
    case 1:  // some bytes less
      return out.erase(at, 1 + below(random, 20));
    case 2:  // cut off
      return out.substr(0, at);
    case 3:  // doubled
      return out.insert(at, out.substr(at, below(random, 200)));
    case 4:
      return out.insert(at, kNasty[below(random, kNasty.size())]);
    case 5: {  // a value
      const std::size_t equals = out.find('=', at);
      if (equals == std::string::npos) return out;
      const std::size_t end = std::min(out.find('\n', equals), out.size());
      return out.replace(equals + 1, end - equals - 1, " " + kNasty[below(random, kNasty.size())]);
    }
    case 6: {  // a number
      const std::size_t digit = out.find_first_of("0123456789", at);
      if (digit == std::string::npos) return out;
      const std::size_t end = out.find_first_not_of("0123456789.e-+", digit);
      return out.replace(digit, std::min(end, out.size()) - digit,
                         kNasty[below(random, kNasty.size())]);
    }
    case 7: {  // a line less
      std::vector<std::string> all = lines(out);
      all.erase(all.begin() + static_cast<long>(below(random, all.size())));
      return joined(all);
    }
    case 8: {  // two lines change places
      std::vector<std::string> all = lines(out);
      std::swap(all[below(random, all.size())], all[below(random, all.size())]);
      return joined(all);
    }
    default:  // a piece of another scene
      return out.insert(at, other.substr(below(random, other.size()), below(random, 300)));
  }
}

std::vector<std::string> scenes() {
  std::vector<std::string> out = {texts::kJointed, texts::kTouching};
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(TETHER_SHIPPED_SCENES))
    if (entry.path().extension() == ".toml") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  for (const std::filesystem::path& file : files) {
    std::ifstream in(file, std::ios::binary);
    out.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  }
  return out;
}

// Beside the shipped ones, whose files of surfaces it finds.
const std::string kName = TETHER_SHIPPED_SCENES "/mutant.toml";

/// True if the text is a scene. A scene must be writable and the same again; an error must tell
/// where it is.
bool judge(const std::string& text) {
  try {
    const Scene scene = parse_scene(text, kName);
    try {
      make_plan(scene);
    } catch (const std::invalid_argument&) {
    }
    const std::string once = write_scene(scene);
    if (write_scene(parse_scene(once, "again.toml")) != once) {
      UNSCOPED_INFO(text);
      FAIL("not the same scene when written and read");
    }
    return true;
  } catch (const SceneError& e) {
    bool placed = !e.problems().empty();
    for (const Problem& problem : e.problems())
      placed = placed && problem.place.file == kName && problem.place.line > 0 &&
               problem.place.column > 0 && !problem.allowed.empty();
    if (!placed) {
      UNSCOPED_INFO(text);
      FAIL("an error without a place: " << e.what());
    }
    return false;
  }
}

}  // namespace

TEST_CASE("ten thousand damaged scene files are refused with a place, or are scenes") {
  const std::vector<std::string> originals = scenes();
  for (const std::string& text : originals) REQUIRE(judge(text));

  Random random(20261121);
  constexpr int kFiles = 10000;
  int accepted = 0;
  double slowest = 0;
  for (int i = 0; i < kFiles; ++i) {
    std::string text = originals[static_cast<std::size_t>(i) % originals.size()];
    const std::string& other = originals[below(random, originals.size())];
    for (std::size_t n = 1 + below(random, 3); n > 0; --n) text = damaged(text, other, random);
    const std::clock_t start = std::clock();
    accepted += judge(text);
    slowest = std::max(slowest, processor_seconds(start));
  }
  WARN(accepted << " of " << kFiles << " damaged files are scenes still; the slowest took "
                << slowest * 1e3 << " ms");
  CHECK(accepted < kFiles / 2);
  CHECK(slowest < 2);
}

TEST_CASE("scenes of unusual size are read or refused in bounded time") {
  const std::clock_t start = std::clock();
  std::string many;
  for (int i = 0; i < 20000; ++i)
    many += "[[body]]\nshape = \"sphere\"\nradius = 0.1\nmass = 1\nmaterial = \"m\"\n";
  CHECK(parse_scene(many, "many.toml").bodies.size() == 20000);
  CHECK_FALSE(judge(many + "[[pair]]\nbetween = [\"m\", \"k\"]\n"));

  std::string points = "[[body]]\nmass = 1\nshape = \"convex\"\npoints = [";
  for (int i = 0; i < 64; ++i)
    points += "[" + std::to_string(i % 8) + ", " + std::to_string(i / 8) + ", " +
              (i == 63 ? "1" : "0") + "], ";
  CHECK_FALSE(judge(points + "]\n"));  // not centred; all but one point in one face

  std::string wrong = "[[body]]\nfixed = true\n";
  for (int i = 0; i < 100000; ++i) wrong += "k" + std::to_string(i) + " = 1\n";
  CHECK_FALSE(judge(wrong));
  CHECK_FALSE(judge(std::string(5000000, 'a')));
  CHECK_FALSE(judge("x = \"" + std::string(5000000, 'a') + "\"\n"));
  CHECK_FALSE(judge("[a." + std::string(100000, 'b') + "]\n"));

  CHECK(processor_seconds(start) < 30);
}
