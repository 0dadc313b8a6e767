// Tether: contact between bodies of two materials. SPDX-License-Identifier: BSD-3-Clause
//
// The stepping engine takes contact from tether::contact. A pair that no table names is an error
// where bodies of it can touch: nothing is mixed from single materials.
#include "bounds.hpp"
#include "mechanics/effect.hpp"

namespace tether::scene::effects {

namespace {

using Materials = std::pair<std::string, std::string>;

void read_pair(Fields& in, const Reader& r, Pair& pair) {
  const std::vector<std::string> both =
      r.names(in, "between", 2, 2, "two names of materials, e.g. [\"card\", \"table\"]",
              "no body has the material", r.materials);
  if (both.empty()) return;
  pair.first = both[0];
  pair.second = both[1];
  pair.touch = in.flag("touch", pair.touch);
  for (const char* key : {"friction", "restitution"})
    if (!pair.touch && in.has(key)) in.wrong(key, "is of a contact, and touch = false has none");
}

struct ContactEffect : Effect {
  void pair_fields(const Form& form, Pair& pair) const override {
    if (form.in()) return read_pair(*form.in(), *form.reader(), pair);
    if (!form.out()) return;
    form.out()->field("between", std::array{pair.first, pair.second});
    if (!pair.touch) form.flag("touch", pair.touch);
  }
  void check(const Scene& scene, Report& report) const override {
    if (scene.pairs.empty()) return;  // nothing touches
    std::set<Materials> named;
    for (const Pair& pair : scene.pairs)
      if (!named.insert(std::minmax(pair.first, pair.second)).second)
        report.add(pair.place, "pair: between", toml(std::array{pair.first, pair.second}),
                   "another [[pair]] has the same materials");

    // How many bodies have a material, and how many of these move.
    struct Count {
      int all = 0, moving = 0;
      Place place;
    };
    std::map<std::string, Count> materials;
    for (const Body& body : scene.bodies) {
      if (body.material.empty()) continue;
      Count& of = materials[body.material];
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
        const Materials both = std::minmax(first, second);
        const auto& [low, high] = both;
        if (named.count(both) > 0) continue;
        report.add(
            std::max(a.place.line, b.place.line) == a.place.line ? a.place : b.place, "material",
            fmt::format("\"{}\"", high),
            fmt::format("bodies of \"{0}\" and \"{1}\" can touch, but no [[pair]] says between "
                        "= [\"{0}\", \"{1}\"] (nothing is mixed from single materials)",
                        low, high));
      }
    }
  }
  void plan(const Scene& scene, EngineKind, Lines& lines) const override {
    const auto count = count_if(scene.pairs, [](const Pair& pair) { return pair.touch; });
    if (count == 0) return;
    std::size_t triangles = 0;
    for (const Body& body : scene.bodies)
      for (const Shape& shape : body.shapes) triangles += shape.triangles.size();
    std::string detail = counted(count, "pair") + " of materials";
    if (triangles > 0) detail += ", " + counted(triangles, "triangle");
    lines.push_back({"contact", detail});
  }
  void add_columns(const Scene& scene, std::vector<Column>& columns) const override {
    const auto add = [&](const char* name, auto value) {
      columns.push_back({name, [value](const Diagnostics& d, const Forces&) { return value(d); }});
    };
    add("contacts", [](const Diagnostics& d) { return static_cast<double>(d.contacts); });
    add("penetration_m", [](const Diagnostics& d) { return d.penetration; });
    add("residual", [](const Diagnostics& d) { return d.residual; });
    if (!scene.output.forces || scene.pairs.empty()) return;
    std::size_t count = 0;
    for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
      const Body& body = scene.bodies[i];
      if (body.fixed || body.material.empty() || ++count > kMostInColumns) continue;
      add_columns_of(
          body.name + ".contact_f*_N", [i](const Forces& f) { return f.contact[i]; }, columns);
      add_columns_of(
          body.name + ".contact_m*_N_m", [i](const Forces& f) { return f.contact_moment[i]; },
          columns);
    }
  }
};

}  // namespace

TETHER_EFFECT(contact, ContactEffect)

}  // namespace tether::scene::effects
