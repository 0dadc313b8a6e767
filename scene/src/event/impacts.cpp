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
// From an impact on whose bounces nobody can see, it is completed without restitution: what the
// normal impulses of all later ones amount to is what the closed contact carries until then.

namespace {

constexpr double kAgree = 0.05;         // of ratios
constexpr double kUnresolved = 1e-5;    // m/s in the units of the model: heights near round-off
constexpr double kLeastHeight = 5e-12;  // of a flight, of the largest coordinate: the same

using linalg::at;

constexpr double kNoImpulse = 1e-9;      // of the largest of an impact
constexpr int kMostRounds = 2000;        // of one instant
constexpr double kUnknownGap = 0.1;      // of its band
constexpr double kHeldByJoints = 1e-10;  // of a normal's mobility without joints

constexpr double kNegligible = 3e-9;  // of the accelerations
constexpr double kNoForce = 1e-9;     // of the largest, and of what accelerates bodies that much
constexpr double kDependentForces = 1e-11, kImplied = 1e-9;  // of A_nn
constexpr double kLeastApproach = 1e-12;                     // of the slip

/// Whether the gap of contact k stays where those of the contacts with a force stay: which of them
/// has none is the solver's choice, and no reason to leave it open.
bool rests_on_others(const ContactRows& rows, const FrictionAnswer& answer, int k) {
  const int block = rows.size();
  std::vector<int> others;
  for (int i = 0; i < static_cast<int>(answer.regimes.size()); ++i)
    if (i != k && rows.has_normal(i) && answer.regimes[at(i)] != contact::Regime::separating)
      others.push_back(block * i);
  if (others.empty()) return false;
  const SomeRows part(rows.A(), rows.A().col(block * k), others);
  linalg::LeastSquares factor(kDependentForces);
  factor.factor(part.A);
  const double own = rows.A()(block * k, block * k);
  return own - part.b.dot(VectorXd(factor.solve(part.b))) <= kImplied * own;
}

}  // namespace

void Driver::remember(int contact, double approach) {
  Bounces& b = bounces_[at(contact)];
  if (b.count > 0 && b.time[0] == event_time_) return;
  for (int k = 2; k > 0; --k) {
    b.time[k] = b.time[k - 1];
    b.speed[k] = b.speed[k - 1];
  }
  b.time[0] = event_time_;
  b.speed[0] = approach;
  b.count = std::min(b.count + 1, 3);
}

bool Driver::has_accumulated(int contact, double approach, double& rest) const {
  const Bounces& b = bounces_[at(contact)];
  if (b.count < 3) return false;
  const double dt = event_time_ - b.time[0], last = b.time[0] - b.time[1];
  // Numbers of thousands, as of scenes in millimetres, lose heights at higher speeds.
  const double largest = y_.head(motion_.coordinates()).cwiseAbs().maxCoeff();
  const bool unseen = approach * dt / 4 <= kLeastHeight * largest;
  if (approach * approach > b.speed[0] * std::max(options_.tolerance, kUnresolved) && !unseen)
    return false;
  const double r = approach / b.speed[0], previous = b.speed[0] / b.speed[1];
  if (!(r < 1 && std::abs(r - previous) < kAgree * (1 - previous) && dt > 0 &&
        std::abs(dt / last - r) < kAgree))
    return false;
  rest = dt * r / (1 - r);
  return true;
}

// The contacts that touch and move apart no faster than `speed` stay together, and those that slip
// no faster stick: impulses in both directions. Returns the energy that is lost.
double Driver::come_to_rest(const std::vector<int>& touching, double speed) {
  ContactRows rows(model_, touching);
  const int block = rows.size();
  const VectorXd w = rows.velocities(y_.segment(motion_.coordinates(), motion_.velocities()));
  std::vector<int> slow;
  for (int k = 0; k < static_cast<int>(touching.size()); ++k) {
    if (model_.law(touching[at(k)]).is_moment() || std::abs(w[block * k]) > speed) continue;
    slow.push_back(block * k);
    if (!(model_.law(touching[at(k)]).friction > 0)) continue;
    for (int j = 1; j < block; ++j)
      if (std::abs(w[block * k + j]) <= speed) slow.push_back(block * k + j);
  }
  const int n = static_cast<int>(slow.size());
  if (n == 0) return 0;
  const SomeRows part(rows.A(), -w, slow);
  linalg::LeastSquares factor;
  factor.factor(part.A);
  const VectorXd forces = factor.solve(part.b);
  VectorXd x = VectorXd::Zero(w.size());
  for (int i = 0; i < n; ++i) x[slow[at(i)]] = forces[i];
  return change_velocities(rows.change(x));
}

