// Tether: reads scene files. SPDX-License-Identifier: BSD-3-Clause
#include "read.hpp"

#include <fmt/format.h>

#include <fstream>
#include <map>
#include <set>
#include <tether/scene/files.hpp>

#include "document.hpp"

namespace tether::scene::files {

namespace {

using Eigen::Vector3d;

/// The scene under construction, with what every part of the reader needs.
struct Reader {
  const std::string& file;
  Report& report;
  Scene scene;
  std::map<std::string, int> bodies;  // by name
  std::set<std::string> materials;    // of bodies

  Fields fields(const Value* table, std::string path) const {
    return {table, std::move(path), file, report};
  }

  /// Reads the elements of [[key]]; `path` of one without a name: key and number.
  template <class Read>
  void each(Fields& root, std::string_view key, Read read) {
    int number = 0;
    for (const Value* table : root.tables(key)) {
      Fields in = fields(table, fmt::format("{} {}", key, ++number));
      read(in);
      in.finish();
    }
  }

  /// What was meant; nothing for problems that nobody will see: each hint looks at all names.
  template <class Names>
  std::string hint_of(const std::string& wrong, const Names& names) const {
    if (report.full()) return "";
    std::vector<std::string> all;
    for (const auto& each : names) all.push_back(name_of(each));
    return hint(wrong, all);
  }
  static const std::string& name_of(const std::string& name) { return name; }
  static const std::string& name_of(const Body& body) { return body.name; }

  /// The body that `key` names.
  int body(Fields& in, std::string_view key) const {
    if (!in.has(key)) {
      in.missing(key, "the name of a body");
      return 0;
    }
    const std::string name = in.text(key, "");
    const auto found = bodies.find(name);
    if (found != bodies.end()) return found->second;
    in.wrong(key, "no such body" + hint_of(name, scene.bodies));
    return 0;
  }

