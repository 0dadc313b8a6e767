// Tether: a scene while it is read. SPDX-License-Identifier: BSD-3-Clause
#include "reader.hpp"

namespace tether::scene::files {

using Eigen::Vector3d;

int Reader::body(Fields& in, std::string_view key) const {
  if (!in.has(key)) {
    in.missing(key, "the name of a body");
    return 0;
  }
  const std::string name = in.name(key, "");
  const auto found = bodies.find(name);
  if (found != bodies.end()) return found->second;
  in.wrong(key, "no such body" + hint_of(name, scene.bodies));
  return 0;
}

std::vector<int> Reader::several_bodies(Fields& in, std::size_t least, std::size_t most,
                                        const char* allowed) const {
  const Value* value = in.find("bodies");
  if (value == nullptr) {
    in.missing("bodies", allowed);
    return {};
  }
  const auto wrong = [&](std::string why) {
    in.wrong("bodies", std::move(why));
    return std::vector<int>{};
  };
  if (value->kind() != Value::Kind::array || value->items().size() < least ||
      value->items().size() > most)
    return wrong(std::string("must be ") + allowed);
  std::vector<int> out;
  for (const Value& name : value->items()) {
    if (name.kind() != Value::Kind::text) return wrong(std::string("must be ") + allowed);
    const auto found = bodies.find(name.text());
    if (name.text() != "world" && found == bodies.end())
      return wrong(fmt::format("there is no body \"{}\"{}", name.text(),
                               hint_of(name.text(), scene.bodies)));
    out.push_back(name.text() == "world" ? -1 : found->second);
  }
  return out;
}

void Reader::two_bodies(Fields& in, int& first, int& second) const {
  const std::vector<int> both =
      several_bodies(in, 2, 2, "two names of bodies; \"world\" is the ground");
  if (both.empty()) return;
  first = both[0];
  second = both[1];
  if (first == second) in.wrong("bodies", "must be two different bodies");
}

std::string read_name(Fields& in, const std::string& kind) {
  const std::string name = in.name("name", in.path());
  if (in.has("name")) in.rename(fmt::format("{} \"{}\"", kind, name));
  return name;
}

void read_two_points(Fields& in, Vector3d& first, Vector3d& second) {
  if (!in.has("at")) in.missing("at", "the two points [[x, y, z], [x, y, z]], world, m");
  const std::vector<Vector3d> points = in.points("at", 2, 2);
  if (points.empty()) return;
  first = points[0];
  second = points[1];
}

}  // namespace tether::scene::files
