// Tether: an island of several ranks on one of them. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/ranks.hpp>
#include <tether/linalg/index.hpp>
#include <vector>

#include "body_passes/island_sweeps.hpp"
#include "ranks/rank_plan.hpp"

namespace tether::contact::detail {

// Its bodies and contacts, with what the sweeps have made of them. Empty on ranks that are not
// root.
class GatheredIsland {
 public:
  GatheredIsland(const RankPlan& plan, int island, const GivenProblem& given,
                 const IslandSweeps& sweeps, RankMessages& messages, int root);

  ContactGraph graph;                   // of this island alone, with its number
  std::vector<RigidBody> bodies;        // in the order of its slots, then those that are fixed
  std::vector<PointContact> contacts;   // in the order of its places
  std::vector<Eigen::Vector4d> states;  // IslandSweeps::state of each

 private:
  void pack(const RankPlan& plan, int island, const GivenProblem& given,
            const IslandSweeps& sweeps);
  void unpack(const RankPlan& plan, int island, const std::vector<double>& all);

  std::vector<double> mine_;
};

// Solution of the root, as numbers.
struct IslandAnswer {
  explicit IslandAnswer(const Island& island)
      : contacts(linalg::at(island.contacts)),
        values(2 + 5 * contacts + 6 * linalg::at(island.body_end - island.body_begin)) {}
  std::size_t contacts;
  std::vector<double> values;  // status, error, contacts, bodies

  // Impulse in world axes, regime, replaced; place within the island.
  double* contact(int place) { return values.data() + 2 + 5 * linalg::at(place); }
  const double* contact(int place) const { return values.data() + 2 + 5 * linalg::at(place); }
  // Velocity, angular velocity; slot within the island.
  double* body(int slot) { return contact(0) + 5 * contacts + 6 * linalg::at(slot); }
  const double* body(int slot) const { return contact(0) + 5 * contacts + 6 * linalg::at(slot); }
};

}  // namespace tether::contact::detail
