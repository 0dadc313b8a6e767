// Tether: implicit differentiation of a solution, by what the data do to each contact (method, eq.
// 31). SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <memory>
#include <tether/contact/derivative.hpp>
#include <tether/linalg/block3.hpp>
#include <vector>

#include "assembled/search/search.hpp"

namespace tether::contact::detail {

/// M and its transpose for least-norm least-squares solutions: y = M^+ r, y = M'^+ r.
class EquationFactors {
 public:
  virtual ~EquationFactors() = default;
  virtual void solve(linalg::PackedVector* y) = 0;
  virtual void solve_transposed(linalg::PackedVector* y) = 0;
  virtual int deficiency() const = 0;  ///< rows less rank
};

/// The touching contacts of an island, 3 rows each; a symmetric pattern of blocks with a diagonal.
struct IslandEquations {
  std::vector<int> contacts;  ///< of the problem
  std::vector<int> starts{0}, columns;
  std::vector<linalg::PackedBlock> blocks;
  std::unique_ptr<EquationFactors> factors;
  int deficiency = 0;          ///< 3 size() less the rank
  linalg::PackedVectors free;  ///< a direction y with M y = 0; empty: M is regular

  int size() const { return static_cast<int>(contacts.size()); }
  void multiply(const linalg::PackedVector* y, linalg::PackedVector* out) const;
  void multiply_transposed(const linalg::PackedVector* y, linalg::PackedVector* out) const;
  void factor(double rank_tolerance);
};

/// Change of the equations of each contact by a change of the data, or the gradient with respect to
/// it.
struct DataChange {
  Packed shift;                              // of w at fixed impulses: dA x - db
  std::vector<std::array<double, 2>> gamma;  // of gamma = mu c / a
  std::vector<double> mu;                    // of mu alone

  explicit DataChange(std::size_t contacts) : shift(contacts), gamma(contacts), mu(contacts) {}
  /// dmu_i and dgamma_i from the change of a contact's coefficient, and of an entry of its own
  /// block.
  void add_friction(int i, const LocalBlock& L, double friction);
  void add_entry(int i, const LocalBlock& L, int row, int column, double value);
  /// The transpose: gradients with respect to that coefficient and that entry.
  double mu_gradient(int i, const LocalBlock& L) const;
  double entry_gradient(int i, const LocalBlock& L, int row, int column) const;
};

/// The change of the impulses, in the units of the given problem.
struct SolutionChange {
  Packed x;
  double residual = 0;
};

class TETHER_HIDDEN SolutionDerivative {
 public:
  SolutionDerivative(const Problem& problem, Law law, const linalg::VectorView& impulses,
                     const DerivativeOptions& options);

  const Problem& problem() const { return problem_; }
  const DerivativeReport& report() const { return report_; }

  SolutionChange forward(const DataChange& change) const;
  /// The gradient of rows.x.
  DataChange adjoint(const Packed& rows) const;

 private:
  void accept(const DerivativeOptions& options);
  void linearise(const DerivativeOptions& options);
  void collect_islands();
  void assemble(IslandEquations& island) const;
  bool slides(const IslandEquations& island) const;
  void judge_rank();
  void advise();

  Problem problem_;
  System system_;
  Packed x_;                           // in the units of system_
  std::vector<int> place_;             // of touching contacts in relations_; -1: open
  std::vector<LawTangent> relations_;  // in scaled units: rows of length 1, y = weight dx
  std::vector<std::unique_ptr<IslandEquations>> islands_;
  DerivativeReport report_;
};

}  // namespace tether::contact::detail
