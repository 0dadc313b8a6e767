// Tether: solves of the parts of a problem where sweeps do not settle. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <memory>

#include "assembled/search/search.hpp"

namespace tether::contact::detail {

// Sweeps that go on for long do so because of few contacts: where a handful toggle between regimes
// the errors of the others decay with the distance from them. A round solves these contacts with
// their neighbours as problems of their own, the impulses of all others held: b - A x of the
// others.
class LocalSolves {
 public:
  LocalSolves();
  ~LocalSolves();
  void reset(int contacts);
  // One round, at most `budget` of work for each part. True: x has changed; it may be worse at
  // first, as what has moved disturbs the others.
  bool run(Search& search, Packed& x, double budget);

 private:
  struct Part;  // a Search and its stages
  bool find_errors(Search& search, const Packed& x);
  bool find_parts(Search& search, const Packed& x);
  void add_part(const Problem& p, int seed, int largest);
  bool solve_part(Search& search, int part, double budget, Packed& x);

  int n_ = 0, layers_ = 1;
  int refused_ = 0;      // rounds that found too many contacts with errors of one size
  bool solved_ = false;  // a part, in the last round
  double most_ = 0;      // the largest error, as a velocity relative to its island's scale
  std::vector<double> error_;
  std::vector<int> list_, start_, place_;  // contacts part by part; place of a contact in its part
  std::unique_ptr<Part> part_;
};

}  // namespace tether::contact::detail
