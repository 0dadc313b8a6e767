// Tether: reads scene files. SPDX-License-Identifier: BSD-3-Clause
#include "read.hpp"

#include <fstream>

#include "effects/list.hpp"
#include "options.hpp"
#include "record/formats.hpp"
#include "toml/document.hpp"
#include "toml/reader.hpp"

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
    const bool plane =
        any_of(body.shapes, [](const Shape& s) { return s.kind == ShapeKind::plane; });
    if (plane && !body.fixed)
      report.add(body.place, called(body) + ": fixed", "",
                 "must be true: a plane is infinite and cannot move");
    const bool mesh = any_of(body.shapes, [](const Shape& s) { return s.kind == ShapeKind::mesh; });
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

void read_scene_table(Fields& root, Reader& r) {
  Fields in = r.fields(root.table("scene"), "scene");
  r.scene.name = in.text("name", "");
  r.scene.end = in.number("end", r.scene.end, kPositive, "s");
  for (const effects::Effect* each : effects::all()) each->read_scene(in, r.scene);
  r.scene.engine = in.word("engine", r.scene.engine);
  r.scene.simultaneous_impacts = in.word("simultaneous_impacts", r.scene.simultaneous_impacts);
  in.finish();
}

/// The table, where it is there; `check(in, options)` says what no single field shows.
template <class Options, class Check>
void read_options(Fields& root, Reader& r, const char* key, std::optional<Options>& to,
                  const Check& check) {
  const Value* table = root.table(key);
  if (table == nullptr) return;
  Fields in = r.fields(table, key);
  each_field(to.emplace(), ReadField{in});
  check(in, *to);
  in.finish();
}

void check_stepping(Fields& in, const Scene& scene, const SteppingOptions& o) {
  if (scene.simultaneous_impacts == contact::SimultaneousImpacts::in_turn &&
      (o.accuracy > 0 || !o.cut_at_impacts))
    in.wrong(o.accuracy > 0 ? "accuracy" : "cut_at_impacts",
             "simultaneous_impacts = \"in_turn\" needs steps that are cut at impacts, without an "
             "accuracy");
  if (!(o.sleep > 0)) return;
  if (o.accuracy > 0) in.wrong("sleep", "goes with fixed steps: leave out accuracy, or sleep");
  if (!(scene.gravity && scene.gravity->norm() > 0))
    in.wrong("sleep", "is a part of sqrt(gravity * size), and the scene has no gravity");
  if (any_of(scene.pairs, [](const Pair& pair) { return pair.rolling > 0 || pair.torsional > 0; }))
    in.wrong("sleep", "does not go with rolling and torsional friction of pairs");
}

void read_engine(Fields& root, Reader& r) {
  const auto nothing = [](Fields&, const auto&) {};
  Scene& scene = r.scene;
  read_options(root, r, "smooth", scene.smooth, nothing);
  read_options(root, r, "stepping", scene.stepping,
               [&](Fields& in, const SteppingOptions& o) { check_stepping(in, scene, o); });
  if (scene.smooth && scene.stepping)
    root.wrong("stepping", "a scene has [smooth] or [stepping], not both");
  read_options(root, r, "event", scene.event, nothing);
  if (scene.event && (scene.smooth || (scene.stepping && !goes_on_in_steps(scene))))
    root.wrong("event",
               "a scene has one of [smooth], [stepping] and [event]; [stepping] beside [event] is "
               "for otherwise = \"stepping\"");
}

void read_output(Fields& root, Reader& r) {
  Fields in = r.fields(root.table("output"), "output");
  Output& o = r.scene.output;
  for (const formats::Format* each : formats::all())
    o[each->name] = in.output_name(each->name, each->extension);
  o.every = in.number("every", o.every, kNotNegative, "s; 0: end / 1000");
  o.checkpoint = in.number("checkpoint", o.checkpoint, kNotNegative, "s; 0: only at the end");
  o.forces = in.flag("forces", o.forces);
  in.finish();
}

using Names = std::map<std::string, int>;

/// By name; the first of several.
template <class Named>
Names index_of(const std::vector<Named>& all) {
  Names out;
  int index = 0;
  for (const Named& each : all) out.emplace(each.name, index++);
  return out;
}

/// The index of the element of [[kind]] that the field `kind` names.
int named(Fields& in, Reader& r, const char* kind, const Names& all) {
  if (!in.has(kind)) {
    in.missing(kind, fmt::format("the name of a {}", kind));
    return -1;
  }
  const std::string name = in.name(kind, "");
  if (const auto found = all.find(name); found != all.end()) return found->second;
  in.wrong(kind, fmt::format("no such {}{}", kind, r.hint_of(name, all)));
  return -1;
}

