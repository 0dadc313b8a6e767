// Tether: holds a run against the expectations of its scene. SPDX-License-Identifier: BSD-3-Clause
#include "judge.hpp"

#include <algorithm>

#include "bounds.hpp"
#include "output/binary.hpp"

namespace tether::scene {

namespace {

/// k * every, k = 1, 2, ..., up to the end (to rounding).
std::vector<double> multiples(double every, double end) {
  std::vector<double> times;
  const double count = end / every * (1 + 1e-12);
  for (long k = 1; static_cast<double>(k) <= count; ++k)
    times.push_back(static_cast<double>(k) * every);
  return times;
}

void merge(const Event& from, Event& into) {
  if (from.record && !into.record) into.time = from.time;
  into.record = into.record || from.record;
  into.expect = into.expect || from.expect;
  into.checkpoint = into.checkpoint || from.checkpoint;
  into.stop = into.stop || from.stop;
  into.end = into.end || from.end;
}

std::vector<double> three(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

/// The larger one; NaN counts as infinity.
double larger(double a, double b) {
  return std::isnan(a) || std::isnan(b) ? kInfinity : std::max(a, b);
}

/// Largest difference of a component; quaternions stand for the same orientation in both signs.
double difference(Quantity quantity, const std::vector<double>& a, const std::vector<double>& b) {
  double same = 0, opposite = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    same = larger(same, std::abs(a[i] - b[i]));
    opposite = larger(opposite, std::abs(a[i] + b[i]));
  }
  return quantity == Quantity::orientation ? std::min(same, opposite) : same;
}

/// The number that one-sided bounds apply to.
double size(const std::vector<double>& value) {
  if (value.size() == 1) return value.front();
  double square = 0;
  for (const double x : value) square += x * x;
  return std::sqrt(square);
}

/// Calls f(force on the body, slip) for its contacts, with one other body where that is named.
template <class F>
void each_contact(const Expect& expect, const Engine& engine, const F& f) {
  for (const ContactState& c : engine.contacts()) {
    const bool first = c.first == expect.body;
    if (!first && c.second != expect.body) continue;
    if (expect.against >= 0 && expect.against != (first ? c.second : c.first)) continue;
    f(first ? c.force : Eigen::Vector3d(-c.force), c.slip);
  }
}

Eigen::Vector3d contact_force(const Expect& expect, const Engine& engine) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  each_contact(expect, engine,
               [&](const Eigen::Vector3d& force, const Eigen::Vector3d&) { sum += force; });
  return sum;
}

double contact_slip(const Expect& expect, const Engine& engine) {
  double most = 0;
  each_contact(expect, engine, [&](const Eigen::Vector3d& force, const Eigen::Vector3d& slip) {
    if (!force.isZero(0)) most = std::max(most, slip.norm());
  });
  return most;
}

void exchange(binary::Archive io, std::vector<Judgement>& all, std::vector<double>& excess) {
  std::size_t k = 0;
  io.list(all, [&](Judgement& j) {
    if (io.reads()) excess.emplace_back();
    io(j.judged, j.met, j.time, j.error, excess[k++]);
    io.list(j.value, [&](double& x) { io(x); });
    io.demand(j.value.size() <= 4);
  });
}

}  // namespace

std::vector<Event> schedule(const Scene& scene, const std::vector<double>& stops) {
  std::vector<Event> all;
  const auto add = [&](double time, bool Event::*reason) {
    if (!(time > 0) || (time > scene.end && !same_time(time, scene.end))) return;
    Event event;
    event.time = time;
    event.*reason = true;
    all.push_back(event);
  };
  const double every = scene.output.every > 0 ? scene.output.every : scene.end / 1000;
  for (const double t : multiples(every, scene.end)) add(t, &Event::record);
  if (scene.output.checkpoint > 0)
    for (const double t : multiples(scene.output.checkpoint, scene.end)) add(t, &Event::checkpoint);
  for (const Expect& expect : scene.expect) add(expect.time, &Event::expect);
  for (const double t : stops) add(t, &Event::stop);
  add(scene.end, &Event::end);
  std::stable_sort(all.begin(), all.end(),
                   [](const Event& a, const Event& b) { return a.time < b.time; });
  std::vector<Event> merged;
  for (const Event& event : all)
    if (merged.empty() || !same_time(merged.back().time, event.time))
      merged.push_back(event);
    else
      merge(event, merged.back());
  return merged;
}

