// Tether: given forces and torques. SPDX-License-Identifier: BSD-3-Clause
//
//   force at the centre of mass and torque, in world axes or in those of the body, both constant
//   or with a factor
//   mean + sin(2 pi f t + phase), or that of a table, straight between its times
//
// Steps take the mean of the factor over their length: impulses of given forces are exact.
#include <tether/linalg/pi.hpp>

#include "bounds.hpp"
#include "mechanics/effect.hpp"
#include "numbers.hpp"

namespace tether::scene::effects {

namespace {

using Knot = LoadHistory::Knot;

bool is_before(const Knot& knot, double time) { return knot.time < time; }

/// From the left; from the right where the motion begins anew at t.
double value(const std::vector<Knot>& table, double t, bool anew) {
  auto after = std::lower_bound(table.begin(), table.end(), t, is_before);
  while (anew && after != table.end() && after->time == t) ++after;
  if (after == table.begin()) return after->factor;
  const Knot& a = *(after - 1);
  if (after == table.end()) return a.factor;
  return a.factor + (after->factor - a.factor) * ((t - a.time) / (after->time - a.time));
}

/// Over [from, to].
double mean(const std::vector<Knot>& table, double from, double to) {
  double sum = 0, t = from, here = value(table, from, true);
  for (auto next = std::lower_bound(table.begin(), table.end(), from, is_before);
       next != table.end() && next->time < to; ++next) {
    sum += 0.5 * (next->time - t) * (here + next->factor);
    t = next->time;
    here = next->factor;
  }
  return (sum + 0.5 * (to - t) * (here + value(table, to, false))) / (to - from);
}

double factor_of(const Load& load, const Bodies& bodies) {
  if (!load.history) return 1;
  const LoadHistory& h = *load.history;
  const double t = bodies.time, span = bodies.span;
  if (h.table.empty()) {
    const double half = linalg::kPi * h.frequency * span;
    const double part = half > 0 ? std::sin(half) / half : 1;
    return h.mean + part * std::sin(2 * linalg::kPi * h.frequency * (t + span / 2) + h.phase);
  }
  return span > 0 ? mean(h.table, t, t + span) : value(h.table, t, t == bodies.since);
}

struct LoadForce : Force {
  explicit LoadForce(std::vector<Load> loads) : loads_(std::move(loads)) {}
  const char* name() const override { return "loads"; }

  void add(const Bodies& bodies, std::vector<Load6>& loads) const override {
    for (const Load& each : loads_) {
      Load6& load = loads[at(bodies.inertia[at(each.body)].slot)];
      const double factor = factor_of(each, bodies);
      load.force += factor * in_world(each, each.force, bodies);
      load.torque_world += factor * in_world(each, each.torque, bodies);
    }
  }
  // d(R^T torque) = [R^T torque]x turn; in body axes d(R force) = -R [force]x turn
  void add_jacobian(const Bodies& bodies, JacobianBlocks& J) const override {
    for (const Load& each : loads_) {
      const int slot = bodies.inertia[at(each.body)].slot;
      const Matrix3d& R = bodies.frames[at(each.body)].R;
      const double factor = factor_of(each, bodies);
      if (each.in_body)
        J.add_turn(J.motion_row(slot, 0), slot, factor * R * skew(each.force));
      else
        J.add_turn(J.motion_row(slot, 3), slot, -factor * skew(R.transpose() * each.torque));
    }
  }
  bool has_power() const override { return true; }
  double power(const Bodies& bodies) const override {
    double sum = 0;
    for (const Load& each : loads_) {
      const Frame<double>& f = bodies.frames[at(each.body)];
      sum += factor_of(each, bodies) * (in_world(each, each.force, bodies).dot(f.v) +
                                        in_world(each, each.torque, bodies).dot(f.W));
    }
    return sum;
  }
  void add_power_jacobian(const Bodies& bodies, JacobianBlocks& J) const override {
    for (const Load& each : loads_) {
      const int slot = bodies.inertia[at(each.body)].slot;
      const Frame<double>& f = bodies.frames[at(each.body)];
      const double factor = factor_of(each, bodies);
      const Vector3d force = factor * in_world(each, each.force, bodies);
      const Vector3d torque = factor * f.R.transpose() * in_world(each, each.torque, bodies);
      for (int k = 0; k < 3; ++k) {
        J.add(J.work_row, kBody * slot + kVelocity + k, -force[k]);
        J.add(J.work_row, kBody * slot + kSpin + k, -torque[k]);
      }
      const Vector3d turn = each.in_body
                                ? Vector3d(factor * each.force.cross(f.R.transpose() * f.v))
                                : bodies.w[at(each.body)].cross(torque);
      const Eigen::RowVector4d q = turn.transpose() * bodies.turns[at(slot)];
      for (int k = 0; k < 4; ++k) J.add(J.work_row, kBody * slot + kQuaternion + k, -q[k]);
    }
  }

