// Tether: a start from problems with softer contacts. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "assembled/search/search.hpp"

namespace tether::contact::detail {

// Where A is singular impulses may grow along its null space without an end, contacts wedged
// against each other, until round-off of A x is all that is left of the error: a point that no
// stage leaves, beside solutions with impulses of the size of b. Contacts that yield a little, by
// diagonal blocks times 1 + tau, hold no such impulses, and as tau falls to the tolerance what
// solves them becomes a solution of the problem itself.
class SoftStart {
 public:
  SoftStart();
  ~SoftStart();
  // x: impulses from which the problem may be solved. False: round-off is what is left there, too.
  // Each of the problems takes at most `budget` of work.
  bool find(Search& search, double budget, Packed& x);

 private:
  struct Soft;  // a Search and its stages
  std::unique_ptr<Soft> soft_;
  std::vector<int> all_;
};

}  // namespace tether::contact::detail
