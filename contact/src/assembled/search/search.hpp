// Tether: the state of a solve: a problem under a law, its best point and the work spent.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <limits>
#include <memory>
#include <tether/contact/solver.hpp>
#include <tether/linalg/friction_cone.hpp>

#include "law/interface/law.hpp"
#include "problem/body_form.hpp"
#include "problem/criterion.hpp"

namespace tether::contact::detail {

using Packed = linalg::PackedVectors;

/// All components, with a zero behind each three.
inline Eigen::Map<Eigen::VectorXd> entries(Packed& x) {
  return {x.data()->v, 4 * static_cast<Eigen::Index>(x.size())};
}
inline Eigen::Map<const Eigen::VectorXd> entries(const Packed& x) {
  return {x.data()->v, 4 * static_cast<Eigen::Index>(x.size())};
}

inline linalg::BlockPattern pattern(const Problem& p) {
  return {p.contacts(), p.row_start().data(), p.columns().data()};
}

// Proximal term (tau / 2) |x - anchor|^2 in the metric of the diagonal blocks; none if anchor =
// null.
struct Proximal {
  double tau = 0;
  const PackedVector* anchor = nullptr;
};

// A larger load (System::load) means heavy bodies on light ones.
constexpr double kOrdinaryLoad = 1e3;

// A problem together with the law of each contact. Kernels are chosen for the processor.
class System {
 public:
  void reset(const Problem& problem, Law law);

  // After reset() with some contacts of `whole`: takes over its laws, velocity scales and shares of
  // bodies (method, section 3.1), which blocks of zeros in `whole` change.
  void belong_to(const System& whole, const std::vector<int>& contacts);

  // The problem that stages solve: the given one, or the same in units without overflow.
  const Problem& problem() const { return *problem_; }
  /// Its factors by bodies, given with it or found; null where there are none.
  const BodyForm* body_form() const { return found_ ? found_.get() : problem_->body_form(); }
  /// Looks for the bodies of a problem that is given by its matrix.
  void find_bodies() { found_ = bodies_of_matrix(*problem_); }
  bool may_have_bodies() const { return detail::may_have_bodies(*problem_); }
  double price_of_bodies() const;  ///< estimated ns of find_bodies()
  bool in_other_units() const { return !mass_.empty(); }
  // Impulses of the given problem in these units, and back. Exact within the range of doubles.
  void to_own_units(PackedVector* x) const { change_units(x, -1); }
  void to_given_units(PackedVector* x) const { change_units(x, 1); }
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
  bool replaced(int i) const { return any_replaced() && rule_[at(i)] != 0; }
  bool any_replaced() const { return !rule_.empty(); }
  // Contact i obeys the law's replacement from now on.
  void replace(int i);
  double weight(int i) const { return weight_[at(i)]; }
  // The next block solutions search for their slips from the start.
  void forget_slips() { std::fill(lambda_.begin(), lambda_.end(), -1); }

  // One Gauss-Seidel sweep on x in place, contacts in the given order.
  void sweep(PackedVector* x, const Proximal& proximal = {});
  // out_i = block solution of contact i with all others as in x (Jacobi). Regimes and, if asked
  // for, derivatives dx/db of each block; returns (sum weight^2 |out - x|^2)^1/2.
  double blocks(const PackedVector* x, PackedVector* out, const Proximal& proximal = {},
                Regime* regimes = nullptr, LocalDerivative* derivatives = nullptr);
  // z: block solutions; change_i: |z_i - x_i| as a velocity over the scale of the island.
  void changes(const PackedVector* x, PackedVector* z, double* change);
  // A x - b for another b: for changes, whose digits b would absorb.
  void velocities(const PackedVector* x, const PackedVector* b, PackedVector* w) const;
  // Natural map over the norms (scratch is overwritten), or the block fixed point.
  double natural_map(const PackedVector* x, PackedVector* scratch) const;
  Test fixed_point(const PackedVector* x);
  // With long sums (law/kernels/exact_error.hpp), for errors that are not far above rounding().
  // each: receives the errors of all contacts, or null.
  double exact_fixed_point(const PackedVector* x, double* each = nullptr);
  // The reported error: the larger one of error and round-off, by long sums where needed.
  double judged_fixed_point(const PackedVector* x);
  // Rounding of w = A x - b (method, section 3.2): the largest component of u |A| |x| over the
  // velocity scale of its island.
  double rounding(const PackedVector* x) const;
  // |A| |x| relative to the velocity scale: 10 to 1000 between bodies of similar masses.
  double load(const PackedVector* x) const { return rounding(x) / kRoundOff; }
  // 1 / velocity scale of the island of contact i.
  double inverse_scale(int i) const { return inverse_scale_[at(i)]; }
  int islands() const { return static_cast<int>(needed_.size()); }
  // b = 0 in the island of contact i: only x = 0 counts as its solution.
  bool at_rest(int i) const { return inverse_scale_[at(i)] == kAtRest; }

