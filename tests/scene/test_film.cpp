// Films of several processes: pieces that a .pvtp joins. SPDX-License-Identifier: BSD-3-Clause
#include <tinyxml2.h>

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>
#include <tether/scene/files.hpp>
#include <tether/scene/run.hpp>
#include <vector>

#include "run_files.hpp"
#include "support/catch.hpp"

using namespace tether::scene;
using tether::test::content;
using tether::test::folder;
namespace fs = std::filesystem;

namespace {

// Balls that lie on the floor, and a door on a hinge.
const char* const kScene = R"(
[scene]
name = "film"
end = 0.02
gravity = [0, 0, -9.81]
[stepping]
step = 0.01
[output]
every = 0.01
forces = true
[[pair]]
between = ["stone", "stone"]
friction = 0.5
[[body]]
name = "floor"
shape = "plane"
fixed = true
material = "stone"
[[body]]
name = "ball {i}"
repeat = { count = 5, step = [1, 0, 0] }
shape = "sphere"
radius = 0.1
mass = 1
position = [0, 0, 0.1]
velocity = [0.1, 0, 0]
material = "stone"
[[body]]
name = "door"
shape = "box"
size = [0.5, 0.02, 1]
mass = 2
position = [0.25, 5, 1]
[[joint]]
name = "hinge"
kind = "hinge"
bodies = ["door", "world"]
at = [0, 5, 1]
axis = [0, 0, 1]
)";

// Content of the XML of a file, without the bytes behind it.
struct Xml {
  tinyxml2::XMLDocument document;
  std::string text;
  std::size_t data = std::string::npos;

  explicit Xml(const fs::path& file) : text(content(file)) {
    INFO(file.string());
    const std::string mark = "<AppendedData encoding=\"raw\">\n_";
    std::string head = text;
    const std::size_t at = text.find(mark);
    if (at != std::string::npos) {
      data = at + mark.size();
      head = text.substr(0, at) + "</VTKFile>";
    }
    REQUIRE(document.Parse(head.data(), head.size()) == tinyxml2::XML_SUCCESS);
  }
  const tinyxml2::XMLElement& root() const { return *document.RootElement(); }
};

struct Frame {
  std::vector<std::string> names;  // of arrays of floats
  std::vector<std::vector<float>> floats;
  std::vector<std::int32_t> vertices, polygons, ends;
  std::size_t points = 0;

  bool operator==(const Frame& o) const {
    return names == o.names && floats == o.floats && vertices == o.vertices &&
           polygons == o.polygons && ends == o.ends && points == o.points;
  }
};

template <class T>
std::vector<T> array(const Xml& xml, const tinyxml2::XMLElement& entry) {
  const char* at = xml.text.data() + xml.data + entry.Int64Attribute("offset");
  std::uint64_t length = 0;
  std::memcpy(&length, at, sizeof length);
  std::vector<T> out(length / sizeof(T));
  if (length > 0) std::memcpy(out.data(), at + sizeof length, length);
  return out;
}

// Behind what the frame has.
void append_piece(const fs::path& file, Frame& frame) {
  const Xml xml(file);
  const tinyxml2::XMLElement& piece =
      *xml.root().FirstChildElement("PolyData")->FirstChildElement("Piece");
  std::size_t k = 0;
  const auto take = [&](const tinyxml2::XMLElement* of) {
    for (const auto* e = of->FirstChildElement(); e != nullptr; e = e->NextSiblingElement(), ++k) {
      if (frame.names.size() == k) {
        frame.names.emplace_back(e->Attribute("Name"));
        frame.floats.emplace_back();
      }
      CHECK(frame.names[k] == e->Attribute("Name"));
      const std::vector<float> values = array<float>(xml, *e);
      frame.floats[k].insert(frame.floats[k].end(), values.begin(), values.end());
    }
  };
  take(piece.FirstChildElement("PointData"));
  take(piece.FirstChildElement("Points"));
  const auto shifted = [&](const char* of, std::size_t which, std::size_t by,
                           std::vector<std::int32_t>& to) {
    const auto* entry = piece.FirstChildElement(of)->FirstChildElement();
    if (which == 1) entry = entry->NextSiblingElement();
    for (const std::int32_t i : array<std::int32_t>(xml, *entry))
      to.push_back(i + static_cast<std::int32_t>(by));
  };
  const std::size_t corners = frame.polygons.size();
  shifted("Verts", 0, frame.points, frame.vertices);
  shifted("Polys", 0, frame.points, frame.polygons);
  shifted("Polys", 1, corners, frame.ends);
  frame.points += static_cast<std::size_t>(piece.Int64Attribute("NumberOfPoints"));
}

// Each data set of a film, its pieces in their order.
std::vector<Frame> frames_of(const fs::path& film, std::size_t* pieces) {
  const Xml list(film);
  std::vector<Frame> frames;
  for (const auto* e = list.root().FirstChildElement()->FirstChildElement(); e != nullptr;
       e = e->NextSiblingElement()) {
    const fs::path file = film.parent_path() / e->Attribute("file");
    frames.emplace_back();
    if (file.extension() == ".vtp") {
      append_piece(file, frames.back());
      continue;
    }
    REQUIRE(file.extension() == ".pvtp");
    const Xml joined(file);
    const auto* whole = joined.root().FirstChildElement("PPolyData");
    for (const auto* piece = whole->FirstChildElement("Piece"); piece != nullptr;
         piece = piece->NextSiblingElement("Piece"), ++*pieces)
      append_piece(file.parent_path() / piece->Attribute("Source"), frames.back());
    std::size_t k = 0;  // what the joining file declares is what the pieces have
    for (const char* of : {"PPointData", "PPoints"})
      for (const auto* a = whole->FirstChildElement(of)->FirstChildElement(); a != nullptr;
           a = a->NextSiblingElement(), ++k)
        CHECK(frames.back().names[k] == a->Attribute("Name"));
    CHECK(k == frames.back().names.size());
  }
  return frames;
}

}  // namespace

TEST_CASE("a film of several processes is that of one, in pieces") {
  Scene scene = parse_scene(kScene, "film.toml");
  std::size_t pieces = 0;
  const fs::path one = folder("film_of_one");
  scene.output["vtk"] = (one / "f.pvd").string();
  CHECK(run(scene).written == std::vector<std::string>{(one / "f.pvd").string()});
  const std::vector<Frame> whole = frames_of(one / "f.pvd", &pieces);
  // Three records: bodies, the joint, and contacts of the last two at least.
  REQUIRE(whole.size() >= 8);
  CHECK(pieces == 0);
  for (const int ranks : {2, 3, 40}) {
    CAPTURE(ranks);
    const fs::path shared = folder("film_of_some");
    scene.output["vtk"] = (shared / "f.pvd").string();
    // The first one last: it names what the others have written.
    int met = 0;
    for (int rank = ranks - 1; rank >= 0; --rank) {
      RunOptions options;
      options.among = {rank, ranks, [&met] { ++met; }};
      CHECK(run(scene, options).written.empty() == (rank != 0));
      CHECK(fs::exists(shared / "f.pvd") == (rank == 0));
    }
    CHECK(met == 3 * ranks);
    pieces = 0;
    CHECK(frames_of(shared / "f.pvd", &pieces) == whole);
    CHECK(pieces > whole.size());
  }
}
