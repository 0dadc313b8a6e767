// Tether: holds a run against the expectations of its scene. SPDX-License-Identifier: BSD-3-Clause
#include "judge.hpp"

#include <algorithm>

#include "bounds.hpp"

namespace tether::scene {

namespace {

using Eigen::Vector3d;
using Value = std::vector<double>;

/// The larger one; NaN counts as infinity.
double larger(double a, double b) {
  return std::isnan(a) || std::isnan(b) ? kInfinity : std::max(a, b);
}

/// Largest difference of a component; quaternions stand for the same orientation in both signs.
double difference(Quantity quantity, const Value& a, const Value& b) {
  double same = 0, opposite = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    same = larger(same, std::abs(a[i] - b[i]));
    opposite = larger(opposite, std::abs(a[i] + b[i]));
  }
  return quantity == Quantity::orientation ? std::min(same, opposite) : same;
}

/// The number that one-sided bounds apply to.
double size(const Value& value) {
  if (value.size() == 1) return value.front();
  double square = 0;
  for (const double x : value) square += x * x;
  return std::sqrt(square);
}

/// The engine as an expectation sees it.
struct Seen {
  const Scene& scene;
  const Expect& expect;
  const Engine& engine;
  double start_energy;

  std::size_t index() const { return static_cast<std::size_t>(std::max(expect.body, 0)); }
  const BodyState& body() const { return engine.bodies()[index()]; }
  Diagnostics d() const { return engine.diagnostics(); }
  double energy() const {
    const Diagnostics now = d();
    return now.kinetic_energy + now.potential_energy;
  }
  JointForce joint() const {
    return engine.forces().joints[static_cast<std::size_t>(expect.joint)];
  }
  /// Sum of the forces on the body, and the largest slip of those that push, at its contacts with
  /// all bodies or with the one that is named.
  std::pair<Vector3d, double> contacts() const {
    std::pair<Vector3d, double> out(Vector3d::Zero(), 0);
    for (const ContactState& c : engine.contacts()) {
      const bool first = c.first == expect.body;
      if (!first && c.second != expect.body) continue;
      if (expect.against >= 0 && expect.against != (first ? c.second : c.first)) continue;
      out.first += first ? c.force : Vector3d(-c.force);
      if (!c.force.isZero(0)) out.second = std::max(out.second, c.slip.norm());
    }
    return out;
  }
};

Value list(const Vector3d& v) { return {v.x(), v.y(), v.z()}; }
Value list(const Eigen::Quaterniond& q) { return {q.w(), q.x(), q.y(), q.z()}; }
Value list(double x) { return {x}; }

template <class F>
std::pair<const Quantity, std::function<Value(const Seen&)>> value(Quantity quantity, F f) {
  return {quantity, [f](const Seen& s) { return list(f(s)); }};
}

using Q = Quantity;
const std::map<Quantity, std::function<Value(const Seen&)>> kMeasures = {
    value(Q::position, [](const Seen& s) { return s.body().position; }),
    value(Q::velocity, [](const Seen& s) { return s.body().velocity; }),
    value(Q::orientation, [](const Seen& s) { return s.body().orientation; }),
    value(Q::angular_velocity, [](const Seen& s) { return s.body().angular_velocity; }),
    value(Q::distance_moved,
          [](const Seen& s) {
            return (s.body().position - s.scene.bodies[s.index()].position).norm();
          }),
    value(Q::speed, [](const Seen& s) { return s.body().velocity.norm(); }),
    value(Q::kinetic_energy, [](const Seen& s) { return s.d().kinetic_energy; }),
    value(Q::potential_energy, [](const Seen& s) { return s.d().potential_energy; }),
    value(Q::energy, [](const Seen& s) { return s.energy(); }),
    value(Q::energy_change, [](const Seen& s) { return s.energy() - s.start_energy; }),
    value(Q::momentum, [](const Seen& s) { return s.d().momentum; }),
    value(Q::angular_momentum, [](const Seen& s) { return s.d().angular_momentum; }),
    value(Q::drift, [](const Seen& s) { return s.d().drift; }),
    value(Q::contacts, [](const Seen& s) { return double(s.d().contacts); }),
    value(Q::penetration, [](const Seen& s) { return s.d().penetration; }),
    value(Q::residual, [](const Seen& s) { return s.d().residual; }),
    value(Q::contact_force, [](const Seen& s) { return s.contacts().first; }),
    value(Q::contact_slip, [](const Seen& s) { return s.contacts().second; }),
    value(Q::joint_force, [](const Seen& s) { return s.joint().force; }),
    value(Q::joint_moment, [](const Seen& s) { return s.joint().moment; }),
    value(Q::joint_drive, [](const Seen& s) { return s.joint().drive; }),
    value(Q::spring_force, [](const Seen& s) {
      return s.engine.forces().springs[static_cast<std::size_t>(s.expect.spring)].tension;
    })};

}  // namespace

