// Tether: residuals of impulses between bodies. SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/body_solver.hpp>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "assembled/search/search.hpp"
#include "body_passes/given_problem.hpp"
#include "body_sweeps/wide_velocities.hpp"
#include "graph/contact_graph.hpp"
#include "law/kernels/exact_error.hpp"
#include "problem/criterion.hpp"

namespace tether::contact {

using detail::at;

namespace {

// The islands of BodySolver with their velocity scales.
class Scales {
 public:
  Scales(const detail::GivenProblem& given, bool friction, const std::vector<LocalBlock>& blocks) {
    const std::vector<PointContact>& contacts = given.contacts();
    const std::size_t n = contacts.size();
    detail::ContactGraph graph;
    graph.build(static_cast<int>(given.bodies().size()), given.first(), given.second(),
                std::vector<detail::Kind>(n, detail::Kind::general), false);
    island_.resize(n);
    coupled_.resize(n);
    for (const detail::Island& island : graph.islands) {
      double needed = 0, bb = 0, speed = 0;
      for (int place = island.contact_begin; place < island.contact_begin + island.contacts;
           ++place) {
        const std::size_t i = at(graph.order[at(place)]);
        const detail::Side side = given.side(graph.order[at(place)]);
        island_[i] = static_cast<int>(inverse_.size());
        coupled_[i] = static_cast<double>(graph.coupled[at(place)]);
        const Eigen::Vector3d u = detail::velocity_before(side, contacts[i].bias);
        const double bn = -u.dot(side.n), square = u.squaredNorm();
        const double ratio = 0.5 * (blocks[i].T[0] + blocks[i].T[2]) * blocks[i].inv_a;
        const double bt = std::sqrt(std::max(0.0, square - bn * bn));
        needed =
            std::max(needed, detail::needed_change(bn, bt, friction ? contacts[i].mu : 0, ratio));
        bb += square;
        speed = std::max(speed, detail::speed_before(side, contacts[i].bias));
      }
      inverse_.push_back(detail::inverse_scale(needed, bb));
      floor_.push_back(detail::round_off(speed));
    }
  }
  double coupled(std::size_t i) const { return coupled_[i]; }
  double relative(std::size_t i, double error) const {
    const std::size_t k = at(island_[i]);
    return error * error <= floor_[k] ? 0 : error * inverse_[k];
  }

 private:
  std::vector<int> island_;
  std::vector<double> coupled_, inverse_, floor_;
};

// Block fixed point of a contact with theta contacts in its row (method, section 3), a velocity.
double fixed_point(Law law, const LocalBlock& L, double mu, const double* gamma,
                   const detail::Wide3& x, const detail::Wide3& u, double theta) {
  const detail::Wide3 share = u / static_cast<detail::Wide>(theta);
  Eigen::Vector3d b;
  detail::wide_rhs(L, x.data(), share.data(), b.data());
  LocalState state;
  for (int k = 0; k < 3; ++k) state.x[k] = static_cast<double>(x[k]);
  solve_local(law, L, b, state);
  return static_cast<double>(
      theta * detail::wide_error(L, mu, gamma, x.data(), share.data(), state.x, state.regime));
}

}  // namespace

Residuals evaluate(const std::vector<RigidBody>& bodies, const std::vector<PointContact>& contacts,
                   Law law, const std::vector<Eigen::Vector3d>& impulses) {
  if (impulses.size() != contacts.size()) {
    throw std::invalid_argument("impulses has " + std::to_string(impulses.size()) +
                                " entries: " + std::to_string(contacts.size()) +
                                " are needed, one for each contact");
  }
  detail::GivenProblem given;
  given.read(bodies, contacts, law);
  // Nothing can be said of an answer that is not finite.
  for (const Eigen::Vector3d& p : impulses)
    if (!p.allFinite()) return {};
  detail::WideVelocities velocities(bodies);
  double bb = 0;
  std::vector<Eigen::Vector3d> before;
  for (const PointContact& c : contacts) {
    before.push_back(velocities.relative(c).cast<double>());
    bb += before.back().squaredNorm();
  }
  for (std::size_t i = 0; i < contacts.size(); ++i) velocities.push(contacts[i], impulses[i]);
  std::vector<LocalBlock> blocks;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const Eigen::Matrix3d F = tangent_frame(contacts[i].normal);
    const detail::Side side = given.side(static_cast<int>(i));
    blocks.emplace_back(F * detail::diagonal_block(side) * F.transpose(), contacts[i].mu);
  }
  const detail::LawKernels& rule = detail::kernels(law);
  const Scales scales(given, rule.friction, blocks);
  Residuals r;
  r.fixed_point = r.signorini = r.cone = r.alignment = r.dissipation = r.energy_change = 0;
  double map = 0, xx = 0, ww = 0;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const Eigen::Matrix3d F = tangent_frame(contacts[i].normal);
    const LocalBlock& L = blocks[i];
    const detail::Wide3 wide_x = F.cast<detail::Wide>() * impulses[i].cast<detail::Wide>();
    const detail::Wide3 wide_u = F.cast<detail::Wide>() * velocities.relative(contacts[i]);
    const Eigen::Vector3d x = wide_x.cast<double>(), u = wide_u.cast<double>();
    const Eigen::Vector3d b = -(F * before[i]);
    const double mu = rule.friction ? contacts[i].mu : 0;
    double gamma[2];
    rule.gamma(L, gamma);
    detail::add_residuals(L, mu, gamma, x.data(), u.data(), b.data(), r);
    const double error =
        scales.relative(i, fixed_point(law, L, mu, gamma, wide_x, wide_u, scales.coupled(i)));
    if (!(error <= r.fixed_point)) r.fixed_point = error;
    if (error != error) return {};  // velocities out of range
    Eigen::Vector3d z;
    rule.natural_point(L, x.data(), u.data(), z.data());
    map += (x - z).squaredNorm();
    xx += x.squaredNorm();
    ww += u.squaredNorm();
  }
  const double size = std::max({bb, xx, ww});
  r.natural_map = size > 0 ? std::sqrt(map) / std::sqrt(size) : std::sqrt(map);
  return r;
}

}  // namespace tether::contact
