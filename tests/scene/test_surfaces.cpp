// Meshes and height fields of scene files: what is read, and what is refused.
// SPDX-License-Identifier: BSD-3-Clause
#include <sys/stat.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>

#include "run_files.hpp"
#include "support/catch.hpp"

namespace {

namespace fs = std::filesystem;
namespace ts = tether::scene;

// A folder of its own with a scene's files.
struct Folder {
  fs::path path = tether::test::folder("surfaces");
  Folder() { fs::create_directories(path / "scenes"); }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(path / "scenes" / name, std::ios::binary) << text;
  }
  // A scene of one fixed body with these fields.
  ts::Scene scene(const std::string& fields, const std::string& head = "") const {
    return ts::parse_scene(head + "[[body]]\nname = \"floor\"\nfixed = true\n" + fields,
                           (path / "scenes" / "scene.toml").string());
  }
  std::string refusal(const std::string& fields) const {
    try {
      scene(fields);
    } catch (const ts::SceneError& e) {
      return e.what();
    }
    return "read";
  }
};

std::string mesh_file(const std::string& name) {
  return "shape = \"mesh\"\nfile = \"" + name + "\"\n";
}

std::string bytes_of(const std::vector<std::array<float, 9>>& triangles) {
  std::string out(80, 's');
  const auto add = [&](const void* from, std::size_t size) {
    out.append(static_cast<const char*>(from), size);
  };
  const auto count = static_cast<std::uint32_t>(triangles.size());
  add(&count, 4);
  for (const auto& t : triangles) {
    out.append(12, '\0');
    add(t.data(), sizeof t);
    out.append(2, '\0');
  }
  return out;
}

using Catch::Matchers::Contains;

}  // namespace

TEST_CASE("surfaces: points and triangles of every kind of file", "[scene]") {
  const Folder folder;
  folder.write("a.obj",
               "# a square and a triangle\nmtllib x.mtl\nv 0 0 0\nv 1 0 0 1.0\r\nv +1 1 0.5 # end\n"
               "v 0 1e0 0\nvn 0 0 1\nf 1/1/1 2//1 3 4\nv 2 0 0\nf -1 -3 -4\n");
  const ts::Shape a = folder.scene(mesh_file("a.obj") + "scale = 2").bodies[0].shapes[0];
  CHECK(a.kind == ts::ShapeKind::mesh);
  REQUIRE(a.points.size() == 5);
  CHECK(a.points[2] == Eigen::Vector3d(2, 2, 1));
  CHECK(a.triangles == std::vector<std::array<int, 3>>{{0, 1, 2}, {0, 2, 3}, {4, 2, 1}});

  folder.write("b.stl", bytes_of({{0, 0, 0, 1, 0, 0, 1, 1, 0}, {0, 0, 0, 1, 1, 0, 0, 1, 0.5F}}));
  folder.write(
      "c.stl",
      "solid two\n facet normal 0 0 1\n outer loop\n vertex 0 0 0\n vertex 1 0 0\n"
      " vertex 1 1 0\n endloop\n endfacet\n facet normal 0 0 1\n outer loop\n vertex 0 0 0\n"
      " vertex 1 1 0\n vertex 0 1 0.5\n endloop\n endfacet\nendsolid two\n");
  for (const char* name : {"b.stl", "c.stl"}) {
    const ts::Shape b = folder.scene(mesh_file(name)).bodies[0].shapes[0];
    CHECK(b.points == std::vector<Eigen::Vector3d>{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0.5}});
    CHECK(b.triangles == std::vector<std::array<int, 3>>{{0, 1, 2}, {0, 2, 3}});
  }

  folder.write("h.txt", "# rows\n0, 1 2\n\n3;4\t5\r\n");
  const std::string spacing = "shape = \"height_field\"\nspacing = [0.5, 2]\n";
  const ts::Shape by_file = folder.scene(spacing + "file = \"h.txt\"").bodies[0].shapes[0];
  const ts::Shape by_hand =
      folder.scene(spacing + "heights = [[0, 1, 2], [3, 4, 5]]").bodies[0].shapes[0];
  CHECK(by_file.points == by_hand.points);
  CHECK(by_file.points[4] == Eigen::Vector3d(0.5, 2, 4));
  CHECK(by_file.triangles == by_hand.triangles);
  CHECK(by_file.triangles.size() == 4);
}

