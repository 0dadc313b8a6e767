// Tether: what no single field of a scene file shows. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <tether/scene/plan.hpp>
#include <tether/scene/run.hpp>

#include "read.hpp"

namespace tether::scene::files {

namespace {

std::string called(const Body& body) { return fmt::format("body \"{}\"", body.name); }

void check_bodies(const Scene& scene, Report& report) {
  if (scene.bodies.empty())
    report.add({scene.file, 1, 1}, "[[body]]", "", "is missing; a scene has at least one body");
  std::set<std::string> names;
  for (const Body& body : scene.bodies) {
    if (body.name.empty() || body.name == "world")
      report.add(body.place, called(body) + ": name", "",
                 "must be neither empty nor \"world\", which is the ground");
    if (!names.insert(body.name).second)
      report.add(body.place, called(body) + ": name", "", "another body has it already");
    const bool plane = std::any_of(body.shapes.begin(), body.shapes.end(),
                                   [](const Shape& s) { return s.kind == ShapeKind::plane; });
    if (plane && !body.fixed)
      report.add(body.place, called(body) + ": fixed", "",
                 "must be true: a plane is infinite and cannot move");
    if (body.fixed && (!body.velocity.isZero(0) || !body.angular_velocity.isZero(0)))
      report.add(body.place, called(body) + ": velocity", "", "must be zero: the body is fixed");
    if (body.fixed && body.drag)
      report.add(body.place, called(body) + ": drag", "", "has no meaning: the body is fixed");
    if (!body.material.empty() && body.shapes.empty())
      report.add(body.place, called(body) + ": material", "",
                 "needs a shape: without one the body touches nothing");
  }
}

using Materials = std::pair<std::string, std::string>;

Materials ordered(const std::string& a, const std::string& b) { return std::minmax(a, b); }

void check_pairs(const Scene& scene, Report& report) {
  if (scene.pairs.empty()) return;  // nothing touches
  std::set<Materials> named;
  for (const Pair& pair : scene.pairs)
    if (!named.insert(ordered(pair.first, pair.second)).second)
      report.add(pair.place, "pair: between",
                 fmt::format("[\"{}\", \"{}\"]", pair.first, pair.second),
                 "another [[pair]] has the same materials");

  // How many bodies have a material, and how many of these move.
  struct Bodies {
    int all = 0, moving = 0;
    Place place;
  };
  std::map<std::string, Bodies> materials;
  for (const Body& body : scene.bodies) {
    if (body.material.empty()) continue;
    Bodies& of = materials[body.material];
    if (of.all == 0) of.place = body.place;
    ++of.all;
    of.moving += !body.fixed;
  }
  // One of the two must move. Every pair here is named in the file or is a problem, so that the
  // work ends with the longer of the file and the report.
  for (const auto& [first, a] : materials) {
    if (a.moving == 0) continue;
    for (const auto& [second, b] : materials) {
      if (report.full()) return;
      if ((b.moving > 0 && second < first) || (first == second && a.all < 2)) continue;
      const auto [low, high] = ordered(first, second);
      if (named.count({low, high}) > 0) continue;
      report.add(
          std::max(a.place.line, b.place.line) == a.place.line ? a.place : b.place, "material",
          fmt::format("\"{}\"", high),
          fmt::format("bodies of \"{0}\" and \"{1}\" can touch, but no [[pair]] says between "
                      "= [\"{0}\", \"{1}\"] (nothing is mixed from single materials)",
                      low, high));
    }
  }
}

bool moves(const Scene& scene, int body) {
  return body >= 0 && !scene.bodies[static_cast<std::size_t>(body)].fixed;
}

template <class Connection>
void check_connections(const Scene& scene, const std::vector<Connection>& all, const char* kind,
                       Report& report) {
  std::set<std::string> names;
  for (const Connection& each : all) {
    const std::string path = fmt::format("{} \"{}\"", kind, each.name);
    if (!names.insert(each.name).second)
      report.add(each.place, path + ": name", "", "another one has it already");
    if (!moves(scene, each.first) && !moves(scene, each.second))
      report.add(each.place, path + ": bodies", "", "one of them must be able to move");
  }
}

void check_invariants(const Scene& scene, Report& report) {
  std::set<InvariantKind> kinds;
  for (const Invariant& each : scene.invariants)
    if (!kinds.insert(each.kind).second)
      report.add(each.place, "invariant: kind", fmt::format("\"{}\"", word(each.kind)),
                 "is named twice");
}

void check_times(const Scene& scene, Report& report) {
  if (scene.stepping && !(scene.end / scene.stepping->step <= kMostSteps))
    report.add({scene.file, 1, 1}, "stepping: step", fmt::format("{}", scene.stepping->step),
               fmt::format("end / step must be at most {:g}", kMostSteps));
  for (const double every : {scene.output.every, scene.output.checkpoint})
    if (every > 0 && !(scene.end / every <= kMostRecords))
      report.add({scene.file, 1, 1}, "output: every, checkpoint", fmt::format("{}", every),
                 fmt::format("end / it must be at most {:g}", kMostRecords));
  for (const Expect& each : scene.expect)
    if (each.time > scene.end)
      report.add(each.place, "expect: time", fmt::format("{}", each.time),
                 fmt::format("must be from 0 to the end, {} s", scene.end));
}

}  // namespace

void check(const Scene& scene, Report& report) {
  check_bodies(scene, report);
  check_pairs(scene, report);
  check_connections(scene, scene.joints, "joint", report);
  check_connections(scene, scene.springs, "spring", report);
  for (const Load& load : scene.loads)
    if (!moves(scene, load.body))
      report.add(load.place, "load: body",
                 fmt::format("\"{}\"", scene.bodies[static_cast<std::size_t>(load.body)].name),
                 "must be able to move");
  check_invariants(scene, report);
  check_times(scene, report);
}

}  // namespace tether::scene::files