  /// bodies = ["a", "world"]
  void two_bodies(Fields& in, int& first, int& second) const {
    const Value* value = in.find("bodies");
    constexpr const char* kAllowed = "two names of bodies; \"world\" is the ground";
    if (value == nullptr) return in.missing("bodies", kAllowed);
    if (value->kind != Value::Kind::array || value->items.size() != 2)
      return in.wrong("bodies", std::string("must be ") + kAllowed);
    int* const out[] = {&first, &second};
    for (std::size_t i = 0; i < 2; ++i) {
      const Value& name = value->items[i];
      if (name.kind != Value::Kind::text)
        return in.wrong("bodies", std::string("must be ") + kAllowed);
      if (name.text == "world") continue;
      const auto found = bodies.find(name.text);
      if (found == bodies.end())
        return in.wrong("bodies", fmt::format("there is no body \"{}\"{}", name.text,
                                              hint_of(name.text, scene.bodies)));
      *out[i] = found->second;
    }
    if (first == second) in.wrong("bodies", "must be two different bodies");
  }
};

std::string item_name(Fields& in, const std::string& kind) {
  const std::string name = in.text("name", in.path());
  if (in.has("name")) in.rename(fmt::format("{} \"{}\"", kind, name));
  return name;
}

void read_scene_table(Fields& root, Reader& r) {
  Fields in = r.fields(root.table("scene"), "scene");
  r.scene.name = in.text("name", "");
  r.scene.end = in.number("end", r.scene.end, kPositive, "s");
  if (in.has("gravity")) r.scene.gravity = in.vector("gravity", Vector3d::Zero(), kAny, "m/s^2");
  in.finish();
}

Motion read_motion(Fields& in, bool turns) {
  Motion m;
  if (turns) {
    m.rate = in.angle("rate_", m.rate, "/s");
    m.amplitude = in.angle("amplitude_", m.amplitude);
  } else {
    m.rate = in.number("rate", m.rate, kAny, "m/s");
    m.amplitude = in.number("amplitude", m.amplitude, kAny, "m");
  }
  m.frequency = in.number("frequency", m.frequency, kNotNegative, "Hz");
  m.phase = in.angle("phase_", m.phase);
  in.finish();
  return m;
}

/// at = [[x, y, z], [x, y, z]]: the point on the first and the one on the second body.
void two_points(Fields& in, Vector3d& at, Vector3d& at_second) {
  if (!in.has("at")) in.missing("at", "the two points [[x, y, z], [x, y, z]], world, m");
  const std::vector<Vector3d> points = in.points("at", 2, 2);
  if (points.empty()) return;
  at = points[0];
  at_second = points[1];
}

void read_joint(Fields& in, Reader& r) {
  Joint joint;
  joint.place = in.place();
  joint.name = item_name(in, "joint");
  if (!in.has("kind")) in.missing("kind", "it is a distance, ball, hinge, slider or fixed joint");
  const std::optional<JointKind> kind = in.word_of<JointKind>("kind");
  r.two_bodies(in, joint.first, joint.second);
  if (!kind) return in.pass_over({"at", "axis", "length", "motion"});
  joint.kind = *kind;

  const bool turns = joint.kind == JointKind::hinge, slides = joint.kind == JointKind::slider;
  if (joint.kind == JointKind::distance) {
    two_points(in, joint.at, joint.at_second);
    if (in.has("length")) joint.length = in.number("length", 1, kPositive, "m");
    const bool apart = (joint.at - joint.at_second).norm() > 0;
    if (in.has("at") && !apart) in.wrong("at", "the two points must be apart");
  } else {
    if (!in.has("at") && !slides) in.missing("at", "a point [x, y, z], world, m");
    joint.at = in.vector("at", joint.at, kAny, "m");
  }
  if (turns || slides) {
    if (!in.has("axis")) in.missing("axis", "a direction [x, y, z], world");
    joint.axis = in.direction("axis", joint.axis);
  }
  if (turns || slides || joint.kind == JointKind::distance)
    if (const Value* motion = in.table("motion")) {
      Fields fields = r.fields(motion, in.path() + ": motion");
      joint.motion = read_motion(fields, turns);
    }
  r.scene.joints.push_back(std::move(joint));
}

void read_spring(Fields& in, Reader& r) {
  Spring spring;
  spring.place = in.place();
  spring.name = item_name(in, "spring");
  r.two_bodies(in, spring.first, spring.second);
  two_points(in, spring.at, spring.at_second);
  spring.stiffness = in.number("stiffness", spring.stiffness, kNotNegative, "N/m");
  spring.damping = in.number("damping", spring.damping, kNotNegative, "N s/m");
  if (in.has("rest")) spring.rest = in.number("rest", 0, kNotNegative, "m");
  if (!in.has("stiffness") && !in.has("damping"))
    in.missing("stiffness", "give stiffness (N/m), damping (N s/m) or both");
  r.scene.springs.push_back(std::move(spring));
}

void read_load(Fields& in, Reader& r) {
  Load load;
  load.place = in.place();
  load.body = r.body(in, "body");
  load.force = in.vector("force", load.force, kAny, "N");
  load.torque = in.vector("torque", load.torque, kAny, "N m");
  if (!in.has("force") && !in.has("torque"))
    in.missing("force", "give force (N), torque (N m) or both");
  r.scene.loads.push_back(load);
}

void read_pair(Fields& in, Reader& r) {
  Pair pair;
  pair.place = in.place();
  pair.friction = in.number("friction", pair.friction, kNotNegative, "");
  pair.restitution = in.number("restitution", pair.restitution, kPart, "");
  constexpr const char* kAllowed = "two names of materials, e.g. [\"card\", \"table\"]";
  const Value* between = in.find("between");
  if (between == nullptr) return in.missing("between", kAllowed);
  if (between->kind != Value::Kind::array || between->items.size() != 2 ||
      between->items[0].kind != Value::Kind::text || between->items[1].kind != Value::Kind::text)
    return in.wrong("between", std::string("must be ") + kAllowed);
  pair.first = between->items[0].text;
  pair.second = between->items[1].text;
  for (const std::string& name : {pair.first, pair.second})
    if (r.materials.count(name) == 0)
      return in.wrong("between", fmt::format("no body has the material \"{}\"{}", name,
                                             r.hint_of(name, r.materials)));
  r.scene.pairs.push_back(std::move(pair));
}

void read_invariant(Fields& in, Reader& r) {
  Invariant invariant;
  invariant.place = in.place();
  if (!in.has("kind")) in.missing("kind", "energy, momentum or angular_momentum");
  invariant.kind = in.word("kind", invariant.kind);
  invariant.project = in.flag("project", invariant.project);
  r.scene.invariants.push_back(invariant);
}

void read_engine(Fields& root, Reader& r) {
  const Value* smooth = root.table("smooth");
  const Value* stepping = root.table("stepping");
  if (smooth != nullptr) {
    Fields in = r.fields(smooth, "smooth");
    SmoothOptions o;
    o.tolerance =
        in.number("tolerance", o.tolerance, {1e-14, 1e-1, false, "a number from 1e-14 to 0.1"},
                  "relative, and absolute in SI");
    o.formulation = in.word("formulation", o.formulation);
    o.projection = in.flag("projection", o.projection);
    o.max_step = in.number("max_step", o.max_step, kNotNegative, "s; 0: free");
    o.max_steps = in.count("max_steps", o.max_steps, 1, 2000000000);
    in.finish();
    r.scene.smooth = o;
  }
  if (stepping == nullptr) return;
  Fields in = r.fields(stepping, "stepping");
  SteppingOptions o;
  o.step = in.number("step", o.step, kPositive, "s");
  o.law = in.word("law", o.law);
  o.tolerance = in.number("tolerance", o.tolerance, kPositivePart, "relative residual");
  o.gyroscopic = in.word("gyroscopic", o.gyroscopic);
  o.error_reduction = in.number("error_reduction", o.error_reduction, kPart, "");
  o.max_depenetration_speed =
      in.number("max_depenetration_speed", o.max_depenetration_speed, kNotNegative, "m/s");
  o.restitution_law = in.word("restitution_law", o.restitution_law);
  o.restitution_threshold = in.number("restitution_threshold", o.restitution_threshold,
                                      kNotNegative, "of sqrt(gravity * size)");
  o.impact_threshold =
      in.number("impact_threshold", o.impact_threshold, kNotNegative, "of sqrt(gravity * size)");
  o.acceptance = in.number("acceptance", o.acceptance, {1, 1e12, false, "a number from 1 to 1e12"},
                           "of the tolerance");
  o.max_halvings = in.count("max_halvings", o.max_halvings, 0, 30);
  o.on_failure = in.word("on_failure", o.on_failure);
  o.threads = in.count("threads", o.threads, 1, 1024);
  in.finish();
  r.scene.stepping = o;
  if (smooth != nullptr) root.wrong("stepping", "a scene has [smooth] or [stepping], not both");
}

void read_output(Fields& root, Reader& r) {
  Fields in = r.fields(root.table("output"), "output");
  Output& o = r.scene.output;
  o.csv = in.file_name("csv");
  o.vtk = in.file_name("vtk");
  o.svg = in.file_name("svg");
  o.state = in.file_name("state");
  o.every = in.number("every", o.every, kNotNegative, "s; 0: end / 1000");
  o.checkpoint = in.number("checkpoint", o.checkpoint, kNotNegative, "s; 0: only at the end");
  in.finish();
}

void read_expect(Fields& in, Reader& r) {
  Expect expect;
  expect.place = in.place();
  expect.time = in.number("time", r.scene.end, kNotNegative, "s");
  expect.throughout = in.flag("throughout", expect.throughout);
  if (!in.has("quantity")) in.missing("quantity", "what is judged, e.g. \"position\"");
  expect.quantity = in.word("quantity", expect.quantity);
  if (is_of_body(expect.quantity)) expect.body = r.body(in, "body");

  const std::size_t size = components(expect.quantity);
  const Value* value = in.find("value");
  if (value != nullptr && size == 1 && value->kind == Value::Kind::number)
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

Scene read(std::string_view text, const std::string& name) {
  const Value document = parse_document(text, name);
  Report report;
  Reader r{name, report, {}, {}, {}};
  r.scene.file = name;
  Fields root(&document, "", name, report);

  read_scene_table(root, r);
  r.each(root, "body", [&](Fields& in) {
    Body body = read_body(in, name, report);
    r.bodies.emplace(body.name, static_cast<int>(r.scene.bodies.size()));
    if (!body.material.empty()) r.materials.insert(body.material);
    r.scene.bodies.push_back(std::move(body));
  });
  r.each(root, "pair", [&](Fields& in) { read_pair(in, r); });
  r.each(root, "joint", [&](Fields& in) { read_joint(in, r); });
  r.each(root, "spring", [&](Fields& in) { read_spring(in, r); });
  r.each(root, "load", [&](Fields& in) { read_load(in, r); });
  r.each(root, "invariant", [&](Fields& in) { read_invariant(in, r); });
  read_engine(root, r);
  read_output(root, r);
  r.each(root, "expect", [&](Fields& in) { read_expect(in, r); });
  root.finish();
  // Parts that were wrong stand as defaults, which must not be blamed in turn.
  if (report.clean()) check(r.scene, report);
  report.finish();
  return std::move(r.scene);
}

}  // namespace

}  // namespace tether::scene::files

namespace tether::scene {

namespace {

constexpr std::size_t kLargestFile = std::size_t{256} << 20;

}  // namespace

Scene parse_scene(std::string_view text, const std::string& name) {
  constexpr std::size_t kLargest = std::size_t{256} << 20;
  if (text.size() > kLargest) files::refuse({name, 0, 0}, "must be a file of at most 256 MiB");
  try {
    return files::read(text, name);
  } catch (const SceneError&) {
    throw;
  } catch (const std::exception& e) {  // out of memory
    files::refuse({name, 0, 0}, std::string("cannot be read: ") + e.what());
  }
}

Scene read_scene(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) files::refuse({path, 0, 0}, "cannot be opened");
  // By blocks: of a folder, or of what is cut off while it is read, this fails without a throw.
  std::string text;
  std::vector<char> block(std::size_t{1} << 16);
  while (in && text.size() <= kLargestFile) {
    in.read(block.data(), static_cast<std::streamsize>(block.size()));
    text.append(block.data(), static_cast<std::size_t>(in.gcount()));
  }
  if (in.bad()) files::refuse({path, 0, 0}, "cannot be read");
  return parse_scene(text, path);
}

}  // namespace tether::scene
