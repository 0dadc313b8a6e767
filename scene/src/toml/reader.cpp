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

void Reader::two_bodies(Fields& in, int& first, int& second) const {
  const Value* value = in.find("bodies");
  constexpr const char* kAllowed = "two names of bodies; \"world\" is the ground";
  if (value == nullptr) return in.missing("bodies", kAllowed);
  if (value->kind() != Value::Kind::array || value->items().size() != 2)
    return in.wrong("bodies", std::string("must be ") + kAllowed);
  int* const out[] = {&first, &second};
  for (std::size_t i = 0; i < 2; ++i) {
    const Value& name = value->items()[i];
    if (name.kind() != Value::Kind::text)
      return in.wrong("bodies", std::string("must be ") + kAllowed);
    if (name.text() == "world") continue;
    const auto found = bodies.find(name.text());
    if (found == bodies.end())
      return in.wrong("bodies", fmt::format("there is no body \"{}\"{}", name.text(),
                                            hint_of(name.text(), scene.bodies)));
    *out[i] = found->second;
  }
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