std::vector<double> measure(const Scene& scene, const Expect& expect, const Engine& engine,
                            double start_energy) {
  const auto index = static_cast<std::size_t>(std::max(expect.body, 0));
  const auto state = [&]() -> const BodyState& { return engine.bodies()[index]; };
  const auto diagnostics = [&] { return engine.diagnostics(); };
  const auto energy = [&] {
    const Diagnostics d = engine.diagnostics();
    return d.kinetic_energy + d.potential_energy;
  };
  const auto joint = [&] { return engine.forces().joints[static_cast<std::size_t>(expect.joint)]; };
  switch (expect.quantity) {
    case Quantity::position:
      return three(state().position);
    case Quantity::velocity:
      return three(state().velocity);
    case Quantity::orientation: {
      const Eigen::Quaterniond& q = state().orientation;
      return {q.w(), q.x(), q.y(), q.z()};
    }
    case Quantity::angular_velocity:
      return three(state().angular_velocity);
    case Quantity::distance_moved:
      return {(state().position - scene.bodies[index].position).norm()};
    case Quantity::speed:
      return {state().velocity.norm()};
    case Quantity::kinetic_energy:
      return {diagnostics().kinetic_energy};
    case Quantity::potential_energy:
      return {diagnostics().potential_energy};
    case Quantity::energy:
      return {energy()};
    case Quantity::energy_change:
      return {energy() - start_energy};
    case Quantity::momentum:
      return three(diagnostics().momentum);
    case Quantity::angular_momentum:
      return three(diagnostics().angular_momentum);
    case Quantity::drift:
      return {diagnostics().drift};
    case Quantity::contacts:
      return {static_cast<double>(diagnostics().contacts)};
    case Quantity::penetration:
      return {diagnostics().penetration};
    case Quantity::residual:
      return {diagnostics().residual};
    case Quantity::contact_force:
      return three(contact_force(expect, engine));
    case Quantity::contact_slip:
      return {contact_slip(expect, engine)};
    case Quantity::joint_force:
      return three(joint().force);
    case Quantity::joint_moment:
      return three(joint().moment);
    case Quantity::joint_drive:
      return {joint().drive};
    case Quantity::spring_force:
      return {engine.forces().springs[static_cast<std::size_t>(expect.spring)].tension};
  }
  throw std::invalid_argument("unknown quantity");
}

Judge::Judge(const Scene& scene)
    : scene_(scene), judgements_(scene.expect.size()), excess_(scene.expect.size(), -kInfinity) {
  for (std::size_t i = 0; i < scene.expect.size(); ++i)
    judgements_[i].beyond =
        scene.expect[i].time > scene.end && !same_time(scene.expect[i].time, scene.end);
}

void Judge::judge(double event, bool record, const Engine& engine, double start_energy) {
  for (std::size_t i = 0; i < scene_.expect.size(); ++i) {
    const Expect& expect = scene_.expect[i];
    const bool due = same_time(expect.time, event);
    if (!due && !(record && expect.throughout && event < expect.time)) continue;
    const std::vector<double> value = measure(scene_, expect, engine, start_energy);
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
    judgement.judged = judgement.judged || due;
    judgement.met = judgement.judged && excess_[i] <= 0;
  }
}

void Judge::save(std::ostream& out) const {
  std::vector<Judgement> all = judgements_;
  std::vector<double> excess = excess_;
  exchange(binary::Archive(out), all, excess);
}

void Judge::restore(std::istream& in) {
  std::vector<Judgement> all;
  std::vector<double> excess;
  exchange(binary::Archive(in), all, excess);
  // A scene may have gained or lost expectations: the judgements are kept only if none has.
  if (all.size() != judgements_.size()) return;
  for (std::size_t i = 0; i < all.size(); ++i) all[i].beyond = judgements_[i].beyond;
  judgements_ = std::move(all);
  excess_ = std::move(excess);
}

}  // namespace tether::scene
