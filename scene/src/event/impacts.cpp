// Tether: impacts of contacts that close (method, eq. 7). SPDX-License-Identifier: BSD-3-Clause
//
// Newton's law w_n+ = -e w_n- where impulses act, and Coulomb's cone, in one problem of all
// contacts that touch.
#include <fmt/format.h>

#include "driver.hpp"

namespace tether::scene::event {

// Method, eq. 10. Impacts k of one contact at times t_k with approach speeds w_k: where the ratios
// r of intervals and of speeds agree and stay below 1, the last of them is over at
//
//   t_k + (t_k - t_k-1) r / (1 - r).
//
// Once the remaining bounces are below the tolerance, the impact is completed without restitution.
// The normal impulses of all later impacts equal those of the closed contact over the same time.

namespace {

constexpr double kAgree = 0.05;  // of ratios

constexpr int kMostRounds = 2000;  // of one instant

}  // namespace

void Driver::remember(int contact, double approach) {
  Bounces& b = start_.bounces[at(contact)];
  if (b.count > 0 && b.time[0] == start_.time) return;
  for (int k = 2; k > 0; --k) {
    b.time[k] = b.time[k - 1];
    b.speed[k] = b.speed[k - 1];
  }
  b.time[0] = start_.time;
  b.speed[0] = approach;
  b.count = std::min(b.count + 1, 3);
}

bool Driver::has_accumulated(int contact, double approach, double& rest) const {
  const Bounces& b = start_.bounces[at(contact)];
  if (b.count < 3) return false;
  const double dt = start_.time - b.time[0], last = b.time[0] - b.time[1];
  // Numbers of thousands, as of scenes in millimetres, lose heights at higher speeds.
  const double largest = start_.y.head(motion_.coordinates()).cwiseAbs().maxCoeff();
  const bool unseen = approach * dt / 4 <= 5e-12 * largest;
  // Heights near round-off, in the units of the model.
  if (approach * approach > b.speed[0] * std::max(options_.tolerance, 1e-5) && !unseen)
    return false;
  const double r = approach / b.speed[0], previous = b.speed[0] / b.speed[1];
  if (!(r < 1 && std::abs(r - previous) < kAgree * (1 - previous) && dt > 0 &&
        std::abs(dt / last - r) < kAgree))
    return false;
  rest = dt * r / (1 - r);
  return true;
}

// The contacts that touch and move apart no faster than `speed` stay together, and those that slip
// no faster stick: by impulses in both directions, for those of the weight in the time left out.
// Returns the energy that is lost.
double Driver::come_to_rest(const std::vector<int>& touching, double speed, VectorXd& x) {
  ContactRows rows(model_, touching);
  const VectorXd w = rows.velocities(u());
  std::vector<int> slow;
  for (const ConePart& p : rows.parts()) {
    if (!p.has_normal() || std::abs(w[p.first]) > speed) continue;
    const int end = p.mu > 0 ? p.first + p.rows() : p.slip();
    for (int row = p.first; row < end; ++row)
      if (std::abs(w[row]) <= speed) slow.push_back(row);
  }
  if (slow.empty()) return 0;
  linalg::LeastSquares factor;
  factor.factor(rows.A()(slow, slow));
  x.setZero(w.size());
  x(slow) = factor.solve(-w(slow));
  return change_velocities(rows.change(x));
}

// Contacts that close and, where impacts at one instant are together, those that touch: with a
// force between them or without. What moves apart takes no part: it may be struck later.
std::vector<int> Driver::struck(const std::vector<int>& near, int first) {
  std::vector<int> out;
  bool any = false;
  const bool together = options_.simultaneous == contact::SimultaneousImpacts::together;
  for (const int i : near) {
    if (!model_.law(i).has_normal()) continue;  // bounded: no impulse
    double rate = 0;
    const double gap = model_.gap(i, rate), band = bands().approach(i);
    // Which of two corners is first may be a matter of the error of their gaps. What bounces
    // before its time would miss the way to there. Gaps are known to a tenth of their band.
    const double unknown = model_.law(i).restitution > 0 ? 0 : 0.1 * bands().gap(i);
    const bool open = motion_.modes()[at(i)].mode == Mode::open;
    const bool now = i == first || !open || gap <= std::max(-rate * options_.tolerance, unknown);
    const bool passes = open && i != first && motion_.passes_border(start_.time, start_.y, i);
    const bool hits = rate < -band && now && !passes;
    const bool rests = std::abs(rate) <= band && !passes && together;
    if (hits || rests) out.push_back(i);
    any = any || hits;
  }
  if (!any) out.clear();
  return with_moments(without_doubles(out));
}

// One impact may strike others that are near. With corners in turns there are infinitely many in no
// time: those that are too slow to count, or very many, are not resolved.
void Driver::collide(const std::vector<int>& near, EventKind otherwise, int contact) {
  for (int round = 0; round <= kMostRounds; ++round) {
    const std::vector<int> set = struck(near, round == 0 ? contact : -1);
    if (set.empty()) {
      if (round == 0 && contact >= 0) record(otherwise, contact);
      return;
    }
    if (round < kMostRounds)
      strike(set, false);
    else
      strike(with_moments(near), true);
  }
}

// Which of the contacts hit, and what their impacts restore.
Driver::Impact Driver::expect(const ContactRows& rows, const VectorXd& before, bool plastic) {
  const int n = static_cast<int>(rows.contacts().size());
  Impact out;
  out.b = -before;
  out.rest.setZero(n);
  out.hits.assign(at(n), false);
  for (int k = 0; k < n; ++k) {
    const int i = rows.contacts()[at(k)];
    const ConePart& p = rows.parts()[at(k)];
    const double approach = p.has_normal() ? -before[p.first] : 0;
    if (!p.has_normal() || approach <= bands().approach(i)) continue;
    out.hits[at(k)] = true;
    if (plastic) continue;
    if (has_accumulated(i, approach, out.rest[k])) {
      out.fastest = std::max(out.fastest, approach);
      continue;
    }
    out.b[p.first] += model_.law(i).restitution * approach;
    remember(i, approach);
  }
  return out;
}

// Contacts that close though joints hold their normals: no impulse stops that.
void Driver::refuse_blocked(const ContactRows& rows, const Impact& impact) {
  ContactKinematics kinematics;
  for (std::size_t k = 0; k < impact.hits.size(); ++k) {
    if (!impact.hits[k]) continue;
    const int contact = rows.contacts()[k], row = rows.parts()[k].first;
    model_.evaluate_contact(contact, kinematics);
    MatrixXd moved = kinematics.normal.transpose();
    model_.divide_by_mass(moved);
    const double alone = kinematics.normal.dot(moved.col(0));
    if (!(rows.A()(row, row) <= kHeldByJoints * alone)) continue;
    fail(
        fmt::format("no impulses keep {} apart: joints, prescribed motions or fixed bodies drive "
                    "them into each other",
                    model_.contact_name(contact)));
  }
}

void Driver::strike(const std::vector<int>& set, bool plastic) {
  ContactRows rows(model_, set);
  const auto u = this->u();
  const VectorXd before = rows.velocities(u);
  const Impact impact = expect(rows, before, plastic);
  refuse_blocked(rows, impact);
  ++counts_.contact_problems;
  const FrictionSolution answer = solve_impact(rows.problem(impact.b), bands().part);
  if (!answer.solved)
    fail(fmt::format("the impact of {} contacts is not solved, to {:.1e} only", set.size(),
                     answer.error));
  const VectorXd coming = struck_ ? VectorXd(u) : VectorXd();
  double lost = change_velocities(rows.change(answer.x));
  VectorXd rest;
  if (impact.fastest > 0) lost += come_to_rest(set, impact.fastest, rest);
  if (struck_) struck_(rows, answer.x, rest, coming, impact.fastest == 0 && !plastic);
  record_impacts(rows, impact, before, rows.velocities(u), answer.x, lost);
}

void Driver::record_impacts(const ContactRows& rows, const Impact& impact, const VectorXd& before,
                            const VectorXd& after, const VectorXd& x, double lost) {
  double largest = 0;
  for (const ConePart& p : rows.parts())
    if (p.has_normal()) largest = std::max(largest, x[p.first]);
  bool first = true;
  for (int k = 0; k < static_cast<int>(rows.parts().size()); ++k) {
    const ConePart& p = rows.parts()[at(k)];
    if (!p.has_normal() || (!impact.hits[at(k)] && x[p.first] <= kNoForce * largest)) continue;
    if (impact.hits[at(k)]) ++counts_.impacts;
    const bool over = impact.rest[k] > 0;
    const int contact = rows.contacts()[at(k)];
    record(over ? EventKind::rest : EventKind::impact, contact, before[p.first], after[p.first],
           first ? lost : 0);
    events_.back().impulse = model_.in_space(contact, rows.of(k, x));
    if (over) events_.back().time = start_.time + impact.rest[k];
    first = false;
  }
}

// By Coulomb's law for accelerations (method, section 6), see solve_accelerations.

std::vector<ContactMode> Driver::decide(const std::vector<int>& touching, const Left& left,
                                        bool may_jam) {
  std::vector<ContactMode> modes(at(model_.contacts()));
  set_model();
  const std::vector<int> candidates = staying(touching, left);
  if (candidates.empty()) return modes;
  ContactRows rows(model_, candidates);
  const VectorXd velocities = rows.velocities(u());
  const std::vector<VectorXd> slides = slides_of(rows, velocities, left);
  ++counts_.contact_problems;
  std::vector<bool> closed;
  for (const int i : candidates) closed.push_back(motion_.modes()[at(i)].mode != Mode::open);
  const AccelerationSolution answer =
      solve_accelerations(rows, slides, bands().of_accelerations(), closed);
  if (!answer.contacts.solved) fail("the forces of closed contacts are not solved");
  const int n = static_cast<int>(candidates.size());
  for (int k = 0; k < n && may_jam; ++k)
    if (slides[at(k)].size() > 0 && answer.contacts.regimes[at(k)] == contact::Regime::sticking &&
        rows.parts()[at(k)].slip_of(velocities).norm() > bands().slip(candidates[at(k)])) {
      jam(rows, velocities);
      return decide(this->touching(-1), {}, false);
    }
  for (int k = 0; k < n; ++k) {
    const int i = candidates[at(k)], by = model_.law(i).held_by;
    if (by >= 0 ? modes[at(by)].mode == Mode::open : lifts(rows, k, answer)) continue;
    modes[at(i)] = slides[at(k)].size() > 0 ? ContactMode{Mode::slide, slides[at(k)]}
                                            : begins(rows, k, answer, left);
  }
  return modes;
}

// Contacts that touch and stay where they are; what is left is not among them.
std::vector<int> Driver::staying(const std::vector<int>& touching, const Left& left) {
  std::vector<int> out;
  double rate = 0;
  for (const int i : touching) {
    if (i == left.contact && left.by == Watch::border) continue;
    if (left.by == Watch::normal_force && are_one(i, left.contact)) continue;
    model_.gap(i, rate);
    if (std::abs(rate) <= bands().approach(i) && !leaves_its_feature(i)) out.push_back(i);
  }
  for (const int i : out) {
    const std::string why = model_.undecided(i);
    if (!why.empty()) fail(why);
  }
  return with_moments(without_doubles(out));
}

// Directions of what slides; empty for what does not.
std::vector<VectorXd> Driver::slides_of(const ContactRows& rows, const VectorXd& velocities,
                                        const Left& left) {
  std::vector<VectorXd> out(rows.contacts().size());
  for (int k = 0; k < static_cast<int>(out.size()); ++k) {
    const int i = rows.contacts()[at(k)];
    const VectorXd slip = rows.of(k, velocities).tail(kTangents);
    if (i != left.contact || (left.by != Watch::cone && left.by != Watch::slip)) {
      if (slip.norm() > bands().slip(i)) out[at(k)] = slip.normalized();
      continue;
    }
    // The force is on the border of the cone and opposes the slip that begins.
    for (std::size_t c = 0; c < motion_.closed().size() && left.by == Watch::cone; ++c)
      if (motion_.closed()[c] == i) {
        VectorXd rate_there(motion_.size());
        motion_.rate(start_.time, start_.y.data(), rate_there.data());
        out[at(k)] = -motion_.friction_force(static_cast<int>(c)).normalized();
      }
  }
  return out;
}

// Whether a contact with a normal opens.
bool Driver::lifts(const ContactRows& rows, int k, const AccelerationSolution& answer) const {
  const ConePart& p = rows.parts()[at(k)];
  if (!p.has_normal()) return false;
  const FrictionSolution& forces = answer.contacts;
  if (forces.regimes[at(k)] == contact::Regime::separating) return true;
  bool lifted = false;
  for (int j = 0; j < model_.contacts() && !lifted; ++j)
    lifted = start_.lifted[at(j)] && are_one(rows.contacts()[at(k)], j);
  // Contacts whose forces vanish together lift together.
  const double force = forces.x[p.first];
  return lifted && (force <= kNoForce * forces.x.cwiseAbs().maxCoeff() ||
                    force * rows.A()(p.first, p.first) <= kNoForce * answer.scale);
}

// The mode of a contact that stays closed and had no slip.
ContactMode Driver::begins(const ContactRows& rows, int k, const AccelerationSolution& answer,
                           const Left& left) const {
  const int i = rows.contacts()[at(k)];
  const VectorXd a = rows.of(k, answer.contacts.w).tail(kTangents);
  // On the border of its cone a contact may be said to slide though nothing moves it.
  const bool still = a.norm() <= kNoChange * answer.scale;
  const bool sticks = answer.contacts.regimes[at(k)] == contact::Regime::sticking || still;
  ContactMode mode{Mode::slide,
                   a.norm() > 0 ? VectorXd(a.normalized()) : VectorXd::Unit(a.size(), 0)};
  const bool same = i == left.contact && left.by == Watch::slip &&
                    mode.direction.dot(motion_.modes()[at(i)].direction) > 0.5;
  if (!(model_.holding(i) > 0) || !(sticks || same)) return mode;
  return {Mode::stick, sticks ? VectorXd() : mode.direction};
}

// Forces without bound stop the slip in no time: the impulses that keep the contacts from closing
// at the least speed of approach.
void Driver::jam(const ContactRows& rows, const VectorXd& velocities) {
  FrictionProblem problem = rows.problem(-velocities);
  for (ConePart& p : problem.parts) {
    p.bound = 0;  // no impulse
    if (p.has_normal()) problem.b[p.first] = 1e-12 * velocities.cwiseAbs().maxCoeff();
  }
  ++counts_.contact_problems;
  const FrictionSolution answer = solve_friction(problem);
  if (!answer.solved) fail("an impact without collision is not solved");
  const VectorXd coming = struck_ ? VectorXd(u()) : VectorXd();
  const double lost = change_velocities(rows.change(answer.x));
  if (struck_) struck_(rows, answer.x, {}, coming, false);
  const VectorXd after = rows.velocities(u());
  bool first = true;
  for (int k = 0; k < static_cast<int>(rows.parts().size()); ++k) {
    const ConePart& p = rows.parts()[at(k)];
    if (!p.has_normal() || answer.x[p.first] <= 0) continue;
    const int contact = rows.contacts()[at(k)];
    record(EventKind::jam, contact, velocities[p.first], after[p.first], first ? lost : 0);
    events_.back().impulse = model_.in_space(contact, rows.of(k, answer.x));
    first = false;
  }
}

}  // namespace tether::scene::event
