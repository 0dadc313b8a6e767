// Tether: impacts of contacts that close (method, eq. 7). SPDX-License-Identifier: BSD-3-Clause
//
// Newton's law w_n+ = -e w_n- where impulses act, and Coulomb's cone, in one problem of all
// contacts that touch.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tether/linalg/index.hpp>

#include "driver.hpp"

namespace tether::scene::event {

namespace {

constexpr double kNoImpulse = 1e-9;      // of the largest of an impact
constexpr int kMostRounds = 2000;        // of one instant
constexpr double kUnknownGap = 0.1;      // of its band
constexpr double kHeldByJoints = 1e-10;  // of a normal's mobility without joints

using linalg::at;

}  // namespace

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

}  // namespace tether::scene::event
