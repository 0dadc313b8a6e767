// Tether: what a rank tells the others while they sweep islands together. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <vector>

#include "body_passes/island_sweeps.hpp"
#include "ranks/rank_plan.hpp"

namespace tether::contact::detail {

class RankPart : public SweepPartners {
 public:
  explicit RankPart(const RankPlan& plan) : plan_(plan) {}
  // Before a solve.
  void start(RankMessages& messages);

  bool here(int island) const override { return plan_.here[linalg::at(island)] != 0; }
  bool shared(int island) const override { return plan_.shared[linalg::at(island)] != 0; }
  WholeGraph whole() const override { return {plan_.whole, plan_.first, plan_.second}; }
  void begin(int island) override { island_ = island; }

  void after_colour(int colour, MovingBodies& bodies) override;
  void share(MovingBodies& bodies) override;
  PassResult total(const std::vector<PassResult>& sums) override;

  void give_up(const char* why) override { messages_->give_up(why); }

 protected:
  RankMessages& messages() const { return *messages_; }

 private:
  using With = std::vector<RankMessages::With>;
  static With buffers(const RankExchanges& exchanges);
  void pass_on(const RankExchanges& exchanges, With& with, MovingBodies& bodies);

  const RankPlan& plan_;
  RankMessages* messages_ = nullptr;
  int island_ = 0;
  std::vector<With> after_, share_;  // by colour, by island
  std::vector<double> sums_;
};

}  // namespace tether::contact::detail
