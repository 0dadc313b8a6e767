// Tether: implicit differentiation of a solution: its equations. SPDX-License-Identifier:
// BSD-3-Clause
#include "derivative/solution_derivative.hpp"

#include <algorithm>
#include <cmath>
#include <tether/linalg/disjoint_sets.hpp>

#include "problem/refuse.hpp"

namespace tether::contact::detail {

namespace {

// d gamma_t / dA, gamma_t = mu c_t / a, by an entry of the contact's block, of which the symmetric
// part counts.
double slope(const LocalBlock& L, int t, int row, int column) {
  if (row == 0 && column == 0) return -L.mu * (L.inv_a * (L.c[t] * L.inv_a));
  return std::min(row, column) == 0 && std::max(row, column) == t + 1 ? 0.5 * L.mu * L.inv_a : 0;
}

}  // namespace

void DataChange::add_friction(int i, const LocalBlock& L, double friction) {
  mu[at(i)] += friction;
  for (int t = 0; t < 2; ++t) gamma[at(i)][at(t)] += friction * (L.c[t] * L.inv_a);
}

void DataChange::add_entry(int i, const LocalBlock& L, int row, int column, double value) {
  for (int t = 0; t < 2; ++t) gamma[at(i)][at(t)] += slope(L, t, row, column) * value;
}

double DataChange::mu_gradient(int i, const LocalBlock& L) const {
  return mu[at(i)] + L.inv_a * (L.c[0] * gamma[at(i)][0] + L.c[1] * gamma[at(i)][1]);
}

double DataChange::entry_gradient(int i, const LocalBlock& L, int row, int column) const {
  return slope(L, 0, row, column) * gamma[at(i)][0] + slope(L, 1, row, column) * gamma[at(i)][1];
}

SolutionDerivative::SolutionDerivative(const Problem& problem, Law law,
                                       const linalg::VectorView& impulses,
                                       const DerivativeOptions& options)
    : problem_(problem) {
  require(options.tolerance > 0 && std::isfinite(options.tolerance), "tolerance", options.tolerance,
          "must be finite and > 0");
  require(options.kink >= 0 && std::isfinite(options.kink), "kink", options.kink,
          "must be finite and >= 0");
  require(options.rank_tolerance > 0 && options.rank_tolerance < 1, "rank_tolerance",
          options.rank_tolerance, "must lie between 0 and 1");
  x_ = problem_.pack(impulses);
  require_finite("impulses", impulses);
  system_.reset(problem_, law);
  for (int i : options.replaced) {
    require(i >= 0 && i < problem_.contacts(), "replaced contact", i, "must be one of the problem");
    if (system_.law().replacement == nullptr)
      refuse("replaced contact", i,
             (std::string("the law ") + name(law) + " has no replacement").c_str());
    system_.replace(i);
  }
  system_.to_own_units(x_.data());
  accept(options);
  linearise(options);
  collect_islands();
  for (auto& island : islands_) {
    assemble(*island);
    island->factor(std::max(options.rank_tolerance, slides(*island) ? report_.error : 0.0));
  }
  judge_rank();
  advise();
}

void SolutionDerivative::accept(const DerivativeOptions& options) {
  report_.error = system_.judged_fixed_point(x_.data());
  if (report_.error <= options.tolerance) return;
  const std::string wanted =
      "must be at most DerivativeOptions::tolerance = " + shown(options.tolerance);
  refuse(std::string("error of the impulses (Residuals::fixed_point) under the law ") +
             system_.law().name,
         report_.error, wanted.c_str());
}

void SolutionDerivative::linearise(const DerivativeOptions& options) {
  const int n = problem_.contacts();
  const double kink = std::max(options.kink, 10 * report_.error);
  place_.assign(at(n), -1);
  Packed w(at(n));
  velocities(system_.problem(), true, x_.data(), w.data());
  for (int i = 0; i < n; ++i) {
    LawTangent t;
    system_.tangent(i, x_[at(i)], w[at(i)], t);
    report_.regimes.push_back(t.regime);
    const double margin = t.margin * system_.inverse_scale(i);
    if (!(margin > kink)) report_.kinks.push_back({i, t.regime, t.other, margin});
    if (t.regime == Regime::separating) continue;
    place_[at(i)] = static_cast<int>(relations_.size());
    const double weight = system_.weight(i);
    for (int r = 0; r < 3; ++r) {
      double square = 0;
      for (int c = 0; c < 3; ++c) {
        t.P[r][c] /= weight;
        t.Q[r][c] *= weight;
        square += t.P[r][c] * t.P[r][c] + t.Q[r][c] * t.Q[r][c];
      }
      const double f = square > 0 ? 1 / std::sqrt(square) : 0;
      for (int c = 0; c < 3; ++c) t.P[r][c] *= f, t.Q[r][c] *= f;
      for (int c = 0; c < 2; ++c) t.coupling[r][c] *= f;
      t.friction[r] *= f;
    }
    relations_.push_back(t);
  }
}

// Touching contacts that blocks of A connect.
void SolutionDerivative::collect_islands() {
  const Problem& p = system_.problem();
  const int n = p.contacts();
  const auto each_neighbour = [&](int i, const auto& visit) {
    for (int k = p.row_start()[at(i)]; k < p.row_start()[at(i + 1)]; ++k)
      if (place_[at(p.columns()[at(k)])] >= 0) visit(p.columns()[at(k)]);
  };
  linalg::DisjointSets sets(n);
  for (int i = 0; i < n; ++i)
    if (place_[at(i)] >= 0) each_neighbour(i, [&](int j) { sets.join(i, j); });
  std::vector<IslandEquations*> of(at(n));  // of roots, which precede the others
  std::vector<int> local(at(n));
  for (int i = 0; i < n; ++i) {
    if (place_[at(i)] < 0) continue;
    IslandEquations*& island = of[at(sets.root(i))];
    if (!island) island = islands_.emplace_back(std::make_unique<IslandEquations>()).get();
    local[at(i)] = island->size();
    island->contacts.push_back(i);
  }
  for (const auto& island : islands_)
    for (int i : island->contacts) {
      each_neighbour(i, [&](int j) { island->columns.push_back(local[at(j)]); });
      island->starts.push_back(static_cast<int>(island->columns.size()));
    }
}

// M_ij = P_i delta_ij + Q_i A_ij, A scaled to unit traces.
void SolutionDerivative::assemble(IslandEquations& island) const {
  const Problem& p = system_.problem();
  island.blocks.assign(island.columns.size(), PackedBlock());
  for (int row = 0; row < island.size(); ++row) {
    const int i = island.contacts[at(row)];
    const LawTangent& R = relations_[at(place_[at(i)])];
    int from = p.row_start()[at(i)];
    for (int k = island.starts[at(row)]; k < island.starts[at(row + 1)]; ++k) {
      const int j = island.contacts[at(island.columns[at(k)])];
      while (p.columns()[at(from)] != j) ++from;
      const double* A = p.blocks()[at(from)].column;
      const double scale = 1 / (system_.weight(i) * system_.weight(j));
      double* M = island.blocks[at(k)].column;
      for (int c = 0; c < 3; ++c)
        for (int r = 0; r < 3; ++r) {
          double sum = i == j ? R.P[r][c] : 0;
          for (int m = 0; m < 3; ++m) sum += R.Q[r][m] * (scale * A[4 * c + m]);
          M[4 * c + r] = sum;
        }
    }
  }
}

// The equations of contacts that slide are as exact as the impulses are.
bool SolutionDerivative::slides(const IslandEquations& island) const {
  return std::any_of(island.contacts.begin(), island.contacts.end(), [&](int i) {
    return report_.regimes[at(i)] == Regime::sliding && system_.friction(i) > 0;
  });
}

// A direction that the equations do not see says which impulses are not determined, and by A of it
// whether velocities are.
void SolutionDerivative::judge_rank() {
  constexpr double kSeen = 1e-6;
  const int d = problem_.dimension(), n = problem_.contacts();
  Packed y(at(n)), moved(at(n));
  double largest = 0;
  report_.unknowns = d * static_cast<int>(relations_.size());
  report_.rank = report_.unknowns;
  for (const auto& island : islands_) {
    report_.rank -= island->deficiency;
    if (island->free.empty()) continue;
    double most = 0;
    for (const PackedVector& v : island->free)
      for (double c : v.v) most = std::max(most, std::abs(c));
    for (int k = 0; k < island->size(); ++k) {
      const int i = island->contacts[at(k)];
      for (int c = 0; c < 3; ++c) {
        const double part = most > 0 ? island->free[at(k)].v[c] / most : 0;
        y[at(i)].v[c] = part / system_.weight(i);
        if (std::abs(part) > kSeen &&
            (report_.not_unique.empty() || report_.not_unique.back() != i))
          report_.not_unique.push_back(i);
      }
    }
  }
  if (report_.rank == report_.unknowns) return;
  std::sort(report_.not_unique.begin(), report_.not_unique.end());
  report_.status = DerivativeStatus::minimum_norm;
  const Packed none(at(n));
  system_.velocities(y.data(), none.data(), moved.data());
  for (int i = 0; i < n; ++i)
    for (double v : moved[at(i)].v) largest = std::max(largest, std::abs(v) / system_.weight(i));
  report_.velocities_unique = largest <= kSeen;
}

void SolutionDerivative::advise() {
  const auto add = [&](const std::string& sentence) {
    report_.advice += (report_.advice.empty() ? "" : " ") + sentence;
  };
  if (!report_.strictly_regular())
    add(std::to_string(report_.kinks.size()) +
        " contacts lie at kinks: the derivative is that of the branch in `regimes`; beyond, "
        "another "
        "one holds.");
  if (report_.status == DerivativeStatus::minimum_norm)
    add("Impulses are not unique (" + std::to_string(report_.unknowns - report_.rank) +
        " free directions): the least change is given; " +
        (report_.velocities_unique ? "velocities are determined."
                                   : "velocities are not determined either."));
}

SolutionChange SolutionDerivative::forward(const DataChange& change) const {
  SolutionChange out{Packed(at(problem_.contacts())), 0};
  double left = 0, whole = 0;
  for (const auto& island : islands_) {
    Packed y(island->contacts.size()), product(y.size());
    for (int k = 0; k < island->size(); ++k) {
      const int i = island->contacts[at(k)];
      const LawTangent& R = relations_[at(place_[at(i)])];
      for (int r = 0; r < 3; ++r) {
        double sum = R.friction[r] * change.mu[at(i)];
        for (int c = 0; c < 2; ++c) sum += R.coupling[r][c] * change.gamma[at(i)][at(c)];
        for (int c = 0; c < 3; ++c)
          sum += R.Q[r][c] * std::ldexp(change.shift[at(i)].v[c], -system_.velocity_unit(i)) /
                 system_.weight(i);
        y[at(k)].v[r] = -sum;
      }
    }
    const Packed right = y;
    island->factors->solve(y.data());
    island->multiply(y.data(), product.data());
    for (int k = 0; k < island->size(); ++k) {
      const int i = island->contacts[at(k)];
      for (int c = 0; c < 3; ++c) {
        const double r = right[at(k)].v[c], d = product[at(k)].v[c] - r;
        left += d * d;
        whole += r * r;
        out.x[at(i)].v[c] = y[at(k)].v[c] / system_.weight(i);
      }
    }
  }
  out.residual = whole > 0 ? std::sqrt(left / whole) : 0;
  system_.to_given_units(out.x.data());
  return out;
}

DataChange SolutionDerivative::adjoint(const Packed& rows) const {
  DataChange out(at(problem_.contacts()));
  for (const auto& island : islands_) {
    Packed y(island->contacts.size());
    for (int k = 0; k < island->size(); ++k) {
      const int i = island->contacts[at(k)];
      for (int c = 0; c < 3; ++c)
        y[at(k)].v[c] = std::ldexp(rows[at(i)].v[c], system_.impulse_unit(i)) / system_.weight(i);
    }
    island->factors->solve_transposed(y.data());
    for (int k = 0; k < island->size(); ++k) {
      const int i = island->contacts[at(k)];
      const LawTangent& R = relations_[at(place_[at(i)])];
      for (int r = 0; r < 3; ++r) {
        const double v = y[at(k)].v[r];
        out.mu[at(i)] -= R.friction[r] * v;
        for (int c = 0; c < 2; ++c) out.gamma[at(i)][at(c)] -= R.coupling[r][c] * v;
        for (int c = 0; c < 3; ++c)
          out.shift[at(i)].v[c] -=
              std::ldexp(R.Q[r][c] * v / system_.weight(i), -system_.velocity_unit(i));
      }
    }
  }
  return out;
}

}  // namespace tether::contact::detail
