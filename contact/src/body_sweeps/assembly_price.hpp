// Tether: the predicted cost of an island as a Problem. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "graph/contact_graph.hpp"

namespace tether::contact::detail {

// Predicted from the graph of an island alone, in the unit of Options::max_work. The order and the
// fill of a factorisation are looked for once, where they are asked for: that takes as long as one
// to three sweeps, and allocates.
class AssemblyPrice {
 public:
  // first, second: moving bodies of each contact, as ContactGraph::build has them.
  AssemblyPrice(const ContactGraph& graph, const Island& island, const std::vector<int>& first,
                const std::vector<int>& second);

  // Cost of a sweep over the bodies.
  double sweep() const { return sweep_; }
  // Cost of a solution by few factorisations, in sweeps over the bodies.
  double sweeps();
  // Whether `work` suffices for the stages of Solver to get anywhere.
  bool within(double work);

 private:
  double factorisation();

  const ContactGraph& graph_;
  const Island& island_;
  const std::vector<int>&first_, &second_;
  double sweep_ = 0, blocks_ = 0, factorisation_ = -1;
};

}  // namespace tether::contact::detail
