// Tether: impulses of the last solve, found by contact id from every rank. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "messages.hpp"

namespace tether::contact_mpi::detail {

/// Each id has a rank that keeps its impulse: bodies, and with them contacts, change their owners.
class ImpulseDirectory {
 public:
  /// The impulses of contacts of this rank, zero for ids that are not known; how many are known of
  /// all ranks' contacts.
  std::vector<Eigen::Vector3d> find(Messages& messages,
                                    const std::vector<contact::PointContact>& contacts, int& known);
  /// In place of all that was kept.
  void keep(Messages& messages, const std::vector<contact::PointContact>& contacts,
            const std::vector<Eigen::Vector3d>& impulses);
  void scale(double factor) {
    for (auto& [id, p] : kept_) p *= factor;
  }
  void forget() { kept_.clear(); }

 private:
  std::unordered_map<std::uint64_t, Eigen::Vector3d> kept_;
};

}  // namespace tether::contact_mpi::detail
