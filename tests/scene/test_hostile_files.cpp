// Scene files of somebody who means harm: names that lead away, depth and length without end.
// SPDX-License-Identifier: BSD-3-Clause
#include <string>
#include <tether/scene/files.hpp>
#include <utility>
#include <vector>

#include "support/catch.hpp"
#include "support/growth.hpp"

using namespace tether::scene;
using tether::test::growth;
using tether::test::kLinear;

namespace {

std::string repeated(const std::string& text, int times) {
  std::string all;
  for (int k = 0; k < times; ++k) all += text;
  return all;
}

std::string sphere(const std::string& more) {
  return "[[body]]\nshape = \"sphere\"\nradius = 1\nmass = 1\n" + more;
}

}  // namespace

TEST_CASE("names of outputs stay in the folder of the output, with the ending of their kind") {
  for (const auto& [key, ending] : {std::pair<std::string, std::string>{"csv", ".csv"},
                                    {"vtk", ".pvd"},
                                    {"svg", ".svg"},
                                    {"state", ".state"}}) {
    const auto with = [key = key](const std::string& name) {
      INFO(key << " = " << name);
      return parse_scene(sphere("[output]\n") + key + " = \"" + name + "\"\n", "names.toml");
    };
    for (const char* good :
         {"a", "results/run 1/a", "a..b", "./x", "Ergebnis_%d", "x.csv", "m\u00fc"})
      CHECK_NOTHROW(with(good + ending));
    for (const char* bad :
         {"| touch pwned", "/etc/passwd", "../a",     "a/../../b", "x/../y", "a|b",
          "`touch x`",     "$(x)",        "-o",       "~/a",       "a;b",    "a\\\\b",
          "a/-o",          "a/~b",        "a/ b",     "a'b",       "a(b)",   "(a",
          "a&b",           ".bashrc",     ".a",       "./.a",      "a/.b",   ".git/hooks/a",
          "a/.git/b",      "a\uff04b",    "a\uff1bb", ""})
      CHECK_THROWS_AS(with(bad + ending), SceneError);
    for (const char* other : {"GNUmakefile", "Makefile", "makefile", "thesis.tex", "a.sh", "a.svg2",
                              "a.csv.py", "a.state.", "a.CSV", "a/", ".", "conftest.py"})
      CHECK_THROWS_WITH(with(other), Catch::Contains("ends in " + ending));
    for (const char* other : {"a.csv", "a.pvd", "a.svg", "a.state"})
      if (other != "a" + ending) CHECK_THROWS_AS(with(other), SceneError);
    CHECK_THROWS_AS(with(std::string(5000, 'a') + ending), SceneError);
  }
}

TEST_CASE("names hold nothing that a shell or make obeys, in no width") {
  const auto named = [](const std::string& name) { return "name = \"" + name + "\"\n"; };
  const auto all_with = [&](const std::string& name) {
    return std::vector<std::string>{
        sphere(named(name)), sphere("material = \"" + name + "\"\n"),
        sphere(named("a") + "[[joint]]\n" + named(name) +
               "kind = \"ball\"\nbodies = [\"a\", \"world\"]\nat = [0, 0, 0]\n"),
        sphere(named("a") + "[[spring]]\n" + named(name) +
               "bodies = [\"a\", \"world\"]\nat = [[0, 0, 0], [0, 0, 1]]\nstiffness = 1\n")};
  };
  for (const std::string& text : all_with("K\u00f6rper 1.2: a=b+c-d@e [x] {y} #3 50% \u4e00_"))
    CHECK_NOTHROW(parse_scene(text, "names.toml"));
  for (const char* bad : {"$(shell touch PWNED)",
                          "`touch PWNED`",
                          "a$b",
                          "a;b",
                          "a & b",
                          "a|b",
                          "a<b",
                          "a>b",
                          "a(b",
                          "a)b",
                          "a\\\\b",
                          "a!=b",
                          "a*",
                          "a?",
                          "a'b",
                          "a;=1+1",
                          " =1+1",
                          "\u00a0=1+1",
                          "\u3000a",
                          "\uff1d1+1",
                          "\uff0b1",
                          "\uff0d1",
                          "\uff20a",
                          "\u22121",
                          "\ufe661+1",
                          "a\uff1b=1+1",
                          "\uff04(x)",
                          "a\uff08b\uff09",
                          "a\uff40b",
                          "\u200b=1",
                          "\ufeff=1",
                          "a\uff0cb"})
    for (const std::string& text : all_with(bad)) {
      INFO(text);
      CHECK_THROWS_WITH(parse_scene(text, "names.toml"), Catch::Contains("none of ; $"));
    }
  // A title stands in no table.
  CHECK_NOTHROW(
      parse_scene("[scene]\nname = \"Newton's cradle (five balls)\"\n" + sphere(""), "t"));
}