// Contacts that close and, where impacts at one instant are together, those that touch: with a
// force between them or without. What moves apart takes no part: it may be struck later.
std::vector<int> Driver::struck(const std::vector<int>& near, int first) {
  std::vector<int> out;
  bool any = false;
  for (const int i : near) {
    if (!model_.law(i).has_normal()) continue;  // bounded: no impulse
    double rate = 0;
    const double gap = model_.gap(i, rate), band = bands().approach(i);
    // Which of two corners is first may be a matter of the error of their gaps. What bounces
    // before its time would miss the way to there.
    const double unknown = model_.law(i).restitution > 0 ? 0 : kUnknownGap * bands().gap(i);
    const bool open = motion_.modes()[at(i)].mode == Mode::open;
    const bool now = i == first || !open || gap <= std::max(-rate * options_.tolerance, unknown);
    const bool passes = open && i != first && motion_.passes_border(event_time_, y_, i);
    const bool hits = rate < -band && now && !passes;
    const bool rests = std::abs(rate) <= band && !passes && !options_.in_turn;
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
      if (round == 0 && contact >= 0) record(otherwise, contact, 0, 0, 0);
      return;
    }
    if (round < kMostRounds)
      strike(set, false);
    else
      strike(with_moments(near), true);
  }
}

// Which of the contacts hit, and what their impacts restore.
Driver::Impact Driver::expect(const std::vector<int>& set, const VectorXd& before, int block,
                              bool plastic) {
  const int n = static_cast<int>(set.size());
  Impact out;
  out.b = -before;
  out.mu.resize(n);
  out.rest.setZero(n);
  out.hits.assign(set.size(), false);
  for (int k = 0; k < n; ++k) {
    const int i = set[at(k)];
    const ContactLaw law = model_.law(i);
    const double approach = -before[block * k];
    out.mu[k] = law.friction;
    if (!law.has_normal() || approach <= bands().approach(i)) continue;
    out.hits[at(k)] = true;
    if (plastic) continue;
    if (has_accumulated(i, approach, out.rest[k])) {
      out.fastest = std::max(out.fastest, approach);
      continue;
    }
    out.b[block * k] += law.restitution * approach;
    remember(i, approach);
  }
  return out;
}

// Contacts that close though joints hold their normals: no impulse stops that.
void Driver::refuse_blocked(const std::vector<int>& set, const Impact& impact, const MatrixXd& A) {
  const Eigen::Index block = A.rows() / static_cast<Eigen::Index>(set.size());
  ContactLook look;
  for (std::size_t k = 0; k < set.size(); ++k) {
    if (!impact.hits[k]) continue;
    model_.look(set[k], look);
    MatrixXd moved = look.normal.transpose();
    model_.divide_by_mass(moved);
    const double alone = look.normal.dot(moved.col(0));
    const auto row = block * static_cast<Eigen::Index>(k);
    if (!(A(row, row) <= kHeldByJoints * alone)) continue;
    fail(
        fmt::format("no impulses keep {} apart: joints, prescribed motions or fixed bodies drive "
                    "them into each other",
                    model_.contact_name(set[k])));
  }
}

void Driver::strike(const std::vector<int>& set, bool plastic) {
  ContactRows rows(model_, set);
  const auto u = y_.segment(motion_.coordinates(), motion_.velocities());
  const VectorXd before = rows.velocities(u);
  const Impact impact = expect(set, before, rows.size(), plastic);
  refuse_blocked(set, impact, rows.A());
  ++counts_.contact_problems;
  const FrictionAnswer answer =
      solve_impact(rows.A(), impact.b, impact.mu, bands().part, rows.holders());
  if (!answer.solved)
    fail(fmt::format("the impact of {} contacts is not solved, to {:.1e} only", set.size(),
                     answer.error));
  double lost = change_velocities(rows.change(answer.x));
  if (impact.fastest > 0) lost += come_to_rest(set, impact.fastest);
  tell_impacts(set, impact, before, rows.velocities(u), answer.x, lost);
}