std::vector<Event> schedule(const Scene& scene, const std::vector<double>& stops) {
  std::vector<Event> all;
  const auto add = [&](double time, Event::Reason reason) {
    if (time > 0 && (time <= scene.end || same_time(time, scene.end)))
      all.push_back({time, reason});
  };
  // k * every, k = 1, 2, ..., up to the end (to rounding).
  const auto add_grid = [&](double every, Event::Reason reason) {
    const double count = scene.end / every * (1 + kTimeRounding);
    for (long k = 1; static_cast<double>(k) <= count; ++k)
      add(static_cast<double>(k) * every, reason);
  };
  add_grid(scene.output.every > 0 ? scene.output.every : scene.end / 1000, Event::record);
  if (scene.output.checkpoint > 0) add_grid(scene.output.checkpoint, Event::checkpoint);
  for (const Expect& expect : scene.expect) add(expect.time, Event::expect);
  for (const double t : stops) add(t, Event::stop);
  add(scene.end, Event::end);
  std::stable_sort(all.begin(), all.end(),
                   [](const Event& a, const Event& b) { return a.time < b.time; });
  std::vector<Event> merged;
  for (const Event& event : all) {
    if (merged.empty() || !same_time(merged.back().time, event.time)) {
      merged.push_back(event);
      continue;
    }
    Event& into = merged.back();
    if (event.is(Event::record) && !into.is(Event::record)) into.time = event.time;
    into.reasons |= event.reasons;
  }
  return merged;
}

std::vector<double> measure(const Scene& scene, const Expect& expect, const Engine& engine,
                            double start_energy) {
  return kMeasures.at(expect.quantity)({scene, expect, engine, start_energy});
}

Judge::Judge(const Scene& scene)
    : scene_(scene), judgements_(scene.expect.size()), excess_(scene.expect.size(), -kInfinity) {
  for (std::size_t i = 0; i < scene.expect.size(); ++i)
    if (scene.expect[i].time > scene.end && !same_time(scene.expect[i].time, scene.end))
      judgements_[i].verdict = Verdict::beyond;
}

void Judge::judge(double event, bool record, const Engine& engine, double start_energy) {
  for (std::size_t i = 0; i < scene_.expect.size(); ++i) {
    const Expect& expect = scene_.expect[i];
    const bool due = same_time(expect.time, event);
    if (!due && !(record && expect.throughout && event < expect.time)) continue;
    const Value value = measure(scene_, expect, engine, start_energy);
    double error = 0, excess = -kInfinity;
    const auto over = [&](double by) { excess = larger(excess, by); };
    if (!expect.value.empty()) {
      error = difference(expect.quantity, value, expect.value);
      over(error - expect.within);
    }
    if (expect.at_most) over(size(value) - *expect.at_most);
    if (expect.at_least) over(*expect.at_least - size(value));

    Judgement& judgement = judgements_[i];
    if (excess > excess_[i] || judgement.value.empty()) {
      excess_[i] = excess;
      judgement.time = engine.time();
      judgement.value = value;
      judgement.error = error;
    }
    if (due || judgement.verdict == Verdict::met || judgement.verdict == Verdict::missed)
      judgement.verdict = excess_[i] <= 0 ? Verdict::met : Verdict::missed;
  }
}

void Judge::exchange(binary::Archive io) {
  std::vector<Judgement> all = judgements_;
  std::vector<double> excess = excess_;
  std::size_t k = 0;
  io.list(all, [&](Judgement& j) {
    if (k == excess.size()) excess.emplace_back();
    io(j.verdict, j.time, j.error, excess[k++]);
    io.list(j.value, [&](double& x) { io(x); });
    io.demand(j.value.size() <= 4 && j.verdict <= Verdict::missed);
  });
  if (all.size() != judgements_.size()) return;
  for (std::size_t i = 0; i < all.size(); ++i)  // the end of this run may be another one
    if (all[i].verdict <= Verdict::beyond) all[i].verdict = judgements_[i].verdict;
  judgements_ = std::move(all);
  excess_ = std::move(excess);
}

}  // namespace tether::scene
