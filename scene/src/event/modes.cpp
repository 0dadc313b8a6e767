// Tether: which contacts stay closed, stick and slide (method, section 6). SPDX-License-Identifier:
// BSD-3-Clause
//
// By Coulomb's law for accelerations, see solve_accelerations.
#include <algorithm>
#include <cmath>
#include <tether/linalg/index.hpp>
#include <tether/linalg/least_squares.hpp>

#include "driver.hpp"

namespace tether::scene::event {

namespace {

constexpr double kNegligible = 3e-9;  // of the accelerations
constexpr double kNoForce = 1e-9;     // of the largest, and of what accelerates bodies that much
constexpr double kDependentForces = 1e-11, kImplied = 1e-9;  // of A_nn
constexpr double kLeastApproach = 1e-12;                     // of the slip

using linalg::at;

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
