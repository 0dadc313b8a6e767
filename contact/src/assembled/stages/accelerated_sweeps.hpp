// Tether: Gauss-Seidel sweeps with safeguarded Anderson acceleration (method, eq. 16).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "assembled/search/search.hpp"
#include <tether/linalg/anderson.hpp>

namespace tether::contact::detail {

class AcceleratedSweeps {
 public:
  void reset(int contacts);
  void start(const PackedVector* x);    // next iterate; forgets the rates of others
  void replace(const PackedVector* x);  // next iterate, near the last one
  const PackedVector* point() const { return g_.data(); }

  struct Leave {            // conditions under which the stage gives way; work in estimated ns
    double price = 0;       // of the other stages: leave if the predicted rest costs more
    double least_work = 0;  // spent here before leaving is considered
    double most_work = 0;   // > 0: leave after so much
  };
  // Until solved, exhausted, or the conditions hold. Sweeps of many contacts have momentum until
  // all have been quiet for long.
  void run(Search& search, const Leave& leave);

 private:
  static constexpr int kToggles = 4, kLeastQuiet = 3, kMostQuiet = 320, kWindow = 60, kRecent = 10,
                       kPersuaded = 40, kFew = 500, kDepth = 10;
  static constexpr double kToggledShare = 0.003, kMomentumCost = 3;  // the latter ns a contact

  int toggles(const System& system);
  bool carried() const { return n_ > kFew; }
  bool extrapolates(int sweep, double f, int toggled);
  void carry_on(Search& search, double f);
  double forecast(int sweep, double f, double log_gain) const;

  int n_ = 0;
  Anderson anderson_;
  std::vector<char> regime_;  // of each contact after the last sweep
  // When sweeps are extrapolated: not before they are quiet; from the first one on, as in the first
  // window of a solve; while it helps.
  enum class Mode { waits, eager, helps } mode_ = Mode::waits;
  // f: weighted change of a sweep.
  int sweeps_ = 0, quiet_ = 0, slow_ = 0, quiet_checked_ = kLeastQuiet, window_end_ = 0;
  double least_f_ = 0, begun_f_ = 0, window_f_ = 0;
  double recent_[kRecent] = {};
  struct Mark {
    int sweep = 0;
    double f = 0;
  };
  Mark earlier_, later_;
  double grown_ = 1, last_f_ = 0;  // of the momentum, 1 at rest; of the sweep before
  Packed x_, g_, f_, before_;      // before_: g of the sweep before
};

}  // namespace tether::contact::detail
