// Tether: friction of cables at rings and pulleys. SPDX-License-Identifier: BSD-3-Clause
#include "cable.hpp"

#include <tether/linalg/pi.hpp>

#include "numbers.hpp"

namespace tether::scene::effects {

// L'' = d'' along d + the square of d' across d, over L; the axis of the pulley turns with it.
double CapstanSlip::rest(const Bodies& bodies) const {
  double sum = 0;
  for (std::size_t k = 0; k + 1 < item_.points.size(); ++k) {
    const Jet<double> a = point<2>(item_.frame(bodies, k), item_.points[k].at),
                      b = point<2>(item_.frame(bodies, k + 1), item_.points[k + 1].at);
    const Piece<double> piece = item_.piece(bodies, k);
    if (!(piece.length > 0)) continue;
    const Vector3d d1 = b.x1 - a.x1, d2 = b.x2 - a.x2;
    const double across = d1.squaredNorm() - piece.rate * piece.rate;
    sum -= sign(k) * (piece.along.dot(d2) + across / piece.length);
  }
  return sum;
}

namespace {

bool rubs(const Spring& spring) { return spring.cable && !spring.cable->capstans.empty(); }

constexpr const char* kKey = "capstan";

struct CapstanEffect : Effect {
  void cable_fields(const Form& form, Cable& cable) const override {
    if (Fields* in = form.in()) {
      read(*in, *form.reader(), cable);
    } else if (form.units()) {
      for (Capstan& each : cable.capstans) one(form, cable, each);
    } else if (!cable.capstans.empty()) {
      std::vector<std::string> tables;
      for (Capstan& each : cable.capstans) {
        Writer inside(Writer::Layout::inside);
        one(Form(inside, form.scene()), cable, each);
        tables.push_back("{ " + inside.take() + " }");
      }
      form.out()->raw(kKey, tables.size() == 1 ? tables[0] : in_brackets(tables));
    }
  }
  void check(const Scene& scene, Report& report) const override {
    for (const Spring& spring : scene.springs) {
      if (!rubs(spring)) continue;
      const std::vector<Ring>& rings = spring.cable->rings;
      for (const Capstan& each : spring.cable->capstans)
        if (each.radius > 0 && at(each.ring) <= rings.size() &&
            !scene.moves(rings[at(each.ring) - 1].body))
          report.add(spring.place, fmt::format("cable \"{}\": capstan.radius", spring.name),
                     fmt::format("{}", each.radius),
                     "is of a pulley that turns, and the body of its ring is fixed");
    }
  }
  void plan(const Scene& scene, EngineKind, Lines& lines) const override {
    add_count(lines, "capstan friction", count_if(scene.springs, rubs), "cable");
  }
  bool has_joint_laws(const Scene& scene) const override { return any_of(scene.springs, rubs); }
  void add_columns(const Scene& scene, std::vector<Column>& columns) const override {
    if (!scene.output.forces) return;
    for (std::size_t i = 0; i < scene.springs.size(); ++i)
      if (rubs(scene.springs[i]))
        columns.push_back(
            {scene.springs[i].name + ".tension_second_N",
             [i](const Diagnostics&, const Forces& f) { return f.springs[i].tension_second; }});
  }

 private:
  // One table, or an array of them, in any order.
  static void read(Fields& in, Reader& reader, Cable& cable) {
    const Value* value = in.find(kKey);
    if (value == nullptr) return;
    const bool several = value->kind() != Value::Kind::table;
    for (const Value* table : several ? in.tables(kKey) : std::vector<const Value*>{value}) {
      const std::string path = in.field(kKey);
      const std::size_t number = cable.capstans.size() + 1;
      Fields fields = reader.fields(table, several ? fmt::format("{} {}", path, number) : path);
      one(Form(fields, reader), cable, cable.capstans.emplace_back());
      fields.finish();
    }
    std::sort(cable.capstans.begin(), cable.capstans.end(), before);
    for (std::size_t k = 1; k < cable.capstans.size(); ++k)
      if (!before(cable.capstans[k - 1], cable.capstans[k]))
        return in.wrong(kKey, fmt::format("ring {} is there twice", cable.capstans[k].ring));
  }
  static bool before(const Capstan& a, const Capstan& b) { return a.ring < b.ring; }
  static void one(const Form& form, const Cable& cable, Capstan& capstan) {
    const int rings = static_cast<int>(cable.rings.size());
    Fields* const in = form.in();
    form.count("ring", capstan.ring, 1, std::max(rings, 1));
    if (in && rings == 0) in->wrong("ring", "the cable has no ring between its ends to rub at");
    if (in && rings > 1) form.require("ring", "which of its rings, from 1 on");
    form.require("friction", "a coefficient");
    coefficient(form, "friction", capstan.friction, {});
    wrap(form, capstan.wrap);
    form.number("radius", capstan.radius, kNotNegative, kMetres);
    if (in ? in->has("axis") : capstan.radius > 0) form.direction("axis", capstan.axis);
    if (in && capstan.radius > 0) form.require("axis", "of the pulley, world axes at t = 0");
  }
  static void wrap(const Form& form, std::optional<double>& wrap) {
    Fields* const in = form.in();
    if (in && !in->has("wrap_deg") && !in->has("wrap_rad")) return;
    if (in) wrap = 0;
    if (wrap) form.angle("wrap_", *wrap);
    if (in && *wrap < 0) in->wrong(in->has("wrap_deg") ? "wrap_deg" : "wrap_rad", "must be >= 0");
  }
};

}  // namespace

TETHER_EFFECT(capstan, CapstanEffect)

}  // namespace tether::scene::effects
