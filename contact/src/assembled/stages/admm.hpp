// Tether: alternating directions with one factorisation. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "assembled/search/search.hpp"
#include <tether/linalg/anderson.hpp>
#include <tether/linalg/block_lu.hpp>

namespace tether::contact::detail {

// Splits the equations A x - b + (De Saxce term) = multiplier from the cone x in K:
//   z = P_K(v), u = v - z, s = d |u_t|, x = (A + d)^-1 (b - (mu s, s gamma) + d (z - u)), v += x -
//   z
// with d_i = rho trace(A_ii) / 3 (README, section 7). v persists between runs until start().
class Admm {
 public:
  static constexpr double kRho = 0.1;
  static constexpr int kDepth = 8;

  void reset(int contacts);
  void start(Search& search, const PackedVector* x);
  bool started() const { return started_; }
  const PackedVector* point() const { return z_.data(); }
  double point_error() const { return point_error_; }  // measure of point() when last tested
  // At most `most` iterations; windowed: leave after 40 iterations without prospect.
  void run(Search& search, int most, bool accelerate, bool windowed);

 private:
  bool factor(Search& search);
  int n_ = 0;
  bool started_ = false, factored_ = false;
  double point_error_ = 0;
  Anderson anderson_;
  BlockLu lu_;
  std::vector<double> d_;
  Packed v_, z_, g_, f_, r_;
};

}  // namespace tether::contact::detail
