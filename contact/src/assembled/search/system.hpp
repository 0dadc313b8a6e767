// Tether: kernels on a problem under a law, shared by the stages of the solver.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <limits>
#include <tether/contact/solver.hpp>
#include <tether/linalg/friction_cone.hpp>

#include "law/interface/law.hpp"
#include "problem/criterion.hpp"

namespace tether::contact::detail {

using Packed = linalg::PackedVectors;

inline linalg::BlockPattern pattern(const Problem& p) {
  return {p.contacts(), p.row_start().data(), p.columns().data()};
}

// Proximal term (tau / 2) |x - anchor|^2 in the metric of the diagonal blocks; none if anchor =
// null.
struct Proximal {
  double tau = 0;
  const PackedVector* anchor = nullptr;
};

// Loads (System::load) above this are those of heavy bodies on light ones.
constexpr double kOrdinaryLoad = 1e3;

// A problem together with the law for each contact. Kernels are built for the machine at hand.
class System {
 public:
  void reset(const Problem& problem, Law law);

  // After reset() with the problem of some contacts of `whole`: the same rules and velocity scales.
  void belong_to(const System& whole, const int* contacts);
  // And the same parts of bodies: `whole` may have blocks of zeros beside those of an island.
  void share_as(const System& whole, const int* contacts);

  // The problem that the stages see: the given one, or in units in which nothing leaves the range.
  const Problem& problem() const { return *problem_; }
  bool in_other_units() const { return !mass_.empty(); }
  // Impulses of the given problem in these units, and back. Exact within the range of doubles.
  void to_own_units(PackedVector* x) const;
  void to_given_units(PackedVector* x) const;
  // Exponents of units: impulses and velocities of contact i in these units, times these powers of
  // 2, are those of the given problem.
  int impulse_unit(int i) const {
    return in_other_units() ? mass_[at(problem_->islands()[at(i)])] + velocity_unit(i) : 0;
  }
  int velocity_unit(int i) const {
    return in_other_units() ? -speed_[at(problem_->islands()[at(i)])] : 0;
  }
  const LawKernels& law() const { return *law_; }
  // The friction coefficient of contact i that counts: 0 under a law without friction.
  double friction(int i) const { return law_->friction ? problem_->local(i).mu : 0; }
  int size() const { return n_; }
  double norm_b() const { return norm_b_; }
  bool replaced(int i) const { return any_replaced_ && rule_[at(i)] != 0; }
  bool any_replaced() const { return any_replaced_; }
  // The law that replaces this one, at contact i.
  void replace(int i);
  double weight(int i) const { return weight_[at(i)]; }
  const std::vector<double>& weights() const { return weight_; }
  double lambda(int i) const { return lambda_[at(i)]; }
  // Slips are searched for anew.
  void forget_slips() { std::fill(lambda_.begin(), lambda_.end(), -1); }

  // One Gauss-Seidel sweep on x in place, contacts in the given order.
  void sweep(PackedVector* x, const Proximal& proximal = {});
  // out_i = block solution of contact i with all others as in x (Jacobi). Regimes and, if asked
  // for, derivatives dx/db of each block; returns (sum weight^2 |out - x|^2)^1/2.
  double blocks(const PackedVector* x, PackedVector* out, const Proximal& proximal = {},
                Regime* regimes = nullptr, LocalDerivative* derivatives = nullptr);
  // z are block solutions; change_i is how far z_i is from x_i, as a velocity over the scale of the
  // island.
  void changes(const PackedVector* x, PackedVector* z, double* change);
  // w = A x - b
  void velocities(const PackedVector* x, PackedVector* w) const;
  // The same for another b: changes keep digits that b would take.
  void velocities(const PackedVector* x, const PackedVector* b, PackedVector* w) const;
  // Natural map over the norms (scratch is overwritten), or the block fixed point.
  double natural_map(const PackedVector* x, PackedVector* scratch) const;
  Test fixed_point(const PackedVector* x);
  // Both with long sums (law/exact_error.hpp): where rounding() is not far below what counts.
  void exact_velocities(const PackedVector* x, PackedVector* w) const;
  // Null, or where the errors of all contacts go.
  double exact_fixed_point(const PackedVector* x, double* each = nullptr);
  // The larger one of error and round-off, with long sums where it needs them: what is reported.
  double judged_fixed_point(const PackedVector* x);
  // Rounding of w = A x - b, relative to the velocity scale of the island: the largest component of
  // u |A| |x|. A residual below it says nothing.
  double rounding(const PackedVector* x) const;
  // |A| |x| relative to the velocity scale: 10 to 1000 between bodies of similar masses.
  double load(const PackedVector* x) const { return rounding(x) / kRoundOff; }
  // 1 / velocity scale of the island of contact i.
  double inverse_scale(int i) const { return inverse_scale_[at(i)]; }
  int islands() const { return static_cast<int>(needed_.size()); }
  // b = 0 in the island of contact i: the solution is x = 0, and nothing else is judged as one.
  bool at_rest(int i) const { return inverse_scale_[at(i)] == kAtRest; }

  // gamma of contact i in its own frame: slip is opposite to x_t / |x_t| + gamma.
  void gamma(int i, double* out) const { law_of(i).gamma(problem_->local(i), out); }
  // At the solution x, w of this problem.
  void tangent(int i, const PackedVector& x, const PackedVector& w, LawTangent& out) const {
    law_of(i).tangent(problem_->local(i), x.v, w.v, out);
  }

  int sweeps = 0;

 private:
  void choose_units(const Problem& problem);
  View error_view();
  double natural_map_given(const PackedVector* x, PackedVector* scratch) const;
  const LawKernels& law_of(int i) const { return replaced(i) ? *law_->replacement : *law_; }
  const AssembledKernels& kernels() const { return any_replaced_ ? *law_->mixed : law_->assembled; }

  const Problem* problem_ = nullptr;
  Problem rescaled_;               // empty where the given units serve
  std::vector<int> mass_, speed_;  // exponents of the units of each island; empty: those given
  const LawKernels* law_ = nullptr;
  int n_ = 0;
  double norm_b_ = 0;
  bool any_replaced_ = false;
  std::vector<char> rule_;
  std::vector<std::array<double, 2>> largest_;  // trace of a block, component of b, of each island
  std::vector<double> weight_, lambda_;
  std::vector<double> share_;           // 1 / blocks in the row: the contact's part of its bodies
  std::vector<double> inverse_scale_;   // of the contact's island
  std::vector<double> needed_, norm2_;  // of each island
};

// w = A x - b
void velocities(const Problem& problem, const PackedVector* x, PackedVector* w);
void exact_velocities(const Problem& problem, const PackedVector* x, PackedVector* w);

}  // namespace tether::contact::detail
