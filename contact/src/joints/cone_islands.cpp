// Tether: islands of a step that are more than friction cones. SPDX-License-Identifier:
// BSD-3-Clause
#include "joints/cone_islands.hpp"

#include <algorithm>
#include <array>
#include <tether/linalg/index.hpp>

#include "body_sweeps/implementation.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;

using linalg::at;

namespace {

// The impulse whose parts along the scaled tangents are its coordinates x: J' x is the impulse p.
Vector3d in_circle(const std::array<Vector3d, 2>& tangents, const Vector3d& normal,
                   const Vector3d& p) {
  Vector3d out = normal.dot(p) * normal;
  for (const Vector3d& t : tangents)
    if (const double square = t.squaredNorm(); square > 0) out += t.dot(p) / (square * square) * t;
  return out;
}

}  // namespace

ConeIslands::ConeIslands(ConeSources& sources, LawUse use, const BodyOptions& options)
    : mechanisms_(sources.mechanisms),
      laws_(sources.laws ? &*sources.laws : nullptr),
      use_(use),
      near_(use == LawUse::limits ? nullptr : sources.near),
      moments_(use == LawUse::all ? sources.moments : own_),
      solver_(assembled_options(options)) {}

void ConeIslands::set_options(const BodyOptions& options) {
  solver_.set_options(assembled_options(options));
}

// Islands of moving bodies, connected by contacts and mechanisms.
void ConeIslands::find_islands(const std::vector<PointContact>& contacts) {
  sets_.reset(mechanisms_.bodies());
  const auto moves = [&](int body) { return body >= 0 && mechanisms_.moves(body); };
  for (int m = 0; m < mechanisms_.count(); ++m)
    for (const int body : mechanisms_[m].bodies())
      sets_.join(body, mechanisms_[m].bodies().front());
  for (const PointContact& c : contacts)
    if (moves(c.first) && moves(c.second)) sets_.join(c.first, c.second);
  is_mine_.assign(at(mechanisms_.bodies()), 0);
  for (int m = 0; m < mechanisms_.count(); ++m)
    is_mine_[at(sets_.root(mechanisms_[m].bodies().front()))] = 1;
  const auto root = [&](const PointContact& c) {
    return at(sets_.root(moves(c.first) ? c.first : c.second));
  };
  for (const PointContact& c : contacts)
    if (rolls(c) || is_elliptic(c)) is_mine_[root(c)] = 1;
  mine_.clear();
  rest_.clear();
  for (std::size_t k = 0; k < contacts.size(); ++k)
    (is_mine_[root(contacts[k])] != 0 ? mine_ : rest_).push_back(static_cast<int>(k));
}

void ConeIslands::add_contacts(const std::vector<PointContact>& contacts, ImpulseMemory& memory) {
  memory.rewind();
  const auto last = [&](std::uint64_t id) {
    const Vector3d* found = memory.find(id);
    return found != nullptr ? *found : Vector3d(Vector3d::Zero());
  };
  for (const int k : mine_) {
    const PointContact& p = contacts[at(k)];
    const bool moments = rolls(p);
    const Meeting none, &m = moments ? near_->meeting(p) : none;
    BodyCone& c = cones_.emplace_back(contact_cone(p, m.rolling, m.torsional));
    Vector6d impulse;
    impulse << last(p.id), moments ? last(moment_id(p.id)) : Vector3d(Vector3d::Zero());
    if (is_elliptic(p)) {
      const std::array<Vector3d, 2> tangents = near_->scaled_tangents(p);
      scale_tangents(tangents, p, c);
      impulse.head<3>() = in_circle(tangents, p.normal, impulse.head<3>());
    }
    const BodyCone::Rows& J = c.terms.front().J;
    // The rows of forces have moments about the centre, too.
    for (int r = 0; r < c.cone.rows; ++r)
      start_of_.push_back(r < 3 ? J.row(r).head<3>().dot(impulse.head<3>())
                                : J.row(r).tail<3>().dot(impulse.tail<3>()));
  }
}

void ConeIslands::add_laws(ImpulseMemory& memory) {
  for (int k = 0; k < laws_->laws.count(); ++k) {
    if (!laws_->in(use_, k)) continue;
    law_of_.push_back(k);
    cones_.push_back(laws_->cone(k, use_));
    start_of_.push_back(laws_->start(k, memory.find(LawRows::id(k))));
  }
}

