// Tether: rolling friction in the contact problems of steps. SPDX-License-Identifier: BSD-3-Clause
#include "rolling/rolling_part.hpp"

#include <algorithm>
#include <numeric>
#include <tether/linalg/index.hpp>

#include "rolling/rolling_sweeps.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;

namespace {

class RollingIslands final : public JointIslands {
 public:
  // moments: where those of the last solve go.
  RollingIslands(const NearContacts& near, const BodyOptions& options,
                 std::vector<Vector3d>* moments)
      : near_(near), options_(options), moments_(moments != nullptr ? *moments : own_) {}

  void solve(BodySolver& others, const std::vector<RigidBody>& bodies,
             const std::vector<PointContact>& contacts, BodySolution& out) override {
    moments_.assign(contacts.size(), Vector3d::Zero());
    if (!choose(bodies, contacts)) return others.solve(bodies, contacts, out);
    others.solve(bodies, other_, solution_);
    out.status = solution_.status;
    out.error = other_.empty() ? 0 : solution_.error;
    out.islands = solution_.islands;
    out.assembled_islands = solution_.assembled_islands;
    out.failed_islands = solution_.failed_islands;
    out.sweeps = solution_.sweeps;
    out.velocities = solution_.velocities;
    out.angular_velocities = solution_.angular_velocities;
    out.impulses.assign(contacts.size(), Vector3d::Zero());
    out.regimes.assign(contacts.size(), Regime::separating);
    for (std::size_t k = 0; k < other_.size(); ++k) {
      out.impulses[at(from_[k])] = solution_.impulses[k];
      out.regimes[at(from_[k])] = solution_.regimes[k];
    }
    if (other_.empty()) out.status = Status::solved;
    for (const int root : roots_) solve_island(root, bodies, contacts, out);
  }

  void set_options(const BodyOptions& options) override { options_ = options; }
  // Each solve starts from zero: what a run has been restarted from cannot matter.
  void scale_warm_start(double) override {}
  void take_back() override {}
  void forget() override { moments_.clear(); }
  void set_warm_start(const WarmStart&) override {}

 private:
  int root(int body) {
    while (parent_[at(body)] != body) body = parent_[at(body)] = parent_[at(parent_[at(body)])];
    return body;
  }
  int island(const std::vector<RigidBody>& bodies, const PointContact& c) {
    return root(bodies[at(c.first)].moves() ? c.first : c.second);
  }

  // Which islands name it; the contacts of the others. False: none does.
  bool choose(const std::vector<RigidBody>& bodies, const std::vector<PointContact>& contacts) {
    const auto named = [&](const PointContact& c) {
      const Meeting& m = near_.meeting(c);
      return m.rolling > 0 || m.torsional > 0;
    };
    if (std::none_of(contacts.begin(), contacts.end(), named)) return false;
    parent_.resize(bodies.size());
    std::iota(parent_.begin(), parent_.end(), 0);
    for (const PointContact& c : contacts)
      if (c.second >= 0 && bodies[at(c.first)].moves() && bodies[at(c.second)].moves())
        parent_[at(root(c.first))] = root(c.second);
    roots_.clear();
    for (const PointContact& c : contacts)
      if (named(c)) roots_.push_back(island(bodies, c));
    std::sort(roots_.begin(), roots_.end());
    roots_.erase(std::unique(roots_.begin(), roots_.end()), roots_.end());
    other_.clear();
    from_.clear();
    for (std::size_t k = 0; k < contacts.size(); ++k) {
      if (std::binary_search(roots_.begin(), roots_.end(), island(bodies, contacts[k]))) continue;
      other_.push_back(contacts[k]);
      from_.push_back(static_cast<int>(k));
    }
    return true;
  }

  void solve_island(int which, const std::vector<RigidBody>& bodies,
                    const std::vector<PointContact>& contacts, BodySolution& out) {
    rows_.clear();
    index_.clear();
    for (std::size_t k = 0; k < contacts.size(); ++k) {
      if (island(bodies, contacts[k]) != which) continue;
      const Meeting& m = near_.meeting(contacts[k]);
      rows_.push_back({contacts[k], m.rolling, m.torsional});
      index_.push_back(static_cast<int>(k));
    }
    sweeps_.begin(bodies, rows_);
    sweeps_.solve(options_.tolerance, options_.min_sweeps, options_.max_sweeps);
    for (std::size_t k = 0; k < index_.size(); ++k) {
      const int c = static_cast<int>(k);
      out.impulses[at(index_[k])] = sweeps_.impulse(c);
      out.regimes[at(index_[k])] = sweeps_.regime(c);
      moments_[at(index_[k])] = sweeps_.moment(c);
    }
    for (int i = 0; i < static_cast<int>(bodies.size()); ++i) {
      if (!bodies[at(i)].moves() || root(i) != which) continue;
      out.velocities[at(i)] = sweeps_.velocity(i).head<3>();
      out.angular_velocities[at(i)] = sweeps_.velocity(i).tail<3>();
    }
    ++out.islands;
    out.sweeps = std::max(out.sweeps, sweeps_.sweeps);
    out.error = std::max(out.error, sweeps_.error);
    if (sweeps_.status == Status::solved) return;
    ++out.failed_islands;
    out.status = sweeps_.status;
  }

  const NearContacts& near_;
  BodyOptions options_;
  RollingSweeps sweeps_;
  std::vector<int> parent_, roots_, from_, index_;
  std::vector<PointContact> other_;
  std::vector<RollingContact> rows_;
  BodySolution solution_;
  std::vector<Vector3d> own_;
  std::vector<Vector3d>& moments_;
};

}  // namespace

// Moves that take penetrations back have no friction of any kind. The first islands of a run of
// steps are those of its velocities; others are of impacts and of what they close.
std::unique_ptr<JointIslands> RollingPart::make_islands(const BodyOptions& options, LawUse laws) {
  if (laws == LawUse::limits) return nullptr;
  return std::make_unique<RollingIslands>(near_, options,
                                          std::exchange(first_, false) ? &moments_ : nullptr);
}

}  // namespace tether::contact::detail
