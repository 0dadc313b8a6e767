// Tether: cables through rings. SPDX-License-Identifier: BSD-3-Clause
//
// With the tension T of cable.hpp: potential k s^2 / 2 where s > 0,
//   power -(T - k s) dL/dt - k s winch of what has no potential
#include "cable.hpp"
#include "list.hpp"

namespace tether::scene::effects {

namespace {

struct CableForces : Force {
  CableForces(const Scene& scene, const Bodies& bodies) {
    for (std::size_t i = 0; i < scene.springs.size(); ++i) {
      const Spring& each = scene.springs[i];
      if (!each.cable) continue;
      items_.emplace_back(each, i, bodies);
    }
  }
  const char* name() const override { return "cables"; }

  void add(const Bodies& bodies, std::vector<Load6>& loads) const override {
    for (const CableItem& each : items_) {
      const double T = CableTension(each, bodies).tension;
      each_wrench(bodies, each, T, [&](int body, const Wrench<double>& wrench) {
        put_wrench(bodies, body, wrench, loads);
      });
    }
  }
  // T d(along) of each piece, and along dT, which depends on all points.
  void add_jacobian(const Bodies& bodies, JacobianBlocks& J) const override {
    for (const CableItem& each : items_) {
      const Slopes slopes = slopes_of(bodies, each);
      const CableTension now(each, bodies);
      for (std::size_t k = 0; k + 1 < each.points.size(); ++k) {
        const auto [A, B] = seed_pair(bodies, each.points[k].body, each.points[k + 1].body);
        const Piece<Dual> piece(A, each.points[k].at, B, each.points[k + 1].at);
        Wrench<Dual> a = no_wrench<Dual>(), b = a;
        piece.pull(A, B, now.tension, a, b);
        const int first = each.points[k].body, second = each.points[k + 1].body;
        put_wrench(bodies, first, second, first, A, a, J);
        put_wrench(bodies, first, second, second, B, b, J);
      }
      each_wrench(bodies, each, 1, [&](int body, const Wrench<double>& unit) {
        if (!bodies.moves(body)) return;
        const Vector3d torque = bodies.frames[at(body)].R.transpose() * unit.torque;
        for (int i = 0; i < 6; ++i)
          add_slopes(
              bodies, each, J.motion_row(bodies.inertia[at(body)].slot, i),
              i < 3 ? -unit.force[i] : -torque[i - 3], J, [&](std::size_t p) {
                return Derivatives(now.by_length * slopes.length[p] + now.by_rate * slopes.rate[p]);
              });
      });
    }
  }
  double potential(const Bodies& bodies) const override {
    double sum = 0;
    for (const CableItem& each : items_) {
      const CableTension now(each, bodies.time + bodies.span, each.measured(bodies).first, 0);
      sum += 0.5 * now.elastic * std::max(0.0, now.stretch);
    }
    return sum;
  }
  void add_potential_gradient(const Bodies& bodies, double* row) const override {
    for (const CableItem& each : items_)
      each_wrench(
          bodies, each, CableTension(each, bodies).elastic,
          [&](int body, const Wrench<double>& wrench) { put_gradient(bodies, body, wrench, row); });
  }
  bool has_power() const override {
    return any_of(items_, [](const CableItem& s) { return s.damping > 0 || s.winch != 0; });
  }
  double power(const Bodies& bodies) const override {
    double sum = 0;
    for (const CableItem& each : items_) {
      const double rate = each.measured(bodies).second;
      const CableTension now(each, bodies);
      sum -= (now.tension - now.elastic) * rate + now.elastic * each.winch;
    }
    return sum;
  }
  void add_power_jacobian(const Bodies& bodies, JacobianBlocks& J) const override {
    for (const CableItem& each : items_) {
      const Slopes slopes = slopes_of(bodies, each);
      const double rate = each.measured(bodies).second;
      const CableTension now(each, bodies);
      const double by_length =
          (now.by_length - now.elastic_by_length) * rate + now.elastic_by_length * each.winch;
      const double by_rate = now.by_rate * rate + now.tension - now.elastic;
      add_slopes(bodies, each, J.work_row, 1, J, [&](std::size_t p) {
        return Derivatives(by_length * slopes.length[p] + by_rate * slopes.rate[p]);
      });
    }
  }
  void report(const Bodies& bodies, Forces& forces) const override {
    for (const CableItem& each : items_) {
      const CablePoint &a = each.points.front(), &b = each.points.back();
      report_tension(
          each.index,
          {CableTension(each, bodies).tension, point<0>(bodies.frames[at(a.body)], a.at).x,
           point<0>(bodies.frames[at(b.body)], b.at).x},
          forces);
    }
  }
  // |dL/dx| is at most 1 at an end and 2 at a ring, and adds up over the points of a body.
  void check_step(const Scene& scene, const Bodies& bodies, double dt) const override {
    for (const CableItem& each : items_) {
      std::map<int, double> root;
      for (std::size_t p = 0; p < each.points.size(); ++p)
        root[each.points[p].body] +=
            (p == 0 || p + 1 == each.points.size() ? 1 : 2) *
            std::sqrt(softness(bodies, each.points[p].body, each.points[p].at));
      double inverse = 0;
      for (const auto& [body, sum] : root) inverse += sum * sum;
      check_tension_step(scene, scene.springs[each.index], inverse, dt);
    }
  }
  // As springs: what damps sees the velocities at the end of the last step.
  void step(SteppedBodies& stepped, double dt) const override {
    const Bodies& bodies = stepped.before_forces();
    for (const CableItem& each : items_) {
      const auto [length, rate] = each.measured(bodies);
      const CableTension now(each, stepped.bodies().time, length, rate);
      each_wrench(bodies, each, 1, [&](int body, const Wrench<double>& unit) {
        stepped.push(body, dt, now.elastic * unit.force, now.elastic * unit.torque);
        const double damps = now.tension - now.elastic;
        stepped.damp(body, dt, damps * unit.force, damps * unit.torque);
      });
    }
  }

