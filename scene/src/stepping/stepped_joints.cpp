// Tether: the joints of a scene, as the contact library's steps take them.
// SPDX-License-Identifier: BSD-3-Clause
#include "stepped_joints.hpp"

namespace tether::scene::stepping {

using namespace mechanics;

SteppedJoints::SteppedJoints(const Scene& scene)
    : bodies_(scene),
      rows_(scene, bodies_.bodies()),
      reactions_(scene, bodies_.bodies()),
      laws_(scene, bodies_.bodies()) {}

void SteppedJoints::add_laws(const contact::BodySet& bodies, double t, contact::JointLaws& out) {
  bodies_.set_time(t, 0);
  bodies_.read_positions(bodies);
  laws_.add(bodies_.bodies(), out);
}

std::vector<JointForce> SteppedJoints::forces(const contact::BodySet& bodies, double t,
                                              const std::vector<double>& impulses,
                                              const std::vector<double>& law_impulses, double dt) {
  bodies_.read_positions(bodies);
  rows_.set_time(t);
  std::vector<double> multipliers(at(rows_.count()), 0);
  for (std::size_t i = 0; i < multipliers.size() && dt > 0; ++i) multipliers[i] = impulses[i] / dt;
  std::vector<JointForce> out = reactions_.find(rows_, bodies_.bodies(), multipliers.data());
  laws_.add_forces(bodies_.bodies(), law_impulses, dt, out);
  return out;
}

void SteppedJoints::values(const contact::BodySet& bodies, double t, double* g) {
  bodies_.read_positions(bodies);
  rows_.set_time(t);
  rows_.values<0>(bodies_.bodies(), g);
}

// A multiplier pulls with the gradient of its row. JointRows::each goes kind by kind, and rows are
// numbered joint by joint.
void SteppedJoints::add_rows(const contact::BodySet& bodies, double t, contact::JointRows& out) {
  bodies_.read_positions(bodies);
  rows_.set_time(t);
  const Bodies& all = bodies_.bodies();
  gradients_.resize(at(rows_.count()));
  rows_.each([&](const auto& row) {
    if (std::is_same_v<std::decay_t<decltype(row)>, joints::Relation>) return;
    const Frame<double>&A = all.frames[at(row.first)], &B = all.frames[at(row.second)];
    double unit[3] = {0, 0, 0}, by_time[3];
    row.rate_by_time(by_time);
    for (int i = 0; i < row.count; ++i) {
      unit[i] = 1;
      Wrench<double> a = no_wrench<double>(), b = no_wrench<double>();
      row.pull(A, B, unit, a, b);
      unit[i] = 0;
      gradients_[at(row.row + i)] = {row.joint, row.first, row.second, -by_time[i], a, b};
    }
  });
  const auto add = [&](int body, const Wrench<double>& w) {
    if (body == all.world()) return;
    contact::Vector6d G;
    G << w.force, w.torque;
    out.on(body, G);
  };
  const std::size_t coupled =
      rows_.couplings().empty() ? gradients_.size() : at(rows_.couplings().front().row);
  for (std::size_t row = 0; row < coupled; ++row) {
    const Gradient& each = gradients_[row];
    out.add(each.joint, each.rate);
    add(each.first, each.on_first);
    add(each.second, each.on_second);
  }
  if (coupled < gradients_.size()) add_couplings(out);
}

// The parts of a coupling may have bodies in common.
void SteppedJoints::add_couplings(contact::JointRows& out) const {
  const Bodies& all = bodies_.bodies();
  const std::vector<joints::Relation>& parts = rows_.couplings();
  std::vector<std::pair<int, contact::Vector6d>> terms;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    const joints::Relation& part = parts[k];
    const double unit = 1;
    Wrench<double> on[2] = {no_wrench<double>(), no_wrench<double>()};
    part.pull(all.frames[at(part.first)], all.frames[at(part.second)], &unit, on[0], on[1]);
    for (const int side : {0, 1}) {
      const int body = side == 0 ? part.first : part.second;
      if (body == all.world()) continue;
      contact::Vector6d G;
      G << on[side].force, on[side].torque;
      const auto same = std::find_if(terms.begin(), terms.end(),
                                     [&](const auto& term) { return term.first == body; });
      if (same == terms.end())
        terms.emplace_back(body, G);
      else
        same->second += G;
    }
    if (k + 1 < parts.size() && !parts[k + 1].is_first) continue;
    out.add(part.joint);
    for (const auto& [body, G] : terms) out.on(body, G);
    terms.clear();
  }
}

}  // namespace tether::scene::stepping
