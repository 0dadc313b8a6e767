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
#include "mechanics/pair_forces.hpp"
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

/// A load on a body, which the world exerts.
struct LoadItem {
  int first, second;
  Load load;

  template <class S>
  Vector3<S> in_world(const Vector3d& u, const Frame<S>& B) const {
    return load.in_body ? times(B.R, u) : Vector3<S>(S(u[0]), S(u[1]), S(u[2]));
  }
  template <class S>
  void pull(const Bodies& now, const Frame<S>&, const Frame<S>& B, bool all, Wrench<S>&,
            Wrench<S>& on_second) const {
    if (!all) return;
    const double factor = factor_of(load, now);
    const Vector3<S> force = in_world(load.force, B), torque = in_world(load.torque, B);
    for (int i = 0; i < 3; ++i) {
      on_second.force[i] += factor * force[i];
      on_second.torque[i] += factor * torque[i];
    }
  }
  double potential(const Bodies&, const Frame<double>&, const Frame<double>&) const { return 0; }
  bool works() const { return true; }
  template <class S>
  S power(const Bodies& now, const Frame<S>&, const Frame<S>& B) const {
    return S(factor_of(load, now) *
             (dot(in_world(load.force, B), B.v) + dot(in_world(load.torque, B), B.W)));
  }
};

struct LoadForce : PairForces<LoadItem> {
  LoadForce(const Scene& scene, const Bodies& bodies) {
    for (const Load& each : scene.loads)
      if (bodies.moves(each.body)) push_back({bodies.world(), each.body, each});
  }
  const char* name() const override { return "loads"; }
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
    return scene.loads.empty() ? nullptr : std::make_unique<LoadForce>(scene, bodies);
  }
};

}  // namespace

TETHER_EFFECT(loads, LoadEffect)

}  // namespace tether::scene::effects