 private:
  /// Derivatives of length and rate to the 12 directions of the body of each point, in front.
  struct Slopes {
    std::vector<Derivatives> length, rate;
  };

  template <class Do>
  static void each_wrench(const Bodies& bodies, const CableItem& each, double T, const Do& act) {
    each.each_wrench(
        bodies, [T](std::size_t) { return T; }, act);
  }
  static Slopes slopes_of(const Bodies& bodies, const CableItem& each) {
    Slopes out;
    out.length.assign(each.points.size(), Derivatives::Zero());
    out.rate = out.length;
    const auto add_parts = [](const Dual& value, Derivatives& first, Derivatives& second) {
      first.head<kBodyDirections>() += value.derivatives().head<kBodyDirections>();
      second.head<kBodyDirections>() += value.derivatives().tail<kBodyDirections>();
    };
    for (std::size_t k = 0; k + 1 < each.points.size(); ++k) {
      const auto [A, B] = seed_pair(bodies, each.points[k].body, each.points[k + 1].body);
      const Piece<Dual> piece(A, each.points[k].at, B, each.points[k + 1].at);
      add_parts(piece.length, out.length[k], out.length[k + 1]);
      add_parts(piece.rate, out.rate[k], out.rate[k + 1]);
    }
    return out;
  }
  template <class Of>
  static void add_slopes(const Bodies& bodies, const CableItem& each, int row, double factor,
                         JacobianBlocks& J, const Of& of) {
    for (std::size_t p = 0; p < each.points.size(); ++p)
      J.add_body(row, bodies, each.points[p].body, of(p), 0, factor);
  }

