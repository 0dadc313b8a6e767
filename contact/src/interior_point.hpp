// Tether: interior points for the exact cones. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "block_lu.hpp"
#include "search.hpp"

namespace tether::contact::detail {

// Follows x o u = nu e, nu -> 0, for x in K and u = w + s (mu, gamma) in K*, w = A x - b. With
// s = s(u) the velocity w is an explicit function of u, so that one Newton matrix A + (block
// diagonal) holds the law as well; it is regular whatever the rank of A (README, section 9).
class InteriorPoint {
 public:
  void reset(int contacts);
  // From the point where everything sticks; at most `most` steps. The result is search.best.
  void run(Search& search, int most);
  // From near x.
  void run_near(Search& search, const PackedVector* x, int most);
  // Proximal point iteration from x: each of at most `most` problems A + tau D, b + tau D x, which a
  // small tau D makes solvable where the path of the problem itself ends, starts near its anchor.
  void run_proximal(Search& search, const PackedVector* x, int most);
  // Estimated ns of one step.
  double cost(const Search& search) const;

 private:
  // Scaling of one contact by Nesterov and Todd: H x = u, H = theta (2 omega omega' - J),
  // J = diag(1, -1, -1); W = sqrt(H), lambda = W x.
  struct Scaling {
    double omega[3], root[3], lambda[3], lambda_det, theta, root_theta;
  };
  bool start(Search& search);
  bool start_near(Search& search, const PackedVector* x, double near);
  // Steps until nothing is gained or, for a proximal problem, until its natural map is <= target;
  // returns that map.
  double follow(Search& search, int most, double target);
  double natural_map(const System& system) const;
  bool scale(int i);
  bool factor(Search& search);
  void direction(const System& system, double centre, bool correct);
  double longest_step() const;
  double complementarity() const;  // mean of x.u
  void advance(double step);
  void residual(const System& system);

  int n_ = 0;
  double tau_ = 0;  // of the proximal term, D: mean diagonal of each block
  bool ordered_ = false;
  BlockLu lu_;
  std::vector<Scaling> scaling_;
  std::vector<char> flat_;  // mu = 0: x_n and u_n alone
  // x and u in the frame where the cone is its own dual, (mu x_n, x_t) and (u_n / mu, u_t), with
  // their distance from the cone, |.|_n - |.|_t, as fourth component: close to it the difference
  // has lost its digits. r: residual of w(u) = A x - b; z: x as impulses.
  Packed x_, u_, dx_, du_, affine_x_, affine_u_, r_, w_, z_, swept_, anchor_;
};

}  // namespace tether::contact::detail