TEST_CASE("surfaces: a scene written out holds them and is the same again", "[scene]") {
  const Folder folder;
  folder.write("a.obj", "v 0 0 0\nv 1 0.1 0\nv 0.3 1 -0.0\nf 1 2 3\n");
  const ts::Scene scene = folder.scene(
      "shapes = [{ shape = \"mesh\", file = \"a.obj\", position = [0, 0, 1] }, { shape = "
      "\"height_field\", heights = [[0, 0.1], [0.2, 0.3]], spacing = [0.1, 0.2], scale = 3 }]");
  const std::string text = ts::write_scene(scene);
  const ts::Scene again = ts::parse_scene(text, "again");
  REQUIRE(again.bodies[0].shapes.size() == 2);
  for (std::size_t k = 0; k < 2; ++k) {
    CHECK(again.bodies[0].shapes[k].points == scene.bodies[0].shapes[k].points);
    CHECK(again.bodies[0].shapes[k].triangles == scene.bodies[0].shapes[k].triangles);
  }
  CHECK(ts::write_scene(again) == text);
}

TEST_CASE("surfaces: files are those beside the scene, and of a size", "[scene]") {
  const Folder folder;
  folder.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  std::ofstream(folder.path / "outside.obj") << "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  fs::create_symlink(folder.path / "outside.obj", folder.path / "scenes" / "link.obj");
  fs::create_directories(folder.path / "scenes" / "folder.obj");
  CHECK(folder.refusal(mesh_file("a.obj")) == "read");
  CHECK_THAT(folder.refusal(mesh_file("../outside.obj")), Contains("folder of the scene"));
  CHECK_THAT(folder.refusal(mesh_file((folder.path / "outside.obj").string())),
             Contains("folder of the scene"));
  CHECK_THAT(folder.refusal(mesh_file("link.obj")), Contains("folder of the scene"));
  CHECK_THAT(folder.refusal(mesh_file("folder.obj")), Contains("no such file"));
  // These files never end, or never begin.
  REQUIRE(mkfifo((folder.path / "scenes" / "pipe.obj").c_str(), 0600) == 0);
  CHECK_THAT(folder.refusal(mesh_file("pipe.obj")), Contains("no such file"));
  fs::create_symlink("/dev/zero", folder.path / "scenes" / "zero.obj");
  CHECK_THAT(folder.refusal(mesh_file("zero.obj")),
             Contains("folder of the scene") || Contains("no such file"));
  CHECK_THAT(folder.refusal(mesh_file("none.obj")), Contains("no such file"));
  CHECK_THAT(folder.refusal(mesh_file("a.obj|x")), Contains("without |"));
  folder.write("a.ply", "ply");
  CHECK_THAT(folder.refusal(mesh_file("a.ply")), Contains(".obj, .stl or .msh"));
  folder.write("large.obj", std::string((64u << 20) + 1, '\n'));
  CHECK_THAT(folder.refusal(mesh_file("large.obj")), Contains("64 MiB"));
}

TEST_CASE("surfaces: a file that many bodies name is read within a bound for all of them",
          "[scene]") {
  const Folder folder;
  const auto repeated = [&](const std::string& fields, int count) {
    return folder.refusal(fields + "\nrepeat = { count = " + std::to_string(count) + " }");
  };
  folder.write("long.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n#" + std::string(8u << 20, '.'));
  CHECK(repeated(mesh_file("long.obj"), 10) == "read");
  CHECK_THAT(repeated(mesh_file("long.obj"), 100000), Contains("256 MiB of surfaces"));
  std::string rows;
  for (int k = 0; k < 300; ++k) {
    for (int l = 0; l < 300; ++l) rows += "1 ";
    rows += '\n';
  }
  folder.write("h.txt", rows);
  const std::string field = "shape = \"height_field\"\nspacing = [1, 1]\nfile = \"h.txt\"";
  CHECK(repeated(field, 2) == "read");
  CHECK_THAT(repeated(field, 20), Contains("at most 2000000 triangles"));
}

