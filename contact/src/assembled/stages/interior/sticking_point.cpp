// Tether: the point where every contact sticks. SPDX-License-Identifier: BSD-3-Clause
#include "assembled/stages/interior/interior_point.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tether/linalg/cone_scaling.hpp>

namespace tether::contact::detail {

void StickingPoint::reset(int contacts) {
  state_ = State::unknown;
  for (Packed* p : {&x_, &z_, &w_}) p->resize(at(contacts));
}

// A, shifted.
bool StickingPoint::factor(Search& search, NewtonMatrix& matrix) const {
  // Below the eigenvalues that light bodies between heavy ones leave (1e-12 of the largest for 200
  // boxes of masses 1 : 1e6), above the rounding of A; by bodies above what cancels.
  const double shift = matrix.by_bodies() ? 1e-9 : 1e-12;
  const Problem& p = search.system.problem();
  for (int i = 0; i < p.contacts(); ++i) {
    matrix[i] = {};
    for (int c = 0; c < 3; ++c) {
      matrix[i].a.column[5 * c] = shift * mean_diagonal(p.local(i));
      matrix[i].L.column[5 * c] = matrix[i].R.column[5 * c] = 1;
    }
  }
  return matrix.factor(search, 0);
}

void StickingPoint::find(Search& search, NewtonMatrix& matrix, const std::vector<char>& flat) {
  if (state_ != State::unknown) return;
  state_ = State::none;
  const Problem& p = search.system.problem();
  const int n = p.contacts();
  if (!factor(search, matrix)) return;
  z_ = p.packed_b();
  matrix.solve(z_.data());
  x_ = z_;
  size_ = outside_ = 0;
  for (int i = 0; i < n; ++i) {
    double* x = x_[at(i)].v;
    if (flat[at(i)]) {
      x[1] = x[2] = 0;
    } else {
      x[0] *= p.local(i).mu;
    }
    const double t = tangent(x);
    size_ += std::abs(x[0]) + t;
    outside_ = std::max(outside_, t - x[0]);
  }
  if (!std::isfinite(size_)) return;
  state_ = State::found;
  if (outside_ <= 0) refine(search, matrix, flat);
}

void StickingPoint::refine(Search& search, NewtonMatrix& matrix, const std::vector<char>& flat) {
  constexpr int kRefinements = 6;
  const Problem& p = search.system.problem();
  const int n = p.contacts();
  double last = std::numeric_limits<double>::infinity();
  for (int refinement = 0; refinement <= kRefinements; ++refinement) {
    for (int i = 0; i < n; ++i) {
      if (flat[at(i)]) z_[at(i)].v[1] = z_[at(i)].v[2] = 0;
      clip_cone(p.local(i).mu, z_[at(i)].v);
    }
    const double error = search.test(z_.data(), By::factors);
    const bool exact = search.near_round_off();
    // Errors of many contacts on each other add up: near round-off all digits are taken that cost
    // a solve each.
    if ((search.solved() && !exact) || !(error < 0.5 * last)) return;
    last = error;
    velocities(p, exact, z_.data(), w_.data());
    matrix.solve(w_.data());
    search.count_sweep();
    entries(z_) -= entries(w_);
  }
}

}  // namespace tether::contact::detail
