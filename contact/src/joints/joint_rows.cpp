// Tether: rows of joints on velocities. SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/joints.hpp>

#include <cmath>
#include <stdexcept>
#include <string>

#include "problem/refuse.hpp"

namespace tether::contact {

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

}  // namespace tether::contact
