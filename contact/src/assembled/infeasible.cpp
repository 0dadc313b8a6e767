// Tether: the proof that a contact problem has no solution. SPDX-License-Identifier: BSD-3-Clause
#include "assembled/automatic.hpp"

#include <algorithm>
#include <cmath>

#include "assembled/stages/proximal_newton.hpp"
#include "problem/criterion.hpp"

namespace tether::contact::detail {
namespace {

// Zero to round-off: an entry of d, or of A d, below so many units of its largest possible value in
// the island, with contacts weighed by their diagonal blocks. Entries of A are differences of terms
// of this size.
constexpr double kZero = 512 * kRoundOff;

// Leaves in d one island for which it is a proof; false: there is none.
bool keep_proof(const System& system, double tolerance, Packed& d) {
  const Problem& p = system.problem();
  const int n = system.size();
  std::vector<double> closing, sum, most;
  std::vector<char> balanced;
  for (int i = 0; i < n; ++i) {
    const std::size_t island = at(p.islands()[at(i)]);
    if (island == sum.size()) {
      closing.push_back(0);
      sum.push_back(0);
      most.push_back(0);
      balanced.push_back(1);
    }
    most[island] = std::max(most[island], system.weight(i) * d[at(i)].v[0]);
  }
  for (int i = 0; i < n; ++i) {
    double* v = d[at(i)].v;
    const bool pressed = system.weight(i) * v[0] > kZero * most[at(p.islands()[at(i)])];
    v[0] = pressed ? v[0] : 0;
    v[1] = v[2] = 0;
  }
  for (int i = 0; i < n; ++i) {
    const std::size_t island = at(p.islands()[at(i)]);
    double velocity[3] = {0, 0, 0};
    for (int k = p.row_start()[at(i)]; k < p.row_start()[at(i + 1)]; ++k) {
      const double dj = d[at(p.columns()[at(k)])].v[0];
      for (int c = 0; c < 3; ++c) velocity[c] += p.blocks()[at(k)].column[c] * dj;
    }
    for (double v : velocity)
      if (!(std::abs(v) <= kZero * system.weight(i) * most[island])) balanced[island] = 0;
    closing[island] += p.packed_b()[at(i)].v[0] * d[at(i)].v[0] * system.inverse_scale(i);
    sum[island] += d[at(i)].v[0];
  }
  for (std::size_t island = 0; island < sum.size(); ++island) {
    if (!balanced[island] || !(closing[island] > tolerance * sum[island])) continue;
    double largest = 0;
    for (int i = 0; i < n; ++i) {
      if (at(p.islands()[at(i)]) != island) d[at(i)] = {};
      largest = std::max(largest, d[at(i)].v[0]);
    }
    for (PackedVector& v : d) v.v[0] /= largest;
    return true;
  }
  return false;
}

// Whether impulses whose velocities are w rule out every proof: d.w = -b.d for all d with A d = 0.
bool rule_out_proofs(const System& system, double tolerance, const Packed& w) {
  for (int i = 0; i < system.size(); ++i)
    if (!(-w[at(i)].v[0] * system.inverse_scale(i) <= tolerance)) return false;
  return true;
}

}  // namespace

// Proximal point iteration for the frictionless problem: where that has no solution its steps
// converge to such a d, the faster the smaller tau; where it has one, soon no w_n is below zero.
bool proves_infeasible(Search& search, Packed& d) {
  constexpr int kSteps = 40, kCorrections = 12;
  constexpr double kBeyond = 0.1;  // of max_work
  const Problem& problem = search.system.problem();
  const std::size_t n = at(problem.contacts());
  Options options = search.options;
  options.law = Law::frictionless;
  options.measure = Measure::fixed_point;
  options.tolerance = std::numeric_limits<double>::min();
  Search smooth;
  smooth.reset(problem, options);
  // A search that has spent its work may spend a little more: a proof is worth it.
  smooth.work_end = std::max(search.work_end - search.counts.work,
                             std::min(40 * search.sweep_cost * kSteps, kBeyond * options.max_work));
  NewtonMatrix matrix;
  matrix.reset(problem.contacts());
  ProximalNewton newton(matrix);
  newton.reset(problem.contacts());
  Packed anchor(n), point(n), w(n);
  double tau = 1e-2;
  bool found = false;
  for (int step = 0; step < kSteps && !found && newton.affordable(smooth); ++step) {
    smooth.system.sweep(point.data(), {tau, anchor.data()});
    smooth.count_sweep();
    if (newton.correct(smooth, tau, anchor.data(), point, kCorrections) == 0) {
      tau = std::min(1.0, 3 * tau);
      continue;
    }
    d.resize(n);
    entries(d) = entries(point) - entries(anchor);
    found = keep_proof(search.system, search.options.tolerance, d);
    velocities(problem, false, point.data(), w.data());
    smooth.counts.work += smooth.test_cost;
    if (rule_out_proofs(search.system, search.options.tolerance, w)) break;
    anchor = point;
    if (step > 0) tau = std::max(1e-7, 0.1 * tau);
  }
  search.counts.add(smooth.counts);
  return found;
}

}  // namespace tether::contact::detail
