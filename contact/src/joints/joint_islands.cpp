// Tether: islands of contacts and joints in a step. SPDX-License-Identifier: BSD-3-Clause
#include "joints/joint_islands.hpp"

#include <algorithm>
#include <tether/linalg/index.hpp>

namespace tether::contact::detail {

using Eigen::Vector3d;

using linalg::at;

StepJointIslands::StepJointIslands(Mechanisms& mechanisms, LawRows& laws, LawUse use,
                                   const BodyOptions& options)
    : mechanisms_(mechanisms),
      laws_(laws),
      use_(use),
      law_(options.law),
      warm_(options.warm_start),
      solver_(solver_options(options)) {}

void StepJointIslands::set_options(const BodyOptions& options) {
  solver_.set_options(solver_options(options));
  if (rolling_) rolling_->set_options(options);
}

void StepJointIslands::scale_warm_start(double factor) {
  memory_.scale(factor);
  if (rolling_) rolling_->scale_warm_start(factor);
}

void StepJointIslands::take_back() {
  memory_.take_back();
  if (rolling_) rolling_->take_back();
}

void StepJointIslands::forget() {
  memory_.forget();
  if (rolling_) rolling_->forget();
}

void StepJointIslands::set_warm_start(const WarmStart& start) {
  memory_.set(start);
  if (rolling_) rolling_->set_warm_start(start);
}

void StepJointIslands::set_rolling(const NearContacts& near, std::unique_ptr<RollingIslands> others,
                                   std::vector<Vector3d>* moments) {
  near_ = &near;
  rolling_ = std::move(others);
  if (moments != nullptr) told_ = moments;
}

void StepJointIslands::solve_others(BodySolver& others, const std::vector<RigidBody>& bodies,
                                    const std::vector<PointContact>& contacts, BodySolution& out) {
  if (rolling_)
    rolling_->solve(others, bodies, contacts, out);
  else
    others.solve(bodies, contacts, out);
}

// Islands of moving bodies, connected by contacts and mechanisms.
void StepJointIslands::find_islands(const std::vector<PointContact>& contacts) {
  const int n = mechanisms_.bodies();
  sets_.reset(n);
  const auto moves = [&](int body) { return body >= 0 && mechanisms_.moves(body); };
  for (int m = 0; m < mechanisms_.count(); ++m)
    for (const int body : mechanisms_[m].bodies())
      sets_.join(body, mechanisms_[m].bodies().front());
  for (const PointContact& c : contacts)
    if (moves(c.first) && moves(c.second)) sets_.join(c.first, c.second);
  has_joints_.assign(at(n), 0);
  for (int m = 0; m < mechanisms_.count(); ++m)
    has_joints_[at(sets_.root(mechanisms_[m].bodies().front()))] = 1;
  jointed_.clear();
  rest_.clear();
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    const int body = moves(contacts[k].first) ? contacts[k].first : contacts[k].second;
    const bool joints = moves(body) && has_joints_[at(sets_.root(body))];
    (joints ? jointed_ : rest_).push_back(static_cast<int>(k));
  }
}

void StepJointIslands::solve_jointed(const std::vector<RigidBody>& bodies,
                                     const std::vector<PointContact>& contacts) {
  v_.resize(bodies.size());
  for (std::size_t i = 0; i < bodies.size(); ++i)
    v_[i] << bodies[i].velocity, bodies[i].angular_velocity;
  contacts_.clear();
  x_.setZero(3 * static_cast<Eigen::Index>(jointed_.size()));
  memory_.rewind();
  for (const int k : jointed_) {
    const PointContact& p = contacts[at(k)];
    const double mu = law_ == Law::frictionless ? 0 : p.mu;
    const auto row = 3 * static_cast<Eigen::Index>(contacts_.size());
    contacts_.push_back(ContactRows::at_point(p.first, p.second, p.r1, p.r2, p.normal, mu));
    contacts_.back().bias = tangent_frame(p.normal) * p.slip;
    contacts_.back().bias[0] += p.bias;
    if (const Vector3d* last = warm_ ? memory_.find(p.id) : nullptr)
      x_.segment<3>(row) = tangent_frame(p.normal) * *last;
  }
  add_laws();
  add_moments(contacts);
  result_ = solver_.solve(mechanisms_, contacts_, own_, v_, x_, normal_of_);
  take_laws();
}

void StepJointIslands::add_laws() {
  law_of_.clear();
  own_.clear();
  if (!laws_.any(use_)) return;
  own_.assign(contacts_.size(), Vector3d::Zero());
  for (int k = 0; k < laws_.laws.count(); ++k) {
    if (!laws_.in(use_, k)) continue;
    law_of_.push_back(k);
    contacts_.push_back(laws_.contact(k, use_, v_, mechanisms_, own_.emplace_back()));
    const auto row = static_cast<Eigen::Index>(x_.size());
    x_.conservativeResize(row + 3);
    x_.segment<3>(row) = laws_.start(k, warm_ ? memory_.find(laws_.id(k)) : nullptr);
  }
}

void StepJointIslands::take_laws() {
  if (use_ != LawUse::all && use_ != LawUse::plastic) return;
  std::vector<double>& impulses = use_ == LawUse::all ? laws_.impulses : laws_.plastic;
  for (std::size_t l = 0; l < law_of_.size(); ++l)
    impulses[at(law_of_[l])] = laws_.impulse(law_of_[l], law_impulse(l));
}

