// A scene file in the subset that every engine can state, and one timed run of it.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <toml++/toml.h>
#include <vector>

namespace peers {

using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr int kSamples = 10;  ///< equal times at which positions are printed

struct Shape {
  std::string kind;  ///< sphere, box or plane
  double radius = 0;
  Vector3d size = Vector3d::Zero(), at = Vector3d::Zero(), normal = Vector3d::UnitZ();
};
/// As [[body]] of a scene file: SI, world axes, inertia about the centre in body axes.
struct Body {
  std::string name, material;
  bool fixed = false;
  double mass = 0;
  Vector3d inertia = Vector3d::Zero(), x = Vector3d::Zero(), v = Vector3d::Zero(),
           w = Vector3d::Zero();
  Quaterniond q = Quaterniond::Identity();
  std::vector<Shape> shapes;
  int joint = -1;  ///< the first joint whose first body it is: that of a tree; -1: free
};
struct Joint {
  std::string kind;             ///< hinge, ball or slider
  int first = -1, second = -1;  ///< -1: world
  Vector3d at = Vector3d::Zero(), axis = Vector3d::UnitZ();
};
struct Law {
  double friction = 0, restitution = 0;
};
struct Pose {
  Vector3d x;
  Quaterniond q;
};

struct Scene {
  std::string file;
  double end = 1;  ///< s
  Vector3d gravity = Vector3d::Zero();
  std::vector<Body> bodies;
  std::vector<Joint> joints;
  std::map<std::pair<std::string, std::string>, Law> laws;

  int find(const std::string& name) const {
    for (std::size_t i = 0; i < bodies.size(); ++i)
      if (bodies[i].name == name) return static_cast<int>(i);
    if (name == "world") return -1;
    throw std::invalid_argument(file + ": no body is called " + name);
  }
  /// Null: they do not touch.
  const Law* law(int a, int b) const {
    const auto found = laws.find(std::minmax(bodies[a].material, bodies[b].material));
    return found == laws.end() ? nullptr : &found->second;
  }
  bool has_contacts() const { return !laws.empty(); }
};

inline double number(const toml::table& t, const char* key, double otherwise) {
  return t[key].value_or(otherwise);
}
inline std::string text(const toml::table& t, const char* key) {
  return t[key].value_or(std::string());
}
inline Vector3d vector(const toml::table& t, const char* key, const Vector3d& otherwise) {
  const toml::array* a = t[key].as_array();
  if (!a) return otherwise;
  return {(*a)[0].value_or(0.), (*a)[1].value_or(0.), (*a)[2].value_or(0.)};
}

inline Shape read_shape(const toml::table& t) {
  return {text(t, "shape"), number(t, "radius", 0), vector(t, "size", Vector3d::Zero()),
          t.contains("mass") || t.contains("fixed") ? Vector3d::Zero()
                                                    : vector(t, "position", Vector3d::Zero()),
          vector(t, "normal", Vector3d::UnitZ())};
}

inline Body read_body(const toml::table& t) {
  Body b;
  b.name = text(t, "name"), b.material = text(t, "material");
  b.fixed = t["fixed"].value_or(false);
  b.mass = number(t, "mass", 0);
  const Vector3d zero = Vector3d::Zero();
  b.inertia = vector(t, "inertia", zero), b.x = vector(t, "position", zero);
  b.v = vector(t, "velocity", zero), b.w = vector(t, "angular_velocity", zero);
  if (const toml::table* turn = t["orientation"].as_table())
    b.q = Eigen::AngleAxisd(number(*turn, "deg", 0) * M_PI / 180,
                            vector(*turn, "axis", zero).normalized());
  if (t.contains("shape")) b.shapes.push_back(read_shape(t));
  if (const toml::array* several = t["shapes"].as_array())
    for (const toml::node& each : *several) b.shapes.push_back(read_shape(*each.as_table()));
  return b;
}

inline Scene read(const std::string& file) {
  const toml::table t = toml::parse_file(file);
  Scene s;
  s.file = file;
  s.end = number(*t["scene"].as_table(), "end", 1);
  s.gravity = vector(*t["scene"].as_table(), "gravity", Vector3d::Zero());
  const auto each = [&t](const char* key, auto f) {
    if (const toml::array* a = t[key].as_array())
      for (const toml::node& n : *a) f(*n.as_table());
  };
  each("body", [&](const toml::table& b) { s.bodies.push_back(read_body(b)); });
  each("pair", [&](const toml::table& p) {
    const std::string a = p["between"][0].value_or(""), b = p["between"][1].value_or("");
    if (p["touch"].value_or(true))
      s.laws[std::minmax(a, b)] = {number(p, "friction", 0), number(p, "restitution", 0)};
  });
  each("joint", [&](const toml::table& j) {
    s.joints.push_back({text(j, "kind"), s.find(j["bodies"][0].value_or("")),
                        s.find(j["bodies"][1].value_or("")), vector(j, "at", Vector3d::Zero()),
                        vector(j, "axis", Vector3d::UnitZ())});
    int& first = s.bodies[s.joints.back().first].joint;
    if (first < 0) first = static_cast<int>(s.joints.size()) - 1;
  });
  return s;
}

inline double processor_time() {
  timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// PROGRAM SCENE SETTING VALUE REPEATS [BODY X Y Z]...: prints the least processor time of the
/// repeats, s, without what sets the engine up, and the points (body axes) at each sample.
/// Engine(scene, setting, value) has advance(t), pose(i).
template <class Engine>
int main(int argc, char** argv) try {
  if (argc < 5 || argc % 4 != 1)
    throw std::invalid_argument("SCENE SETTING VALUE REPEATS [BODY X Y Z]...");
  const Scene scene = read(argv[1]);
  double least = std::numeric_limits<double>::infinity();
  std::vector<Vector3d> points;
  for (int repeat = std::atoi(argv[4]); repeat > 0; --repeat) {
    points.clear();
    Engine engine(scene, argv[2], std::atof(argv[3]));
    double time = 0;
    for (int k = 1; k <= kSamples; ++k) {
      const double start = processor_time();
      engine.advance(scene.end * k / kSamples);
      time += processor_time() - start;
      for (int i = 5; i < argc; i += 4) {
        const Pose pose = engine.pose(scene.find(argv[i]));
        points.emplace_back(pose.x + pose.q * Vector3d(std::atof(argv[i + 1]),
                                                       std::atof(argv[i + 2]),
                                                       std::atof(argv[i + 3])));
      }
    }
    least = std::min(least, time);
  }
  std::printf("%.9g", least);
  for (const Vector3d& p : points) std::printf(" %.17g %.17g %.17g", p.x(), p.y(), p.z());
  std::printf("\n");
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}

/// Calls step(h) until the sample's end: `value` steps of one length to each sample.
template <class Step>
void advance_in_steps(const Scene& scene, double value, const Step& step) {
  const int n = static_cast<int>(value);
  for (int i = 0; i < n; ++i) step(scene.end / (kSamples * n));
}

}  // namespace peers