 private:
  static Vector3d in_world(const Load& load, const Vector3d& u, const Bodies& bodies) {
    return load.in_body ? Vector3d(bodies.frames[at(load.body)].R * u) : u;
  }

  std::vector<Load> loads_;  // on bodies that move
};

void read_table(Fields& in, std::optional<LoadHistory>& history) {
  std::vector<Knot> table;
  for (const auto& [time, factor] : in.pairs("table", kMostListed)) table.push_back({time, factor});
  const auto earlier = [](const Knot& a, const Knot& b) { return a.time < b.time; };
  if (!table.empty() && std::is_sorted(table.begin(), table.end(), earlier))
    history.emplace().table = std::move(table);
  else
    in.wrong("table", fmt::format("must be an array of up to {} [time (s), factor], no time before "
                                  "the one above it",
                                  kMostListed));
}

void history_fields(const Form& form, std::optional<LoadHistory>& history) {
  if (Fields* in = form.in(); in && in->has("table")) {
    if (in->has("sine")) return in->wrong("table", "give sine or table, not both");
    return read_table(*in, history);
  }
  if (!history || history->table.empty())
    return form.table("sine", history, [](const Form& sine, LoadHistory& h) {
      sine.number("mean", h.mean, kAny, "part of the load");
      sine.number("frequency", h.frequency, kNotNegative, kHertz);
      sine.angle("phase_", h.phase);
    });
  std::vector<std::array<double, 2>> rows;
  for (Knot& knot : history->table) {
    if (form.units()) knot.time /= form.units()->time;
    rows.push_back({knot.time, knot.factor});
  }
  if (form.out()) form.out()->field("table", rows);
}

struct LoadEffect : Effect {
  void fields(const Form& root, Scene& scene) const override {
    root.each("load", scene.loads, [](const Form& form, Load& load) {
      form.body("body", load.body);
      form.vector("force", load.force, kForce);
      form.vector("torque", load.torque, kMoment);
      form.require_one("force", "torque", "give force (N), torque (N m) or both");
      if (form.in()) load.in_body = form.in()->choice("axes", {"world", "body"}) == 1;
      if (form.out()) form.out()->field("axes", std::string(load.in_body ? "body" : "world"));
      history_fields(form, load.history);
      return true;
    });
  }
  void check(const Scene& scene, Report& report) const override {
    for (const Load& load : scene.loads)
      if (scene.bodies[at(load.body)].fixed)
        report.add(load.place, "load: body",
                   fmt::format("\"{}\"", scene.bodies[at(load.body)].name), "must be able to move");
    for (const Load& load : scene.loads)
      if (load.history)
        check_frequency(scene, load.history->frequency, load.place, "load: sine: frequency",
                        report);
  }
  void plan(const Scene& scene, EngineKind, Lines& lines) const override {
    const auto in_time =
        count_if(scene.loads, [](const Load& load) { return load.history.has_value(); });
    const auto in_body = count_if(scene.loads, [](const Load& load) { return load.in_body; });
    add_count(lines, "loads", scene.loads.size(), "load",
              (in_body > 0 ? fmt::format(", {} of them in axes of bodies", in_body) : "") +
                  (in_time > 0 ? fmt::format(", {} of them change with time", in_time) : ""));
  }
  void take_rates(const Scene& scene, double length, double mass, Largest& rate) const override {
    for (const Load& load : scene.loads) {
      rate.take(std::sqrt(load.force.norm() / (mass * length)));
      rate.take(std::sqrt(load.torque.norm() / (mass * length * length)));
      // Not its frequency: a fast sine hardly moves a body, and tolerances of speeds that large
      // would not see it.
    }
  }
  void add_kinks(const Scene& scene, std::vector<double>& times) const override {
    for (const Load& load : scene.loads)
      if (load.history)
        for (const Knot& knot : load.history->table) times.push_back(knot.time);
  }
  void limit_momenta(Momenta& momenta) const override {
    for (const Load& load : momenta.scene.loads) {
      if (load.history)
        momenta.push("a load that changes with time");
      else if (load.in_body)
        momenta.push("a load that turns with its body");
      else if (!momenta.is_outside(load.body))
        momenta.steady_force += load.force;
      momenta.axes.none("a load");
    }
  }
  bool does_work(const Scene& scene) const override { return !scene.loads.empty(); }
  std::unique_ptr<Force> make_force(const Scene& scene, const Bodies& bodies) const override {
    std::vector<Load> loads;
    for (const Load& each : scene.loads)
      if (bodies.moves(each.body)) loads.push_back(each);
    return loads.empty() ? nullptr : std::make_unique<LoadForce>(std::move(loads));
  }
};

}  // namespace

TETHER_EFFECT(loads, LoadEffect)

}  // namespace tether::scene::effects
