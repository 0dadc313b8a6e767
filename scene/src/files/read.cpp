// Tether: reads and writes scene files. SPDX-License-Identifier: BSD-3-Clause
#include "read.hpp"

#include <fstream>

#include "effects/list.hpp"
#include "record/formats.hpp"
#include "toml/document.hpp"
#include "toml/fields.hpp"

namespace tether::scene::files {

namespace {

constexpr int kMostCounted = 2000000000;

void each_field(SmoothOptions& o, const Form& io) {
  io.number("tolerance", o.tolerance, {1e-14, 1e-1, "a number from 1e-14 to 0.1"},
            "relative, and absolute in SI");
  io.word("formulation", o.formulation);
  io.flag("projection", o.projection);
  io.number("max_step", o.max_step, kNotNegative, "s; 0: free");
  io.count("max_steps", o.max_steps, 1, kMostCounted);
}

void each_field(EventOptions& o, const Form& io) {
  io.number("tolerance", o.tolerance, {1e-13, 1e-1, "a number from 1e-13 to 0.1"},
            "relative, and absolute in SI");
  io.number("max_step", o.max_step, kNotNegative, "s; 0: free");
  io.count("max_events", o.max_events, 1, kMostCounted);
  io.count("max_steps", o.max_steps, 1, kMostCounted);
  io.word("otherwise", o.otherwise);
}

void each_field(SteppingOptions& o, const Form& io) {
  constexpr const char* kOfSpeed = "of sqrt(gravity * size)";
  io.number("step", o.step, kPositive, "s");
  io.number("accuracy", o.accuracy, {0, 0.1, "a number from 0 to 0.1"},
            "of the size of each body; 0: none, steps are taken whole");
  io.word("law", o.law);
  io.number("tolerance", o.tolerance, kPositivePart, "relative residual");
  io.word("gyroscopic", o.gyroscopic);
  io.number("error_reduction", o.error_reduction, kPart, "");
  io.number("max_depenetration_speed", o.max_depenetration_speed, kNotNegative, "m/s");
  io.word("restitution_law", o.restitution_law);
  io.number("restitution_threshold", o.restitution_threshold, kNotNegative, kOfSpeed);
  io.number("impact_threshold", o.impact_threshold, kNotNegative, kOfSpeed);
  io.flag("cut_at_impacts", o.cut_at_impacts);
  io.number("sleep", o.sleep, kNotNegative, "of sqrt(gravity * size); 0: none sleeps");
  io.number("acceptance", o.acceptance, {1, 1e12, "a number from 1 to 1e12"}, "of the tolerance");
  io.count("max_halvings", o.max_halvings, 0, 30);
  io.count("max_sweeps", o.max_sweeps, 1, 1000000000);
  io.word("on_failure", o.on_failure);
  io.count("threads", o.threads, 1, 256);
}

void check_bodies(const Scene& scene, Report& report) {
  if (scene.bodies.empty())
    report.add({scene.file, 1, 1}, "[[body]]", "", "is missing; a scene has at least one body");
  std::set<std::string> names;
  for (const Body& body : scene.bodies) {
    const auto wrong = [&](const char* field, const char* why) {
      report.add(body.place, fmt::format("body \"{}\": {}", body.name, field), "", why);
    };
    const auto has = [&](ShapeKind kind) {
      return any_of(body.shapes, [&](const Shape& s) { return s.kind == kind; });
    };
    if (body.name.empty() || body.name == "world")
      wrong("name", "must be neither empty nor \"world\", which is the ground");
    check_name(body, "body", names, report);
    if (has(ShapeKind::plane) && !body.fixed)
      wrong("fixed", "must be true: a plane is infinite and cannot move");
    if (has(ShapeKind::mesh) && !body.fixed)
      wrong("fixed", "must be true: on a body that moves a mesh is given as its convex_parts()");
    if (body.fixed && (!body.velocity.isZero(0) || !body.angular_velocity.isZero(0)))
      wrong("velocity", "must be zero: the body is fixed");
    for (const effects::Effect* each : effects::all()) each->check_body(body, report);
    if (!body.material.empty() && body.shapes.empty())
      wrong("material", "needs a shape: without one the body touches nothing");
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

void read_engine(const Form& root, Scene& scene) {
  root.table("smooth", scene.smooth, [](const Form& in, auto& o) { each_field(o, in); });
  root.table("stepping", scene.stepping, [&](const Form& in, SteppingOptions& o) {
    each_field(o, in);
    check_stepping(*in.in(), scene, o);
  });
  if (scene.smooth && scene.stepping)
    root.in()->wrong("stepping", "a scene has [smooth] or [stepping], not both");
  root.table("event", scene.event, [](const Form& in, auto& o) { each_field(o, in); });
  if (scene.event && (scene.smooth || (scene.stepping && !goes_on_in_steps(scene))))
    root.in()->wrong("event",
                     "a scene has one of [smooth], [stepping] and [event]; [stepping] beside "
                     "[event] is for otherwise = \"stepping\"");
}

/// The element of [[kind]] that the field `kind` names.
template <class Named>
void named(const Form& form, const char* kind, const std::map<std::string, int>& names,
           const std::vector<Named>& all, int& index) {
  if (form.out()) form.out()->field(kind, all[linalg::at(index)].name);
  if (form.in()) index = form.reader()->named(*form.in(), kind, kind, names);
}

void expected_value(const Form& form, Expect& e) {
  Fields* const in = form.in();
  const std::size_t size = components(e.quantity);
  const Value* value = in ? in->find("value") : nullptr;
  if (value && size == 1 && value->kind() == Value::Kind::number)
    e.value = {in->number("value", 0, kAny, "SI")};
  else if (value)
    e.value = in->numbers("value", {size}, "SI");
  else if (form.out() && e.value.size() == 1)
    form.out()->field("value", e.value.front());
  else if (form.out() && !e.value.empty())
    form.out()->field("value", e.value);
  if (value) form.require("within", "largest difference, SI, >= 0");
  if (value || (!in && !e.value.empty())) form.number("within", e.within, kNotNegative, "SI");
  form.number("at_most", e.at_most, kAny, {"SI"});
  form.number("at_least", e.at_least, kAny, {"SI"});
  if (in && !value && !e.at_most && !e.at_least)
    in->missing("value", "give value and within, at_most or at_least");
}

void scene_fields(const Form& form, Scene& scene) {
  if (form.in()) scene.name = form.in()->text("name", "");
  if (form.out()) form.out()->field("name", scene.name);
  form.number("end", scene.end, kPositive, "s");
  for (const effects::Effect* each : effects::all()) each->scene_fields(form, scene);
  form.word("engine", scene.engine);
  form.word("simultaneous_impacts", scene.simultaneous_impacts);
}

void output_fields(const Form& form, Output& o) {
  for (const formats::Format* each : formats::all())
    if (form.in())
      o[each->name] = form.in()->output_name(each->name, each->extension);
    else
      form.out()->field(each->name, o[each->name]);
  form.number("every", o.every, kNotNegative, "s; 0: end / 1000");
  form.number("checkpoint", o.checkpoint, kNotNegative, "s; 0: only at the end");
  form.flag("forces", o.forces);
}

void list_fields(const Form& root, Scene& scene) {
  root.each("pair", scene.pairs, [](const Form& form, Pair& pair) {
    for (const effects::Effect* each : effects::all()) each->pair_fields(form, pair);
    return true;
  });
  for (const effects::Effect* each : effects::all()) each->fields(root, scene);
}

void expect_fields(const Form& root, Scene& scene) {
  const auto joints = index_of(scene.joints), springs = index_of(scene.springs);
  root.each("expect", scene.expect, [&](const Form& form, Expect& e) {
    if (form.in()) e.time = scene.end;
    form.number("time", e.time, kNotNegative, "s");
    form.flag("throughout", e.throughout);
    form.require("quantity", "what is judged, e.g. \"position\"");
    form.word("quantity", e.quantity);
    Fields* const in = form.in();
    if (in ? is_of_body(e.quantity) : e.body >= 0) form.body("body", e.body);
    if (in ? is_force(e.quantity) && is_of_body(e.quantity) && in->has("against") : e.against >= 0)
      form.body("against", e.against);
    if (in ? is_of_joint(e.quantity) : e.joint >= 0)
      named(form, "joint", joints, scene.joints, e.joint);
    if (in ? is_of_spring(e.quantity) : e.spring >= 0)
      named(form, "spring", springs, scene.springs, e.spring);
    expected_value(form, e);
    return true;
  });
}

/// Checks across fields: names, pairs of materials, bodies that cannot move, times.
void check(const Scene& scene, Report& report) {
  check_bodies(scene, report);
  for (const effects::Effect* each : effects::all()) each->check(scene, report);
  check_times(scene, report);
}

}  // namespace

Scene read(Value document, const std::string& name) {
  repeat_elements(document, name);
  Report report;
  Reader r{name, report, {}, {}, {}, {}};
  r.scene.file = name;
  Fields root(&document, "", name, report);

  const Form all(root, r);
  Fields table = r.fields(root.table("scene"), "scene");
  scene_fields(Form(table, r), r.scene);
  table.finish();
  // The document of a hundred thousand bodies need not stand beside what is read.
  Entry* entry = find_entry(document, "body");
  auto* bodies = entry != nullptr ? std::get_if<Value::Items>(&entry->value.held) : nullptr;
  if (bodies != nullptr) r.scene.bodies.reserve(bodies->size());
  r.each(root, "body", [&](Fields& in) {
    if (const std::size_t before = r.scene.bodies.size(); before > 0)
      (*bodies)[before - 1] = Value();
    Body body;
    body.place = in.place();
    body_fields(Form(in, r), body);
    r.bodies.emplace(body.name, static_cast<int>(r.scene.bodies.size()));
    if (!body.material.empty()) r.materials.insert(body.material);
    r.scene.bodies.push_back(std::move(body));
  });
  list_fields(all, r.scene);
  read_engine(all, r.scene);
  Fields output = r.fields(root.table("output"), "output");
  output_fields(Form(output, r), r.scene.output);
  output.finish();
  expect_fields(all, r.scene);
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

std::string write_scene(const Scene& of) {
  Scene scene = of;  // forms change what they read
  files::Writer out;
  const files::Form form(out, of);
  const auto options = [&](const char* key, auto& values) {
    if (!values) return;
    out.table(key);
    files::each_field(*values, form);
  };
  out.table("scene");
  files::scene_fields(form, scene);
  options("smooth", scene.smooth);
  options("stepping", scene.stepping);
  options("event", scene.event);
  out.table("output");
  files::output_fields(form, scene.output);
  for (Body& body : scene.bodies) {
    out.item("body");
    files::body_fields(form, body);
  }
  files::list_fields(form, scene);
  files::expect_fields(form, scene);
  return out.take().substr(1);
}

}  // namespace tether::scene
