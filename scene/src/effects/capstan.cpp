// Tether: friction of cables at rings and pulleys. SPDX-License-Identifier: BSD-3-Clause
#include "cable.hpp"

#include <tether/linalg/pi.hpp>

#include "numbers.hpp"

namespace tether::scene::effects {

CapstanSlip::CapstanSlip(const Spring& spring, std::size_t number, const Bodies& bodies)
    : item_(spring, number, bodies), law_(*spring.cable->capstan) {
  axis_ = direction_in(item_.frame(bodies, at(law_.ring)), law_.axis);
}

// |u - v| / |u + v| is the tangent of half the angle between the pieces.
double CapstanSlip::bound(const Bodies& bodies) const {
  double wrap = law_.wrap.value_or(0);
  if (!law_.wrap) {
    const Vector3d u = item_.piece(bodies, at(law_.ring) - 1).along,
                   v = item_.piece(bodies, at(law_.ring)).along;
    wrap = 2 * std::atan2((u - v).norm(), (u + v).norm());
  }
  return CableTension(item_, bodies).tension * std::tanh(0.5 * law_.friction * wrap);
}

double CapstanSlip::rate(const Bodies& bodies) const {
  double sum = 0;
  each_load(bodies, [&](int body, const Wrench<double>& unit) {
    const Frame<double>& f = bodies.frames[at(body)];
    sum += unit.force.dot(f.v) + unit.torque.dot(f.W);
  });
  return sum;
}

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

bool rubs(const Spring& spring) { return spring.cable && spring.cable->capstan; }

struct CapstanEffect : Effect {
  void cable_fields(const Form& form, Cable& cable) const override {
    const int rings = static_cast<int>(cable.rings.size());
    form.table("capstan", cable.capstan, [&](const Form& in, Capstan& capstan) {
      in.count("ring", capstan.ring, 1, std::max(rings, 1));
      if (in.in() && rings == 0)
        in.in()->wrong("ring", "the cable has no ring between its ends to rub at");
      if (in.in() && rings > 1) in.require("ring", "which of its rings, from 1 on");
      in.require("friction", "a coefficient");
      coefficient(in, "friction", capstan.friction, {});
      wrap(in, capstan.wrap);
      in.number("radius", capstan.radius, kNotNegative, kMetres);
      if (in.in() ? in.in()->has("axis") : capstan.radius > 0) in.direction("axis", capstan.axis);
      if (in.in() && capstan.radius > 0) in.require("axis", "of the pulley, world axes at t = 0");
    });
  }
  void check(const Scene& scene, Report& report) const override {
    for (const Spring& each : scene.springs)
      if (rubs(each) && each.cable->capstan->radius > 0 &&
          at(each.cable->capstan->ring) <= each.cable->rings.size() &&
          !scene.moves(each.cable->rings[at(each.cable->capstan->ring) - 1].body))
        report.add(each.place, fmt::format("cable \"{}\": capstan.radius", each.name),
                   fmt::format("{}", each.cable->capstan->radius),
                   "is of a pulley that turns, and the body of its ring is fixed");
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