TEST_CASE("friction that impulses cannot be divided or multiplied by is refused") {
  const auto with = [](const std::string& key, const std::string& value) {
    return parse_scene(sphere("material = \"a\"\n[[pair]]\nbetween = [\"a\", \"a\"]\n" + key +
                              " = " + value + "\n"),
                       "friction.toml");
  };
  for (const char* key : {"friction", "rolling", "torsional"}) {
    for (const char* good : {"0", "1e-150", "1e-20", "0.3", "1e20", "1e150"})
      CHECK_NOTHROW(with(key, good));
    for (const char* bad : {"5e-324", "1e-310", "3e-308", "1e-200", "1e200", "1.7e308", "-1"})
      CHECK_THROWS_WITH(with(key, bad), Catch::Contains(key));
  }
}

TEST_CASE("as many threads as contact problems take") {
  CHECK_NOTHROW(parse_scene("[stepping]\nthreads = 256\n" + sphere(""), "threads.toml"));
  CHECK_THROWS_WITH(parse_scene("[stepping]\nthreads = 257\n" + sphere(""), "threads.toml"),
                    Catch::Contains("from 1 to 256"));
}

TEST_CASE("depth without end is refused before it is parsed, with its place") {
  const auto refused = [](const std::string& text) {
    INFO(text.substr(0, 60));
    CHECK_THROWS_WITH(parse_scene(text, "deep.toml"), Catch::Contains("inside each other"));
  };
  for (const int depth : {70, 20000, 1000000}) {
    refused("a" + repeated(".a", depth) + " = 1\n");
    refused("[a" + repeated(" . \"a\"", depth) + "]\n");
    refused("[[a" + repeated(".'='", depth) + "]]\n");
    refused("x = " + repeated("[", depth));
    refused("x = " + repeated("{a=", depth));
    refused("x = " + repeated("{a.b.c=", depth / 3));
    refused("# ''' \"\"\"\nx = 'it\"s'\ny = \"\\\"\"\nz = \"\"\"\"a\"\" [[ \\\"\"\"\"\n" +
            repeated("a.", depth));
  }
  CHECK_THROWS_WITH(parse_scene("[scene]\nend = 1\na" + repeated(".a", 99) + " = 1", "deep.toml"),
                    Catch::Contains("deep.toml:3:"));
  // This text only looks deep: numbers, texts, comments, long lists, many tables.
  CHECK_NOTHROW(
      parse_scene("[scene]\nname = '" + repeated(".[{", 99) + "' # " + repeated("a.", 99) + "\n" +
                      sphere("position = [1.5, # [[[\n 2.5,\n 3.5]\n") + repeated(sphere(""), 300),
                  "flat.toml"));
}

TEST_CASE("messages about a file hold nothing that a terminal obeys") {
  // Escape sequences of ASCII and of Unicode, and marks that write from right to left.
  for (const std::string bad :
       {"\\u001b]0;x\\u0007", "\\u009b31m", "\\u007f", "\\u202e", "\\u2066"})
    for (const std::string& text :
         {"\"" + bad + "\" = 1\n", "[scene]\n\"a" + bad + "\" = 1\n", "[\"" + bad + "\"]\n",
          sphere("name = \"" + bad + "\"\n"), "[[body]]\nshape = \"" + bad + "\"\n",
          sphere("material = \"" + bad + "\"\n"), "[scene]\nend = [\"" + bad + "\"]\n",
          "[scene]\nend = { \"" + bad + "\" = 1 }\n",
          sphere("[[expect]]\nquantity = \"" + bad + "\"\n"),
          sphere("[[pair]]\nbetween = [\"" + bad + "\", \"b\"]\n"),
          sphere("[[load]]\nbody = \"" + bad + "\"\n")}) {
      INFO(text);
      try {
        parse_scene(text, "terminal.toml");
        FAIL("it is taken");
      } catch (const SceneError& e) {
        const std::string said = e.what();
        for (const std::string part :
             {"\x1b", "\x07", "\x7f", "\xc2\x9b", "\xe2\x80\xae", "\xe2\x81\xa6"})
          CHECK(said.find(part) == std::string::npos);
        CHECK(said.find('?') != std::string::npos);
      }
    }
  CHECK(
      parse_scene(sphere("name = \"K\u00f6rper \u2192 \u4e00\"\n"), "names.toml").bodies[0].name ==
      "K\u00f6rper \u2192 \u4e00");
}

TEST_CASE("names that a spreadsheet would compute in a table are refused") {
  for (const std::string name : {"a,b", "a\\\"b", "a\\nb", "a\\tb", "a\\u0085b"}) {
    INFO(name);
    CHECK_THROWS_WITH(parse_scene(sphere("name = \"" + name + "\"\n"), "sheet.toml"),
                      Catch::Contains("no comma, quote or control character"));
  }
  for (const std::string name : {"=1+1", "+1", "-1", "@a", "=cmd|' /C calc'!A0"}) {
    INFO(name);
    CHECK_THROWS_WITH(parse_scene(sphere("name = \"" + name + "\"\n"), "sheet.toml"),
                      Catch::Contains("not begin with = + - @"));
  }
  CHECK(parse_scene(sphere("name = \"a=b+c-d@e\"\n"), "sheet.toml").bodies[0].name == "a=b+c-d@e");
}