  std::vector<CableItem> items_;
};

/// Bodies and places of its ends and rings, in order.
std::vector<Ring> cable_points(const Spring& spring) {
  std::vector<Ring> all = spring.cable->rings;
  all.insert(all.begin(), Ring{spring.first, spring.at});
  all.push_back({spring.second, spring.at_second});
  return all;
}

constexpr std::size_t kMostPoints = 1000;

struct CableEffect : Effect {
  void fields(const Form& root, Scene& scene) const override {
    const auto one = [](const Form& form, Spring& spring) {
      if (form.in()) spring.cable.emplace();
      form.name("cable", spring.name);
      const bool whole = places(form, spring);
      form.require("stiffness", "a number > 0 (N/m)");
      form.number("stiffness", spring.stiffness, kPositive, kStiffness);
      form.number("damping", spring.damping, kNotNegative, kDamping);
      form.number("length", spring.rest, kPositive, kMetres);
      form.number("winch", spring.cable->winch, kAny, kSpeed);
      for (const Effect* each : all()) each->cable_fields(form, *spring.cable);
      return whole;
    };
    root.each("cable", scene.springs, one, is_cable);
  }
  void check(const Scene& scene, Report& report) const override {
    std::set<std::string> names;
    for (const Spring& each : scene.springs)
      if (!each.cable) names.insert(each.name);
    for (const Spring& each : scene.springs) {
      if (!each.cable) continue;
      const std::string path = fmt::format("cable \"{}\"", each.name);
      check_name(each, "cable", names, report);
      const std::vector<Ring> points = cable_points(each);
      double length = 0;
      bool apart = true, pulls = false;
      for (std::size_t k = 0; k + 1 < points.size(); ++k) {
        const double piece = (points[k + 1].at - points[k].at).norm();
        length += piece;
        apart = apart && piece > 0;
        pulls = pulls || (points[k].body != points[k + 1].body &&
                          (scene.moves(points[k].body) || scene.moves(points[k + 1].body)));
      }
      if (!apart)
        report.add(each.place, path + ": at", "", "a point must not be where the one before is");
      if (!pulls)
        report.add(each.place, path + ": bodies", "",
                   "a piece of it must join two bodies, one of which can move");
      if (!(each.rest.value_or(length) + each.cable->winch * scene.end > 0))
        report.add(each.place, path + ": winch", fmt::format("{}", each.cable->winch),
                   fmt::format("leaves no length before the end, {} s", scene.end));
    }
  }
  void plan(const Scene& scene, EngineKind, Lines& lines) const override {
    int cables = 0;
    std::size_t rings = 0;
    for (const Spring& each : scene.springs) {
      cables += each.cable.has_value();
      if (each.cable) rings += each.cable->rings.size();
    }
    add_count(lines, "cables", cables, "cable",
              rings > 0 ? " through " + counted(rings, "ring") : "");
  }
  void take_lengths(const Scene& scene, Largest& length) const override {
    for (const Spring& spring : scene.springs) {
      if (!spring.cable) continue;
      for (const Ring& ring : spring.cable->rings) {
        take_arm(scene, ring.body, ring.at, length);
        length.take((ring.at - spring.at).norm());
      }
    }
  }
  void take_rates(const Scene& scene, double length, double, Largest& rate) const override {
    for (const Spring& spring : scene.springs)
      if (spring.cable) rate.take(std::abs(spring.cable->winch) / length);
  }
  // Several points of the world pull in directions that change: no axis is left.
  void limit_momenta(Momenta& momenta) const override {
    for (const Spring& spring : momenta.scene.springs) {
      if (!spring.cable) continue;
      std::vector<Vector3d> outside;
      for (const Ring& each : cable_points(spring))
        if (momenta.is_outside(each.body)) outside.push_back(each.at);
      if (outside.empty()) continue;
      const std::string what = "cable \"" + spring.name + "\"";
      momenta.push(what);
      for (const Vector3d& each : outside)
        momenta.force_through(each, 1e-12, what + " holds from outside");
    }
  }
  bool does_work(const Scene& scene) const override {
    return any_of(scene.springs,
                  [](const Spring& each) { return each.cable && each.cable->winch != 0; });
  }
  std::unique_ptr<Force> make_force(const Scene& scene, const Bodies& bodies) const override {
    return any_of(scene.springs, is_cable) ? std::make_unique<CableForces>(scene, bodies) : nullptr;
  }

 private:
  /// The points and their bodies, from end to end; false: they are missing or wrong.
  static bool places(const Form& form, Spring& spring) {
    if (form.in()) return read_places(*form.in(), *form.reader(), spring);
    std::vector<int> bodies;
    std::vector<Vector3d> points;
    for (const Ring& each : cable_points(spring)) {
      bodies.push_back(each.body);
      points.push_back(each.at);
    }
    if (form.out()) {
      form.out()->raw("bodies", names(form.scene(), bodies));
      form.out()->raw("at", toml(points), "m");
    } else {
      for (Vector3d& each : points) each /= form.units()->length;
      put_places(bodies, points, spring);
    }
    return true;
  }
  static bool read_places(Fields& in, const Reader& r, Spring& spring) {
    const std::vector<int> bodies = r.several_bodies(
        in, 2, kMostPoints, "names of bodies, one for each point; \"world\" is the ground");
    if (!in.has("at")) in.missing("at", "points from end to end, world, m");
    const std::vector<Vector3d> points = in.points("at", 2, kMostPoints);
    if (bodies.empty() || points.empty()) return false;
    if (bodies.size() == points.size()) {
      put_places(bodies, points, spring);
      return true;
    }
    in.wrong("at", fmt::format("must be {} points, one for each of bodies", bodies.size()));
    return false;
  }
  static void put_places(const std::vector<int>& bodies, const std::vector<Vector3d>& points,
                         Spring& spring) {
    spring.first = bodies.front();
    spring.at = points.front();
    spring.second = bodies.back();
    spring.at_second = points.back();
    spring.cable->rings.clear();
    for (std::size_t k = 1; k + 1 < points.size(); ++k)
      spring.cable->rings.push_back({bodies[k], points[k]});
  }
};

}  // namespace

TETHER_EFFECT(cables, CableEffect)

}  // namespace tether::scene::effects
