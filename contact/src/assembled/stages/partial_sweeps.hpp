// Tether: sweeps of the contacts that have not settled. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "assembled/search/search.hpp"

namespace tether::contact::detail {

/// Long before sweeps end most contacts have settled: of 19 000 in a packing one in a hundred has
/// an error above a hundredth of the largest after a quarter of the sweeps. Those are swept alone,
/// and with each that moves its neighbours, until all have fallen as far: hundreds of sweeps for
/// the work of a few.
class PartialSweeps {
 public:
  void reset(int contacts);
  /// The first sweeps spread what they find.
  void start();

  enum class Outcome {
    none,      ///< x is as it was: it is not yet time, or too many contacts have not settled
    gained,    ///< all have settled, and the largest error had halved since the last time
    restless,  ///< some toggle, or others have taken their place
  };
  /// After full sweep number `sweep` to x; `change`: what it changed, times the contacts' weights.
  Outcome run(Search& search, int sweep, Packed& x, const Packed& change);
  bool due(int sweep) const { return sweep >= next_; }
  /// Whether what has settled may be solved.
  bool to_tolerance() const { return to_tolerance_; }

 private:
  double find_unsettled(const Search& search, const Packed& change);
  void list_neighbours(const Problem& problem);
  bool settle(Search& search, Packed& x);

  int n_ = 0;
  int next_ = 0, between_ = 0;  // sweep of the next time, sweeps from one to the other
  double least_ = 0;            // least of the largest errors so far
  double cut_ = 0;              // errors above it count as not settled
  bool to_tolerance_ = false;
  std::vector<int> unsettled_, list_;
  std::vector<char> listed_;
  Packed before_;
};

}  // namespace tether::contact::detail