// Their normals start from what the contact starts from.
void StepJointIslands::add_moments(const std::vector<PointContact>& contacts) {
  moments_.clear();
  normal_of_.clear();
  if (near_ == nullptr) return;
  for (std::size_t k = 0; k < jointed_.size(); ++k) {
    const PointContact& p = contacts[at(jointed_[k])];
    const Meeting& m = near_->meeting(p);
    moments_.add(p, m.rolling, m.torsional, static_cast<int>(k), mechanisms_, contacts_);
  }
  if (moments_.count() == 0) return;
  own_.resize(contacts_.size() - at(moments_.count()), Vector3d::Zero());
  for (int k = 0; k < moments_.count(); ++k) {
    own_.push_back(moments_.own(k));
    normal_of_.push_back(moments_.main(k));
    const std::uint64_t id = contacts[at(jointed_[at(moments_.main(k))])].id;
    const Vector3d* last = warm_ ? memory_.find(moment_id(id)) : nullptr;
    const auto row = static_cast<Eigen::Index>(x_.size());
    x_.conservativeResize(row + 3);
    const double normal = std::max(0.0, x_[3 * static_cast<Eigen::Index>(moments_.main(k))]);
    x_.segment<3>(row) = moments_.start(k, normal, last != nullptr ? *last : Vector3d::Zero());
  }
}

void StepJointIslands::take_moments(const std::vector<PointContact>& contacts) {
  if (near_ == nullptr) return;
  told_->assign(contacts.size(), Vector3d::Zero());
  for (std::size_t k = 0; k < rest_.size(); ++k) (*told_)[at(rest_[k])] = rolling_->moments()[k];
  for (int k = 0; k < moments_.count(); ++k)
    (*told_)[at(jointed_[at(moments_.main(k))])] += moment(k);
}

void StepJointIslands::merge(const std::vector<RigidBody>& bodies,
                             const std::vector<PointContact>& contacts, BodySolution& out) {
  out.velocities = solution_.velocities;
  out.angular_velocities = solution_.angular_velocities;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const int body = static_cast<int>(i);
    if (!mechanisms_.moves(body) || !has_joints_[at(sets_.root(body))]) continue;
    out.velocities[i] = v_[i].head<3>();
    out.angular_velocities[i] = v_[i].tail<3>();
  }
  out.impulses.resize(contacts.size());
  out.regimes.resize(contacts.size());
  for (std::size_t k = 0; k < rest_.size(); ++k) {
    out.impulses[at(rest_[k])] = solution_.impulses[k];
    out.regimes[at(rest_[k])] = solution_.regimes[k];
  }
  for (std::size_t k = 0; k < jointed_.size(); ++k) {
    const PointContact& p = contacts[at(jointed_[k])];
    const Vector3d x = x_.segment<3>(3 * static_cast<Eigen::Index>(k));
    out.impulses[at(jointed_[k])] = tangent_frame(p.normal).transpose() * x;
    const bool slides = x.tail<2>().norm() >= p.mu * x[0] * (1 - 1e-12);
    out.regimes[at(jointed_[k])] = x[0] == 0 ? Regime::separating
                                   : slides  ? Regime::sliding
                                             : Regime::sticking;
  }
  out.status = result_.status == Status::solved ? solution_.status : result_.status;
  out.error = solution_.error > result_.error ? solution_.error : result_.error;
  out.islands = solution_.islands + result_.islands;
  out.assembled_islands = solution_.assembled_islands + result_.islands;
  out.failed_islands = solution_.failed_islands + (result_.status != Status::solved);
  out.sweeps = std::max(solution_.sweeps, result_.counts.sweeps);
}

void StepJointIslands::solve(BodySolver& others, const std::vector<RigidBody>& bodies,
                             const std::vector<PointContact>& contacts, BodySolution& out) {
  find_islands(contacts);
  if (jointed_.empty() && !laws_.any(use_)) {
    law_of_.clear();
    solve_others(others, bodies, contacts, out);
    moments_.clear();
    take_moments(contacts);
    return remember(others, contacts, out);
  }
  points_.clear();
  for (const int k : rest_) points_.push_back(contacts[at(k)]);
  solve_others(others, bodies, points_, solution_);
  solve_jointed(bodies, contacts);
  take_moments(contacts);
  merge(bodies, contacts, out);
  remember(others, contacts, out);
}

// All contacts, here and in the other solver: the next time they may be in islands of the other
// kind, and a run that goes on from a saved state finds the same.
void StepJointIslands::remember(BodySolver& others, const std::vector<PointContact>& contacts,
                                const BodySolution& out) {
  memory_.keep(contacts, out.impulses);
  for (std::size_t l = 0; l < law_of_.size(); ++l)
    memory_.add(laws_.id(law_of_[l]), law_impulse(l));
  if (near_ != nullptr)
    for (std::size_t k = 0; k < contacts.size(); ++k)
      if (!(*told_)[k].isZero(0)) memory_.add(moment_id(contacts[k].id), (*told_)[k]);
  memory_.get(start_);
  others.set_warm_start(start_);
  if (rolling_) rolling_->set_warm_start(start_);
}

}  // namespace tether::contact::detail