void ConeIslands::take_laws() {
  if (law_of_.empty() || (use_ != LawUse::all && use_ != LawUse::plastic)) return;
  std::vector<double>& impulses = use_ == LawUse::all ? laws_->impulses : laws_->plastic;
  const Eigen::Index first = x_.size() - static_cast<Eigen::Index>(law_of_.size());
  for (std::size_t l = 0; l < law_of_.size(); ++l)
    impulses[at(law_of_[l])] = x_[first + static_cast<Eigen::Index>(l)];
}

void ConeIslands::merge(const std::vector<RigidBody>& bodies,
                        const std::vector<PointContact>& contacts, BodySolution& out) {
  out.velocities = solution_.velocities;
  out.angular_velocities = solution_.angular_velocities;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const int body = static_cast<int>(i);
    if (!mechanisms_.moves(body) || is_mine_[at(sets_.root(body))] == 0) continue;
    out.velocities[i] = v_[i].head<3>();
    out.angular_velocities[i] = v_[i].tail<3>();
  }
  out.impulses.resize(contacts.size());
  out.regimes.resize(contacts.size());
  for (std::size_t k = 0; k < rest_.size(); ++k) {
    out.impulses[at(rest_[k])] = solution_.impulses[k];
    out.regimes[at(rest_[k])] = solution_.regimes[k];
  }
  Eigen::Index row = 0;
  for (std::size_t k = 0; k < mine_.size(); ++k) {
    const BodyCone& c = cones_[k];
    const BodyCone::Rows& J = c.terms.front().J;
    const Eigen::Index rows = c.cone.rows, moments = rows - 3;
    const auto x = x_.segment(row, rows);
    const auto contact = at(mine_[k]);
    out.impulses[contact] = J.topLeftCorner<3, 3>().transpose() * x.head<3>();
    if (moments > 0)
      moments_[contact] = J.bottomRightCorner(moments, 3).transpose() * x.tail(moments);
    const bool slides = x.segment<2>(1).norm() >= c.cone.mu * x[0] * (1 - 1e-12);
    out.regimes[contact] = x[0] == 0 ? Regime::separating
                           : slides  ? Regime::sliding
                                     : Regime::sticking;
    row += rows;
  }
  out.status = result_.status == Status::solved ? solution_.status : result_.status;
  out.error = solution_.error > result_.error ? solution_.error : result_.error;
  out.islands = solution_.islands + result_.islands;
  out.assembled_islands = solution_.assembled_islands + result_.islands;
  out.failed_islands = solution_.failed_islands + result_.failed;
  out.sweeps = std::max(solution_.sweeps, result_.sweeps);
}

void ConeIslands::solve(BodySolver& others, const std::vector<RigidBody>& bodies,
                        const std::vector<PointContact>& contacts, BodySolution& out) {
  if (laws_ == nullptr) mechanisms_.update(bodies, {});
  find_islands(contacts);
  cones_.clear();
  law_of_.clear();
  start_of_.clear();
  if (near_ != nullptr) moments_.assign(contacts.size(), Vector3d::Zero());
  const bool laws = laws_ != nullptr && laws_->any(use_);
  if (mine_.empty() && !laws) return others.solve(bodies, contacts, out);
  points_.clear();
  for (const int k : rest_) points_.push_back(contacts[at(k)]);
  BodySolver::Implementation& rest = *others.implementation_;
  rest.solve(bodies, points_, solution_);
  v_.clear();
  for (const RigidBody& body : bodies) v_.push_back(body.velocities());
  add_contacts(contacts, rest.memory);
  if (laws) add_laws(rest.memory);
  x_ = Eigen::Map<const Eigen::VectorXd>(start_of_.data(),
                                         static_cast<Eigen::Index>(start_of_.size()));
  result_ = solver_.solve(mechanisms_, cones_, v_, x_);
  take_laws();
  merge(bodies, contacts, out);
  rest.keep(contacts, out.impulses);
  if (rest.options.warm_start) remember_cones(contacts, rest.memory);
}

void ConeIslands::remember_cones(const std::vector<PointContact>& contacts,
                                 ImpulseMemory& memory) const {
  const Eigen::Index first = x_.size() - static_cast<Eigen::Index>(law_of_.size());
  for (std::size_t l = 0; l < law_of_.size(); ++l)
    memory.add(LawRows::id(law_of_[l]), {x_[first + static_cast<Eigen::Index>(l)], 0, 0});
  if (near_ != nullptr)
    for (std::size_t k = 0; k < contacts.size(); ++k)
      if (!moments_[k].isZero(0)) memory.add(moment_id(contacts[k].id), moments_[k]);
}

}  // namespace tether::contact::detail
