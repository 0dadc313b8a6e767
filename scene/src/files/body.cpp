// Tether: bodies in a scene file. SPDX-License-Identifier: BSD-3-Clause

#include <algorithm>
#include <cmath>

#include "effects/list.hpp"
#include "geometry/shape_type.hpp"
#include "read.hpp"

namespace tether::scene::files {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// wxyz, or an axis with deg or rad.
Eigen::Quaterniond read_orientation(Fields& in, const Reader& r) {
  const Value* table = in.table("orientation");
  if (table == nullptr) return Eigen::Quaterniond::Identity();
  Fields fields = r.fields(table, in.path() + ": orientation");
  Eigen::Quaterniond out = Eigen::Quaterniond::Identity();
  if (fields.has("wxyz")) {
    const std::vector<double> q = fields.numbers("wxyz", {4}, "");
    if (!q.empty()) {
      const Eigen::Quaterniond read(q[0], q[1], q[2], q[3]);
      const double length = read.coeffs().stableNorm();
      // Digits cut off are mended; anything else is a mistake.
      if (std::abs(length - 1) <= 1e-15)
        out = read;
      else if (std::abs(length - 1) <= 1e-3)
        out.coeffs() = read.coeffs() / length;
      else
        fields.wrong("wxyz", "must have length 1 (unit quaternion, scalar first)");
    }
  } else {
    if (!fields.has("axis"))
      fields.missing("axis", "give axis and deg (or rad), or wxyz (scalar first)");
    const Vector3d axis = fields.direction("axis", Vector3d::UnitZ());
    if (!fields.has("deg") && !fields.has("rad")) fields.missing("deg", "give deg or rad");
    out = Eigen::AngleAxisd(fields.angle("", 0), axis);
  }
  fields.finish();
  return out;
}

// The fields of a shape; `in` is the body itself for a body's only shape. Keys of other kinds stay
// unknown: a box with a radius is a mistake.
Shape read_shape(Fields& in, Reader& r) {
  Shape shape;
  // A height field is a mesh by another description.
  std::vector<std::string> words;
  for (const ShapeKind each : contact::kShapeKinds) words.emplace_back(name(each));
  words.emplace_back("height_field");
  if (!in.has("shape"))
    in.missing("shape", fmt::format("it is one of: {}", fmt::join(words, ", ")));
  const int kind = in.choice("shape", words);
  if (kind < 0) {
    for (const ShapeKind each : contact::kShapeKinds)
      for (const ShapeField& field : type_of(each).fields()) in.pass_over({field.key});
    in.pass_over({"file", "heights", "spacing", "scale", "concavity"});
    shape.radius = 1;
    return shape;
  }
  if (words[static_cast<std::size_t>(kind)] == "height_field") {
    read_height_field(in, r, shape);
    return shape;
  }
  shape.kind = contact::kShapeKinds[static_cast<std::size_t>(kind)];
  type_of(shape.kind).read(in, r, shape);
  return shape;
}

// The shapes of a body as they are given, whose solid it is, and as they touch: a mesh that moves
// as its convex parts.
struct ReadShapes {
  std::vector<Shape> given, touching;
};

void add_shape(Fields& in, Reader& r, bool fixed, bool has_place, ReadShapes& out) {
  Shape shape = read_shape(in, r);
  if (has_place) {
    shape.position = in.vector("position", Vector3d::Zero(), kAny, "m");
    shape.orientation = read_orientation(in, r);
  }
  if (shape.kind == ShapeKind::mesh && fixed && shape.concavity > 0)
    in.wrong("concavity", "is for a body that moves: a fixed mesh is a surface and has no parts");
  if (shape.kind != ShapeKind::mesh || fixed || !r.report.clean()) {
    out.given.push_back(shape);
    out.touching.push_back(std::move(shape));
    return;
  }
  std::vector<Shape> parts = read_parts(in, r, shape);
  for (Shape& part : parts) {
    part.position = placed(shape, part.position);
    part.orientation = shape.orientation;
  }
  const bool convex = parts.size() == 1 && shape.concavity == 0;
  out.given.push_back(convex ? parts.front() : std::move(shape));
  for (Shape& part : parts) out.touching.push_back(std::move(part));
}

ReadShapes read_shapes(Fields& in, Reader& r, bool fixed) {
  ReadShapes out;
  const bool several = in.has("shapes");
  if (several && in.has("shape")) in.wrong("shape", "give shape or shapes, not both");
  if (!several) {
    if (in.has("shape")) add_shape(in, r, fixed, false, out);
    return out;
  }
  for (const Value* each : in.tables("shapes")) {
    Fields fields = r.fields(each, fmt::format("{}: shape {}", in.path(), out.given.size() + 1));
    add_shape(fields, r, fixed, true, out);
    fields.finish();
  }
  return out;
}

// [xx, yy, zz] or with [xy, xz, yz] behind them.
void read_inertia(Fields& in, Body& body) {
  const std::vector<double> moments = in.numbers("inertia", {3, 6}, "kg m^2");
  if (moments.empty()) return;
  Matrix3d& J = body.inertia = Vector3d(moments[0], moments[1], moments[2]).asDiagonal();
  if (moments.size() == 6) {
    J(0, 1) = J(1, 0) = moments[3];
    J(0, 2) = J(2, 0) = moments[4];
    J(1, 2) = J(2, 1) = moments[5];
  }
  if (!(body.fixed && J.isZero(0)) && !is_inertia(J))
    in.wrong("inertia",
             "principal moments must be > 0 and each at most the sum of the other two (triangle "
             "inequality), kg m^2");
}

// The solid that the shapes are, of density 1: a fixed mesh is a surface without an inside.
MassProperties solid_of(const Body& body) {
  std::vector<Shape> solids = body.shapes;
  const auto is_surface = [&](const Shape& s) { return body.fixed && s.kind == ShapeKind::mesh; };
  solids.erase(std::remove_if(solids.begin(), solids.end(), is_surface), solids.end());
  return mass_properties(solids);
}

double size_of(const Body& body) {
  double size = 0;
  for (const Shape& shape : body.shapes) {
    size = std::max({size, shape.radius, shape.length, shape.size.maxCoeff()});
    for (const Vector3d& p : shape.points) size = std::max(size, p.norm());
  }
  return size;
}

void read_mass(Fields& in, Body& body) {
  const bool by_mass = in.has("mass"), by_density = in.has("density"),
             by_inertia = in.has("inertia");
  body.mass =
      in.number("mass", body.fixed || by_mass ? 0 : 1, body.fixed ? kNotNegative : kPositive, "kg");
  const double density = in.number("density", 1, kPositive, "kg/m^3");
  if (by_mass && by_density) in.wrong("density", "give mass or density, not both");
  if (!by_mass && !by_density && !body.fixed)
    in.missing("mass", "give mass (kg) or density (kg/m^3), or fixed = true");
  read_inertia(in, body);
  if (!by_density && (!by_mass || by_inertia || !(body.mass > 0))) return;

  const MassProperties solid = solid_of(body);
  if (!(solid.volume > 0) || !std::isfinite(solid.volume)) {
    const std::string why = body.shapes.empty() ? "there is no shape to take it from"
                                                : "the shapes have no (finite) volume";
    if (by_density) return in.wrong("density", why + "; give mass and inertia");
    return in.missing("inertia", "[xx, yy, zz] about the centre, body axes, kg m^2: " + why);
  }
  if (by_density) body.mass = density * solid.volume;
  if (by_inertia) return;
  body.inertia = body.mass / solid.volume * solid.inertia;
  if (!(solid.centre.norm() <= 1e-6 * size_of(body)))
    return in.missing("inertia", fmt::format("the body's origin must be its centre of mass, but "
                                             "the shapes' centre is {}; move the shapes by its "
                                             "negative, or give mass and inertia",
                                             toml(solid.centre)));
  if (!is_inertia(body.inertia))
    in.missing("inertia", "that of the shapes is not a finite number > 0");
}

void write_shape(const Shape& shape, Writer& out) {
  out.raw("shape", toml_word(shape.kind));
  for (const ShapeField& field : type_of(shape.kind).fields())
    std::visit([&](auto member) { out.field(field.key, shape.*member); }, field.value);
}

void write_shapes(const Body& body, Writer& out) {
  const auto at_origin = [](const Shape& shape) {
    return shape.position.isZero(0) &&
           shape.orientation.coeffs() == Eigen::Quaterniond::Identity().coeffs();
  };
  if (body.shapes.empty()) return;
  if (body.shapes.size() == 1 && at_origin(body.shapes.front()))
    return write_shape(body.shapes.front(), out);
  std::string text = "[\n";
  for (const Shape& shape : body.shapes) {
    Writer inside(Writer::Layout::inside);
    write_shape(shape, inside);
    inside.field("position", shape.position);
    inside.field("orientation", shape.orientation);
    text += "  { " + inside.take() + " },\n";
  }
  out.raw("shapes", text + "]");
}

void write_mass(const Body& body, Writer& out) {
  const Matrix3d& J = body.inertia;
  out.field("mass", body.mass, "kg");
  if (!body.fixed || !J.isZero(0) || body.mass > 0)
    out.field("inertia", std::array{J(0, 0), J(1, 1), J(2, 2), J(0, 1), J(0, 2), J(1, 2)},
              "xx, yy, zz, xy, xz, yz; kg m^2, body axes");
}

}  // namespace

void body_fields(const Form& form, Body& body) {
  Fields* const in = form.in();
  form.name("body", body.name);
  form.flag("fixed", body.fixed);
  if (in) {
    ReadShapes shapes = read_shapes(*in, *form.reader(), body.fixed);
    body.shapes = std::move(shapes.given);
    read_mass(*in, body);
    body.shapes = std::move(shapes.touching);
  } else {
    write_shapes(body, *form.out());
    write_mass(body, *form.out());
  }
  form.vector("position", body.position, kMetres);
  if (in)
    body.orientation = read_orientation(*in, *form.reader());
  else
    form.out()->field("orientation", body.orientation);
  form.vector("velocity", body.velocity, kSpeed);
  form.vector("angular_velocity", body.angular_velocity, kTurning);
  if (in)
    body.material = in->name("material", "");
  else if (!body.material.empty())
    form.out()->field("material", body.material);
  for (const effects::Effect* each : effects::all()) each->body_fields(form, body);
}

}  // namespace tether::scene::files