// Returns the energy that is lost.
double Driver::change_velocities(const VectorXd& change) {
  const double energy = model_.energy();
  y_.segment(motion_.coordinates(), motion_.velocities()) += change;
  model_.set(event_time_, y_.data(), y_.data() + motion_.coordinates());
  return energy - model_.energy();
}

void Driver::tell_impacts(const std::vector<int>& touching, const Impact& impact,
                          const VectorXd& before, const VectorXd& after, const VectorXd& x,
                          double lost) {
  const int n = static_cast<int>(touching.size()), block = static_cast<int>(x.size()) / n;
  double largest = 0;
  for (int k = 0; k < n; ++k) largest = std::max(largest, x[block * k]);
  bool first = true;
  for (int k = 0; k < n; ++k) {
    if (!impact.hits[at(k)] && x[block * k] <= kNoImpulse * largest) continue;
    if (impact.hits[at(k)]) ++counts_.impacts;
    const bool over = impact.rest[k] > 0;
    record(over ? EventKind::rest : EventKind::impact, touching[at(k)], before[block * k],
           after[block * k], first ? lost : 0);
    events_.back().impulse = model_.in_space(touching[at(k)], x.segment(block * k, block));
    if (over) events_.back().time = event_time_ + impact.rest[k];
    first = false;
  }
}

// By Coulomb's law for accelerations (method, section 6), see solve_accelerations.