void read_expect(Fields& in, Reader& r, const Names& joints, const Names& springs) {
  Expect expect;
  expect.place = in.place();
  expect.time = in.number("time", r.scene.end, kNotNegative, "s");
  expect.throughout = in.flag("throughout", expect.throughout);
  if (!in.has("quantity")) in.missing("quantity", "what is judged, e.g. \"position\"");
  expect.quantity = in.word("quantity", expect.quantity);
  if (is_of_body(expect.quantity)) expect.body = r.body(in, "body");
  if (is_force(expect.quantity) && is_of_body(expect.quantity) && in.has("against"))
    expect.against = r.body(in, "against");
  if (is_of_joint(expect.quantity)) expect.joint = named(in, r, "joint", joints);
  if (is_of_spring(expect.quantity)) expect.spring = named(in, r, "spring", springs);

  const std::size_t size = components(expect.quantity);
  const Value* value = in.find("value");
  if (value != nullptr && size == 1 && value->kind() == Value::Kind::number)
    expect.value = {in.number("value", 0, kAny, "SI")};
  else if (value != nullptr)
    expect.value = in.numbers("value", {size}, "SI");
  if (value != nullptr && !in.has("within")) in.missing("within", "largest difference, SI, >= 0");
  if (value != nullptr) expect.within = in.number("within", 0, kNotNegative, "SI");
  if (in.has("at_most")) expect.at_most = in.number("at_most", 0, kAny, "SI");
  if (in.has("at_least")) expect.at_least = in.number("at_least", 0, kAny, "SI");
  if (value == nullptr && !expect.at_most && !expect.at_least)
    in.missing("value", "give value and within, at_most or at_least");
  r.scene.expect.push_back(std::move(expect));
}

}  // namespace

void check(const Scene& scene, Report& report) {
  check_bodies(scene, report);
  for (const effects::Effect* each : effects::all()) each->check(scene, report);
  check_times(scene, report);
}

Scene read(Value document, const std::string& name) {
  repeat_elements(document, name);
  Report report;
  Reader r{name, report, {}, {}, {}, {}};
  r.scene.file = name;
  Fields root(&document, "", name, report);

  read_scene_table(root, r);
  // The document of a hundred thousand bodies need not stand beside what is read.
  Entry* entry = find_entry(document, "body");
  auto* bodies = entry != nullptr ? std::get_if<Value::Items>(&entry->value.held) : nullptr;
  if (bodies != nullptr) r.scene.bodies.reserve(bodies->size());
  r.each(root, "body", [&](Fields& in) {
    if (const std::size_t before = r.scene.bodies.size(); before > 0)
      (*bodies)[before - 1] = Value();
    Body body = read_body(in, r);
    for (const effects::Effect* each : effects::all()) each->read_body(in, r, body);
    r.bodies.emplace(body.name, static_cast<int>(r.scene.bodies.size()));
    if (!body.material.empty()) r.materials.insert(body.material);
    r.scene.bodies.push_back(std::move(body));
  });
  r.each(root, "pair", [&](Fields& in) {
    Pair pair;
    pair.place = in.place();
    for (const effects::Effect* each : effects::all()) each->read_pair(in, r, pair);
    r.scene.pairs.push_back(std::move(pair));
  });
  for (const effects::Effect* each : effects::all()) each->read(root, r);
  read_engine(root, r);
  read_output(root, r);
  const Names joints = index_of(r.scene.joints), springs = index_of(r.scene.springs);
  r.each(root, "expect", [&](Fields& in) { read_expect(in, r, joints, springs); });
  root.finish();
  r.scene.surface_files.assign(r.surface_files.begin(), r.surface_files.end());
  // Parts that were wrong stand as defaults, which must not be blamed in turn.
  if (report.clean()) check(r.scene, report);
  report.finish();
  return std::move(r.scene);
}

}  // namespace tether::scene::files

namespace tether::scene {

Scene parse_scene(std::string_view text, const std::string& name) {
  if (text.size() > kLargestScene) files::refuse({name, 0, 0}, "must be a file of at most 256 MiB");
  try {
    return files::read(files::parse_document(text, name), name);
  } catch (const SceneError&) {
    throw;
  } catch (const std::exception& e) {  // out of memory
    files::refuse({name, 0, 0}, std::string("cannot be read: ") + e.what());
  }
}

Scene read_scene(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) files::refuse({path, 0, 0}, "cannot be opened");
  const std::string text = files::read_stream(in, kLargestScene);
  if (in.bad()) files::refuse({path, 0, 0}, "cannot be read");
  return parse_scene(text, path);
}

}  // namespace tether::scene
