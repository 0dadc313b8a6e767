// Tether: rows of joints on velocities, and their one-dimensional laws.
// SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/joint_laws.hpp>

#include <cmath>
#include <stdexcept>
#include <string>

#include "problem/refuse.hpp"

namespace tether::contact {

namespace {

void demand(bool holds, int joint, const char* what, double value, const char* range) {
  if (!holds)
    throw std::invalid_argument("joint " + std::to_string(joint) + ": " + what + " = " +
                                detail::shown(value) + ": must be " + range);
}

}  // namespace

void JointRows::clear() {
  start_.resize(1);
  joint_.clear();
  rate_.clear();
  terms_.clear();
}

void JointRows::add(int joint, double rate) {
  if (!std::isfinite(rate))
    throw std::invalid_argument("joint " + std::to_string(joint) +
                                ": rate = " + detail::shown(rate) + ": must be finite");
  joint_.push_back(joint);
  rate_.push_back(rate);
  start_.push_back(start_.back());
}

void JointRows::on(int body, const Vector6d& G) {
  if (joint_.empty()) throw std::invalid_argument("JointRows: on() before the first add()");
  if (body < -1)
    throw std::invalid_argument("joint " + std::to_string(joint_.back()) + ": body = " +
                                std::to_string(body) + ": must be an index, or -1 for the world");
  if (!G.allFinite())
    throw std::invalid_argument("joint " + std::to_string(joint_.back()) +
                                ": G must be finite on body " + std::to_string(body));
  if (body < 0) return;
  terms_.push_back({body, G});
  ++start_.back();
}

void JointLaws::clear() {
  rows_.clear();
  laws_.clear();
}

void JointLaws::add_limit(int joint, double gap, double restitution) {
  demand(std::isfinite(gap), joint, "gap", gap, "finite");
  demand(restitution >= 0 && restitution <= 1, joint, "restitution", restitution, "0 to 1");
  rows_.add(joint);
  laws_.push_back({joint, Law::Kind::limit, gap, restitution, 0, 0});
}

void JointLaws::add_bounded(int joint, double rate, double bound) {
  demand(bound >= 0 && std::isfinite(bound), joint, "bound", bound, ">= 0 and finite");
  rows_.add(joint, rate);
  laws_.push_back({joint, Law::Kind::bounded, 0, 0, rate, bound});
}

void JointLaws::set_bound(int law, double bound) {
  Law& of = laws_[static_cast<std::size_t>(law)];
  demand(bound >= 0 && std::isfinite(bound), of.joint, "bound", bound, ">= 0 and finite");
  of.bound = bound;
}

void JointLaws::add_sprung(int joint, double stretch, double stiffness, double damping, double rate,
                           double bound) {
  demand(std::isfinite(stretch), joint, "stretch", stretch, "finite");
  demand(stiffness >= 0 && std::isfinite(stiffness), joint, "stiffness", stiffness,
         ">= 0 and finite");
  demand(damping >= 0 && std::isfinite(damping) && stiffness + damping > 0, joint, "damping",
         damping, ">= 0 and finite, and > 0 without stiffness");
  demand(bound >= 0, joint, "bound", bound, ">= 0");
  rows_.add(joint, rate);
  laws_.push_back({joint, Law::Kind::sprung, 0, 0, rate, bound, stretch, stiffness, damping});
}

void JointLaws::on(int body, const Vector6d& G) { rows_.on(body, G); }

}  // namespace tether::contact
