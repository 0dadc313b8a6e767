// Tether: Gauss-Seidel sweeps with safeguarded Anderson acceleration. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "anderson.hpp"
#include "search.hpp"

namespace tether::contact::detail {

class AcceleratedSweeps {
 public:
  void reset(int contacts, int depth);
  void start(const PackedVector* x);  // next iterate; clears the history of the acceleration
  const PackedVector* point() const { return g_.data(); }

  struct Leave {  // conditions under which the stage gives way; work in estimated ns
    double other_cost = 0;      // of one Newton step; 0: stay
    double least_work = 0;      // spent here before leaving is considered
    int most_sweeps = 0;        // > 0: leave after so many
    double worth = 15;          // leave if the predicted rest costs more than worth * other_cost
  };
  // Until solved, exhausted, or the conditions hold.
  void run(Search& search, const Leave& leave);

 private:
  int n_ = 0, depth_ = 10;
  Anderson anderson_;
  Packed x_, g_, f_;
};

}  // namespace tether::contact::detail
