// Tether: problems of one process over ranks. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstring>
#include <tether/contact_mpi.hpp>
#include <tuple>

#include "packing.hpp"

namespace tether::contact_mpi {

inline std::size_t at(int i) { return static_cast<std::size_t>(i); }

// The moving body with the smaller number, and the other one.
inline std::pair<int, int> key(const contact::random::Packing& p, const contact::PointContact& c) {
  const bool a = p.bodies[at(c.first)].moves();
  const bool b = c.second >= 0 && p.bodies[at(c.second)].moves();
  if (a && b) return {std::min(c.first, c.second), std::max(c.first, c.second)};
  return a ? std::pair{c.first, c.second} : std::pair{c.second, c.first};
}

// Contacts in the order that does not depend on ranks.
inline void sort_contacts(contact::random::Packing& p) {
  std::stable_sort(p.contacts.begin(), p.contacts.end(),
                   [&](const auto& one, const auto& other) { return key(p, one) < key(p, other); });
}

struct Shares {
  Share share;
  std::vector<int> contacts;  // of the share in the whole
};

// owner: of each body.
inline Shares share_of(const contact::random::Packing& p, const std::vector<int>& owner, int rank) {
  Shares out;
  for (std::size_t b = 0; b < p.bodies.size(); ++b) {
    if (owner[b] != rank) continue;
    out.share.numbers.push_back(static_cast<int>(b));
    out.share.bodies.push_back(p.bodies[b]);
  }
  for (std::size_t c = 0; c < p.contacts.size(); ++c) {
    if (owner[at(key(p, p.contacts[c]).first)] != rank) continue;
    out.share.contacts.push_back(p.contacts[c]);
    out.contacts.push_back(static_cast<int>(c));
  }
  return out;
}

inline bool same_bits(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::memcmp(a.data(), b.data(), sizeof(double) * 3) == 0;
}

// All that one process finds, bit by bit.
inline bool same(const contact::BodySolution& one, const Solution& s, const Shares& shares) {
  bool same = s.status == one.status && s.error == one.error && s.sweeps == one.sweeps &&
              s.islands == one.islands && s.colours == one.colours &&
              s.assembled_islands == one.assembled_islands &&
              s.failed_islands == one.failed_islands && s.warm_started == one.warm_started;
  for (std::size_t k = 0; k < shares.share.numbers.size(); ++k) {
    const std::size_t b = at(shares.share.numbers[k]);
    same = same && same_bits(s.velocities[k], one.velocities[b]) &&
           same_bits(s.angular_velocities[k], one.angular_velocities[b]);
  }
  for (std::size_t k = 0; k < shares.contacts.size(); ++k) {
    const std::size_t c = at(shares.contacts[k]);
    same = same && same_bits(s.impulses[k], one.impulses[c]) && s.regimes[k] == one.regimes[c];
  }
  return same;
}

}  // namespace tether::contact_mpi
