// Tether: a scene as TOML, every default spelt out. SPDX-License-Identifier: BSD-3-Clause

#include <iterator>

#include "effects/list.hpp"
#include "geometry/shape_type.hpp"
#include "options.hpp"
#include "record/formats.hpp"
#include "toml/writer.hpp"

namespace tether::scene {

namespace {

using files::toml;
using files::toml_word;
using files::Writer;

using Keys = std::vector<std::pair<std::string, std::string>>;

Keys shape_keys(const Shape& shape) {
  Keys keys{{"shape", toml_word(shape.kind)}};
  for (const ShapeField& field : type_of(shape.kind).fields())
    std::visit([&](auto member) { keys.emplace_back(field.key, toml(shape.*member)); },
               field.value);
  return keys;
}

bool at_origin(const Shape& shape) {
  return shape.position.isZero(0) &&
         shape.orientation.coeffs() == Eigen::Quaterniond::Identity().coeffs();
}

void write_shapes(const Body& body, Writer& out) {
  if (body.shapes.size() == 1 && at_origin(body.shapes.front())) {
    for (const auto& [key, value] : shape_keys(body.shapes.front())) out.raw(key, value);
    return;
  }
  if (body.shapes.empty()) return;
  std::string text = "[\n";
  for (const Shape& shape : body.shapes) {
    text += "  { ";
    for (const auto& [key, value] : shape_keys(shape)) text += fmt::format("{} = {}, ", key, value);
    text += fmt::format("position = {}, orientation = {} }},\n", toml(shape.position),
                        toml(shape.orientation));
  }
  out.raw("shapes", text + "]");
}

void write_body(const Body& body, Writer& out) {
  out.item("body");
  out.field("name", body.name);
  write_shapes(body, out);
  out.field("fixed", body.fixed);
  const Eigen::Matrix3d& J = body.inertia;
  const bool massless = body.fixed && J.isZero(0);
  out.field("mass", body.mass, "kg");
  if (!massless || body.mass > 0)
    out.raw("inertia",
            toml(std::vector<double>{J(0, 0), J(1, 1), J(2, 2), J(0, 1), J(0, 2), J(1, 2)}),
            "xx, yy, zz, xy, xz, yz; kg m^2, body axes");
  out.field("position", body.position, "m");
  out.field("orientation", body.orientation);
  out.field("velocity", body.velocity, "m/s");
  out.field("angular_velocity", body.angular_velocity, "rad/s, world axes");
  if (!body.material.empty()) out.field("material", body.material);
  for (const effects::Effect* each : effects::all()) each->write_body(body, out);
}

template <class Options>
void write_options(const char* key, std::optional<Options> options, Writer& out) {
  if (!options) return;
  out.table(key);
  files::each_field(*options, files::WriteField{out});
}

void write_output(const Output& o, Writer& out) {
  out.table("output");
  for (const formats::Format* each : formats::all()) out.field(each->name, o[each->name]);
  out.field("every", o.every, "s; 0: end / 1000");
  out.field("checkpoint", o.checkpoint, "s; 0: only at the end");
  out.field("forces", o.forces);
}

void write_expect(const Scene& scene, const Expect& e, Writer& out) {
  out.item("expect");
  out.field("time", e.time, "s");
  out.field("throughout", e.throughout);
  out.raw("quantity", toml_word(e.quantity));
  if (e.body >= 0) out.field("body", scene.bodies[static_cast<std::size_t>(e.body)].name);
  if (e.against >= 0) out.field("against", scene.bodies[static_cast<std::size_t>(e.against)].name);
  if (e.joint >= 0) out.field("joint", scene.joints[static_cast<std::size_t>(e.joint)].name);
  if (e.spring >= 0) out.field("spring", scene.springs[static_cast<std::size_t>(e.spring)].name);
  if (e.value.size() == 1) out.field("value", e.value.front());
  if (e.value.size() > 1) out.field("value", e.value);
  if (!e.value.empty()) out.field("within", e.within);
  if (e.at_most) out.field("at_most", *e.at_most);
  if (e.at_least) out.field("at_least", *e.at_least);
}

}  // namespace

std::string write_scene(const Scene& scene) {
  Writer out;
  out.table("scene");
  out.field("name", scene.name);
  out.field("end", scene.end, "s");
  out.raw("engine", toml_word(scene.engine));
  out.raw("simultaneous_impacts", toml_word(scene.simultaneous_impacts));
  for (const effects::Effect* each : effects::all()) each->write_scene(scene, out);
  write_options("smooth", scene.smooth, out);
  write_options("stepping", scene.stepping, out);
  write_options("event", scene.event, out);
  write_output(scene.output, out);
  for (const Body& body : scene.bodies) write_body(body, out);
  for (const Pair& pair : scene.pairs) {
    out.item("pair");
    for (const effects::Effect* each : effects::all()) each->write_pair(pair, out);
  }
  for (const effects::Effect* each : effects::all()) each->write(scene, out);
  for (const Expect& each : scene.expect) write_expect(scene, each, out);
  return out.take().substr(1);
}

}  // namespace tether::scene
