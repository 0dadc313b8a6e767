// Tether: what no single field of a scene file shows. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <tether/scene/run.hpp>

#include "effects/list.hpp"
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
    const bool mesh = std::any_of(body.shapes.begin(), body.shapes.end(),
                                  [](const Shape& s) { return s.kind == ShapeKind::mesh; });
    if (mesh && !body.fixed)
      report.add(body.place, called(body) + ": fixed", "",
                 "must be true: a mesh is a surface without an inside, for what stands still");
    if (body.fixed && (!body.velocity.isZero(0) || !body.angular_velocity.isZero(0)))
      report.add(body.place, called(body) + ": velocity", "", "must be zero: the body is fixed");
    for (const effects::Effect* each : effects::all()) each->check_body(body, report);
    if (!body.material.empty() && body.shapes.empty())
      report.add(body.place, called(body) + ": material", "",
                 "needs a shape: without one the body touches nothing");
  }
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
  for (const effects::Effect* each : effects::all()) each->check(scene, report);
  check_times(scene, report);
}

}  // namespace tether::scene::files