TEST_CASE("surfaces: what is wrong with them is said by line", "[scene]") {
  const Folder folder;
  const auto obj = [&](const std::string& text) {
    folder.write("a.obj", text);
    return folder.refusal(mesh_file("a.obj"));
  };
  const std::string three = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  CHECK_THAT(obj(""), Contains("no triangles"));
  CHECK_THAT(obj(three), Contains("no triangles"));
  CHECK_THAT(obj(three + "f 1 2\n"), Contains("line 4: a face has three"));
  CHECK_THAT(obj(three + "f 1 2 4\n"), Contains("line 4: \"4\" is no point"));
  CHECK_THAT(obj(three + "f 1 2 0\n"), Contains("line 4: \"0\" is no point"));
  CHECK_THAT(obj(three + "f 1 2 -4\n"), Contains("\"-4\" is no point"));
  CHECK_THAT(obj(three + "f 1 2 99999999999999999999\n"), Contains("is no point"));
  CHECK_THAT(obj("v 0 0 nan\n"), Contains("line 1: \"nan\" is no finite number"));
  CHECK_THAT(obj("v 0 0 1e999\n"), Contains("no finite number"));
  CHECK_THAT(obj("v 0 0\n"), Contains("line 1"));
  CHECK_THAT(obj("v 0 0 1e101\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), Contains("1e100"));
  CHECK_THAT(obj("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n"), Contains("has an area"));
  std::string cloud;
  for (int k = 0; k < 200001; ++k) cloud += "v 0 0 0\n";
  CHECK_THAT(obj(cloud), Contains("points"));
  std::string fan = three + "f";
  for (int k = 0; k < 200003; ++k) fan += " 1";
  CHECK_THAT(obj(fan + "\n"), Contains("more than 200000 triangles"));

  const auto stl = [&](const std::string& text) {
    folder.write("a.stl", text);
    return folder.refusal(mesh_file("a.stl"));
  };
  CHECK_THAT(stl("nothing"), Contains("is no STL"));
  CHECK_THAT(stl(bytes_of({{0, 0, 0, 1, 0, 0, 1, 1, 0}}).substr(0, 130)), Contains("is no STL"));
  CHECK_THAT(stl(bytes_of({})), Contains("no triangles"));
  CHECK_THAT(stl(bytes_of({{0, 0, std::nanf(""), 1, 0, 0, 1, 1, 0}})),
             Contains("triangle 1: a number is not finite"));
  CHECK_THAT(stl("solid a\nvertex 0 0 0\nendfacet\n"), Contains("line 3: a facet"));
  CHECK_THAT(stl("solid a\nvertex 0 0 x\n"), Contains("line 2"));

  const std::string field = "shape = \"height_field\"\nspacing = [1, 1]\n";
  CHECK_THAT(folder.refusal(field), Contains("heights"));
  CHECK_THAT(folder.refusal(field + "heights = [[0, 1]]"), Contains("2 x 2"));
  CHECK_THAT(folder.refusal(field + "heights = [[0, 1], [0]]"), Contains("one length"));
  CHECK_THAT(folder.refusal(field + "heights = [[0, 1], [0, nan]]"), Contains("numbers"));
  CHECK_THAT(folder.refusal("shape = \"height_field\"\nheights = [[0, 1], [1, 2]]"),
             Contains("spacing"));
  folder.write("h.txt", "1 2\n3 4 5\n");
  CHECK_THAT(folder.refusal(field + "file = \"h.txt\""), Contains("line 2: has 3 heights"));
  CHECK_THAT(folder.refusal(field + "file = \"h.txt\"\nheights = [[0, 1], [1, 2]]"),
             Contains("not both"));
  const std::string mesh = "shape = \"mesh\"\npoints = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\n";
  CHECK_THAT(folder.refusal(mesh), Contains("triangles"));
  CHECK_THAT(folder.refusal(mesh + "triangles = [[0, 1, 3]]"), Contains("from 0"));
  CHECK_THAT(folder.refusal(mesh + "triangles = [[0, 1]]"), Contains("from 0"));
  CHECK_THAT(folder.refusal(mesh + "triangles = [[0, 1, 1.5]]"), Contains("from 0"));
  CHECK_THAT(folder.refusal("shape = \"mash\""), Contains("did you mean \"mesh\""));
}

TEST_CASE("surfaces: they stand still, in steps", "[scene]") {
  const std::string ball =
      "[[body]]\nname = \"ball\"\nshape = \"sphere\"\nradius = 0.1\nmass = 1\nmaterial = \"a\"\n"
      "position = [0.2, 0.2, 1]\n[[pair]]\nbetween = [\"a\", \"b\"]\n"
      "[[pair]]\nbetween = [\"a\", \"a\"]\ntouch = false\n";
  const std::string mesh =
      "[[body]]\nshape = \"mesh\"\npoints = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\n"
      "triangles = [[0, 1, 2]]\nmaterial = \"b\"\n";
  const ts::Scene scene = ts::parse_scene(ball + mesh + "fixed = true\n", "s");
  const ts::Plan plan = ts::make_plan(scene);
  CHECK(plan.engine == ts::EngineKind::stepping);
  bool told = false;
  for (const ts::Effect& each : plan.effects)
    told = told || each.detail.find("1 triangle") != std::string::npos;
  CHECK(told);
  try {
    ts::parse_scene(ball + mesh + "mass = 1\ninertia = [1, 1, 1]\n", "s");
    FAIL("an open mesh moves");
  } catch (const ts::SceneError& e) {
    CHECK_THAT(e.what(), Contains("the surface of a body that moves must be closed"));
  }
  ts::Scene events = scene;
  events.event.emplace();
  CHECK_THROWS_WITH(ts::make_engine(events),
                    Contains("a shape = \"mesh\" touches: use [stepping]"));
}
