// Tether: proximal point iteration with semismooth Newton inside. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include "assembled/search/search.hpp"
#include "assembled/stages/newton_matrix.hpp"

namespace tether::contact::detail {

// Outer: x^{k+1} = solution of the problem with A + tau D and b + tau D x^k (D: diagonal blocks).
// Inner: Newton on F = x - Phi(D x - w), whose matrix I + Phi' (A - D) is regular by
// the proximal term although A is not (method, eq. 18). It is factorised by contacts, those that
// part left out, or by bodies where these have so many contacts that it costs less.
class ProximalNewton {
 public:
  explicit ProximalNewton(NewtonMatrix& matrix) : matrix_(matrix) {}
  void reset(int contacts);
  // From x; at most `most` outer steps. The result is search.best.
  void run(Search& search, const PackedVector* x, int most);
  // Full Newton steps on the proximal problem from x, at most `most`, until its residual is a tenth
  // of its proximal term. Returns how many and x; or 0, x as it was.
  int correct(Search& search, double tau, const PackedVector* anchor, Packed& x, int most);
  // Estimated ns of one Newton step.
  double cost(const Search& search) const { return matrix_.cost(search); }
  // Whether the work that is left allows for another.
  bool affordable(const Search& search) const {
    return search.counts.work + cost(search) <= search.work_end;
  }

 private:
  // Solves the proximal problem at tau from x_ in place; Newton steps used, or -1.
  int inner(Search& search, double tau);
  bool direction(Search& search, double tau);
  double residual(Search& search, const Packed& x, Packed& z, const Proximal& proximal,
                  bool derive);

  int n_ = 0;
  NewtonMatrix& matrix_;
  Packed x_, z_, dx_, trial_, trial_z_, swept_, swept_z_, anchor_;
  std::vector<Regime> regimes_;
  std::vector<LocalDerivative> derivatives_;
};

}  // namespace tether::contact::detail