TEST_CASE("wrong names and missing pairs in thousands cost no more than the file") {
  // Quadratic work over 32 000 lines is a thousand million comparisons of texts.
  const auto references = [](int n) {
    std::string text;
    for (int k = 0; k < n; ++k) {
      const std::string number = std::to_string(k);
      text += sphere("name = \"b" + number + "\"\n") + "[[load]]\nbody = \"c" + number +
              "\"\nforce = [1, 1, 1]\n";
    }
    CHECK_THROWS_WITH(parse_scene(text, "references.toml"), Catch::Contains("no such body"));
  };
  const auto materials = [](int n) {
    std::string text = "[stepping]\n";
    for (int k = 0; k < n; ++k) text += sphere("material = \"m" + std::to_string(k) + "\"\n");
    CHECK_THROWS_WITH(
        parse_scene(text + "[[pair]]\nbetween = [\"m1\", \"m2\"]\n", "materials.toml"),
        Catch::Contains("can touch"));
  };
  const auto fixed = [](int n) {
    std::string text = sphere("material = \"m\"\n");
    for (int k = 0; k < n; ++k) {
      const std::string number = std::to_string(k);
      text += "[[body]]\nshape = \"sphere\"\nradius = 1\nfixed = true\nmaterial = \"f" + number +
              "\"\n[[pair]]\nbetween = [\"m\", \"f" + number + "\"]\n";
    }
    CHECK(parse_scene(text, "fixed.toml").pairs.size() == static_cast<std::size_t>(n));
  };
  CHECK(growth(references, 4000) < kLinear);
  CHECK(growth(materials, 4000) < kLinear);
  CHECK(growth(fixed, 4000) < kLinear);
}

TEST_CASE("names in expectations by the thousand cost no more than the file") {
  const auto expectations = [](int n) {
    std::string text = "[scene]\ngravity = [0, 0, -1]\n" + sphere("name = \"a\"\n");
    for (int k = 0; k < n; ++k) {
      const std::string number = std::to_string(k);
      text += "[[spring]]\nname = \"s" + number +
              "\"\nbodies = [\"a\", \"world\"]\nat = [[0, 0, 0], [0, 0, 1]]\nstiffness = 1\n"
              "[[expect]]\nquantity = \"spring_force\"\nspring = \"s" +
              number + "\"\nat_most = 1\n";
    }
    CHECK(parse_scene(text, "expect.toml").expect.back().spring == n - 1);
    CHECK_THROWS_WITH(
        parse_scene(text + "[[expect]]\nquantity = \"spring_force\"\nspring = \"t\"\nat_most = 1\n",
                    "expect.toml"),
        Catch::Contains("no such spring"));
  };
  CHECK(growth(expectations, 4000) < kLinear);
}

TEST_CASE("long texts of a repetition count as what they are, and braces end where they begin") {
  const auto repeated = [](const std::string& name, int count) {
    return "[[body]]\nname = \"" + name +
           "\"\nshape = \"sphere\"\nradius = 1\nmass = 1\nrepeat = { count = " +
           std::to_string(count) + " }\n";
  };
  // Four hundred megabytes; with more of them there was no end of it.
  const std::size_t long_text = 100000;
  CHECK_THROWS_WITH(parse_scene(repeated(std::string(long_text, 'a'), 4000), "long.toml"),
                    Catch::Contains("numbers and texts"));
  CHECK_THROWS_WITH(
      parse_scene("[[body]]\n" + std::string(long_text, 'k') + " = 1\nrepeat = { count = 4000 }\n",
                  "long.toml"),
      Catch::Contains("numbers and texts"));
  // Two million openings before one end: each of them searched all that follows.
  CHECK_THROWS_WITH(parse_scene(repeated(std::string(2000000, '{') + "}", 1), "braces.toml"),
                    Catch::Contains("at most 1000 bytes"));
  CHECK(parse_scene(repeated("{{i}}{i+123456}{i+1234567}{}", 1), "braces.toml").bodies[0].name ==
        "{1}123457{i+1234567}{}");
}

TEST_CASE("names have at most a thousand bytes") {
  const auto named = [](std::size_t size) {
    return parse_scene(sphere("name = \"" + std::string(size, 'n') + "\"\n"), "long.toml");
  };
  CHECK(named(1000).bodies[0].name.size() == 1000);
  CHECK_THROWS_WITH(named(1001), Catch::Contains("at most 1000 bytes"));
}

TEST_CASE("a scene file has at most 256 MiB, from wherever it comes") {
  const std::string text((std::size_t{256} << 20) + 1, '\n');
  CHECK_THROWS_WITH(parse_scene(text, "large.toml"), Catch::Contains("at most 256 MiB"));
  CHECK_THROWS_WITH(read_scene("/dev/zero"), Catch::Contains("at most 256 MiB"));
}