std::vector<ContactMode> Driver::decide(const std::vector<int>& touching, int left_contact,
                                        std::optional<Watch> left) {
  std::vector<ContactMode> modes(at(model_.contacts()));
  const VectorXd u = y_.segment(motion_.coordinates(), motion_.velocities());
  model_.set(event_time_, y_.data(), y_.data() + motion_.coordinates());
  std::vector<int> candidates;
  double rate = 0;
  for (const int i : touching) {
    if (i == left_contact && left == Watch::border) continue;
    if (left == Watch::normal_force && are_one(i, left_contact)) continue;
    model_.gap(i, rate);
    if (std::abs(rate) <= bands().approach(i) && !leaves_its_feature(i)) candidates.push_back(i);
  }
  if (candidates.empty()) return modes;
  for (const int i : candidates) {
    const std::string why = model_.undecided(i);
    if (!why.empty()) fail(why);
  }
  candidates = with_moments(without_doubles(candidates));
  ContactRows rows(model_, candidates);
  const int block = rows.size(), n = static_cast<int>(candidates.size());
  const VectorXd velocities = rows.velocities(u);
  VectorXd mu(n);
  std::vector<VectorXd> slides(at(n));
  for (int k = 0; k < n; ++k) {
    const int i = candidates[at(k)];
    mu[k] = model_.law(i).friction;
    const VectorXd s = velocities.segment(block * k + 1, block - 1);
    VectorXd& d = slides[at(k)];
    if (i == left_contact && left == Watch::cone) {
      // The force is on the border of the cone and opposes the slip that begins.
      for (std::size_t c = 0; c < motion_.closed().size(); ++c)
        if (motion_.closed()[c] == i) {
          VectorXd rate_there(motion_.size());
          motion_.rate(event_time_, y_.data(), rate_there.data());
          d = -motion_.friction_force(static_cast<int>(c)).normalized();
        }
    } else if (s.norm() > bands().slip(i) && !(i == left_contact && left == Watch::slip)) {
      d = s.normalized();
    }
  }
  ++counts_.contact_problems;
  std::vector<bool> closed;
  for (const int i : candidates) closed.push_back(motion_.modes()[at(i)].mode != Mode::open);
  const AccelerationAnswer solved =
      solve_accelerations(model_, rows, slides, bands().of_accelerations(), closed);
  const FrictionAnswer& answer = solved.contacts;
  if (!answer.solved) fail("the forces of closed contacts are not solved");
  for (int k = 0; k < n && !jammed_; ++k)
    if (slides[at(k)].size() > 0 && answer.regimes[at(k)] == contact::Regime::sticking &&
        velocities.segment(block * k + 1, block - 1).norm() > bands().slip(candidates[at(k)])) {
      jam(rows, velocities, mu);
      jammed_ = true;
      return decide(this->touching(-1), -1, {});
    }
  jammed_ = false;
  for (int k = 0; k < n; ++k) {
    const int i = candidates[at(k)];
    ContactMode& mode = modes[at(i)];
    const bool bounded = model_.law(i).is_bounded();
    const contact::Regime regime = answer.regimes[at(k)];
    const bool moment = model_.law(i).is_moment();
    if (moment && modes[at(model_.law(i).held_by)].mode == Mode::open) continue;
    if (regime == contact::Regime::separating && !bounded && !moment &&
        !(std::abs(answer.w[block * k]) <= kNegligible * solved.scale &&
          rests_on_others(rows, answer, k)))
      continue;
    bool lifted = false;
    for (int j = 0; j < model_.contacts() && !lifted; ++j) lifted = lifted_[at(j)] && are_one(i, j);
    const double force = answer.x[block * k];
    if (lifted && !moment &&
        (force <= kNoForce * answer.x.cwiseAbs().maxCoeff() ||
         force * rows.A()(block * k, block * k) <= kNoForce * solved.scale))
      continue;  // contacts whose forces vanish together lift together
    const VectorXd& d = slides[at(k)];
    if (d.size() > 0) {
      mode.mode = Mode::slide;
      mode.direction = d;
      continue;
    }
    // On the border of its cone a contact may be said to slide though nothing moves it.
    const VectorXd a = answer.w.segment(block * k + 1, block - 1);
    const bool still = a.norm() <= kNegligible * solved.scale;
    if ((regime == contact::Regime::sticking || still) && mu[k] > 0) {
      mode.mode = Mode::stick;
      continue;
    }
    mode.mode = Mode::slide;
    mode.direction = a.norm() > 0 ? VectorXd(a.normalized()) : VectorXd::Unit(block - 1, 0);
    const bool same = i == left_contact && left == Watch::slip &&
                      mode.direction.dot(motion_.modes()[at(i)].direction) > 0.5;
    if (same && mu[k] > 0) mode.mode = Mode::stick;
  }
  return modes;
}

// It is at the border of its face or edge, and on its way out; another contact takes its place.
bool Driver::leaves_its_feature(int contact) {
  const double band = bands().gap(contact);
  return model_.margin(contact) <= band &&
         motion_.margin_rate(event_time_, y_, contact) < -bands().approach(contact);
}

// Forces without bound stop the slip in no time: the impulses that keep the contacts from closing
// at the least speed of approach.
void Driver::jam(const ContactRows& rows, const VectorXd& velocities, const VectorXd& mu) {
  const int block = rows.size();
  VectorXd b = -velocities;
  VectorXd friction = mu;
  for (int k = 0; k < mu.size(); ++k) {
    if (rows.has_normal(k) || rows.is_bounded(k))
      b[block * k] = kLeastApproach * velocities.cwiseAbs().maxCoeff();
    if (rows.is_bounded(k)) friction[k] = 0;  // no impulse
  }
  ++counts_.contact_problems;
  const FrictionAnswer answer = solve_friction(rows.A(), b, friction, rows.holders());
  if (!answer.solved) fail("an impact without collision is not solved");
  const double lost = change_velocities(rows.change(answer.x));
  bool first = true;
  for (int k = 0; k < mu.size(); ++k) {
    if (answer.x[block * k] <= 0 || rows.is_bounded(k)) continue;
    record(EventKind::jam, rows.contacts()[at(k)], velocities[block * k],
           rows.velocities(y_.segment(motion_.coordinates(), motion_.velocities()))[block * k],
           first ? lost : 0);
    events_.back().impulse =
        model_.in_space(rows.contacts()[at(k)], answer.x.segment(block * k, block));
    first = false;
  }
}

}  // namespace tether::scene::event