  // gamma of contact i in its own frame: slip is opposite to x_t / |x_t| + gamma.
  void gamma(int i, double* out) const { law_of(i).gamma(problem_->local(i), out); }
  // v: the point of the natural map of contact i at x, w.
  void natural_point(int i, const PackedVector& x, const PackedVector& w, double* v) const {
    law_of(i).natural_point(problem_->local(i), x.v, w.v, v);
  }
  // The linearised law of contact i at the solution x, w.
  void tangent(int i, const PackedVector& x, const PackedVector& w, LawTangent& out) const {
    law_of(i).tangent(problem_->local(i), x.v, w.v, out);
  }

 private:
  void choose_units(const Problem& problem);
  void change_units(PackedVector* x, int sign) const;
  View error_view();
  double natural_map_given(const PackedVector* x, PackedVector* scratch) const;
  const LawKernels& law_of(int i) const { return replaced(i) ? *law_->replacement : *law_; }
  const AssembledKernels& kernels() const {
    return any_replaced() ? *law_->mixed : law_->assembled;
  }

  const Problem* problem_ = nullptr;
  Problem rescaled_;  // empty where the given units serve
  std::shared_ptr<const BodyForm> found_;
  std::vector<int> mass_, speed_;  // exponents of the units of each island; empty: those given
  const LawKernels* law_ = nullptr;
  int n_ = 0;
  double norm_b_ = 0;
  std::vector<char> rule_;  // 1: the contact obeys the replacement; empty: none does
  std::vector<std::array<double, 2>> largest_;  // trace of a block, component of b, of each island
  std::vector<double> weight_, lambda_;
  std::vector<double> share_;           // 1 / blocks in the row: the contact's part of its bodies
  std::vector<double> inverse_scale_;   // of the contact's island
  std::vector<double> needed_, norm2_;  // of each island
};

// w = A x - b, long_sums: of errors that are not far above rounding.
void velocities(const Problem& problem, bool long_sums, const PackedVector* x, PackedVector* w);

// The kind of stage that has found a point. With large mass ratios sweeps do not reach round-off,
// so long sums are not spent on their points.
enum class By { sweeps, factors };

// Stages improve the same best point; none may overwrite it by a worse one (method, section 10).
// All decisions use residuals and operation counts, never the clock.
struct Search {
  System system;
  Options options;
  Counts counts;
  Packed best;
  double best_error = std::numeric_limits<double>::infinity();
  double work_end = 0;                   // of the present attempt
  double sweep_cost = 0, test_cost = 0;  // estimated ns

  void reset(const Problem& problem, const Options& o);
  // Measures x, keeps it if it is the best.
  double test(const PackedVector* x, By by);
  // Whether errors near the tolerance need long sums, because sums of doubles are only round-off.
  bool near_round_off() const { return hidden_ > options.tolerance; }
  // Whether round-off may explain the error of the best point, which is then found with long sums.
  bool explained_by_round_off();
  // Errors of all contacts, as velocities over the scales of their islands: the change by a block
  // solution, or near_round_off() the judged error by long sums. Returns the largest.
  double errors(const PackedVector* x, double* each);
  bool solved() const { return best_error <= options.tolerance; }
  // Whether it is solved without knowledge of the last slips, as evaluate() judges it.
  bool confirmed();
  bool exhausted() const {
    return counts.work > work_end ||
           (best_error <= options.enough && counts.work > 0.75 * options.max_work);
  }
  void count_sweep() {
    ++counts.sweeps;
    counts.work += sweep_cost;
  }

 private:
  double fixed_point_error(const PackedVector* x, By by);

  Packed scratch_;
  double hidden_ = 0;  // error that round-off of double sums may hide; 0: not near the tolerance
};

}  // namespace tether::contact::detail
