// Tether: the equations of an island's derivative and their transpose. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <memory>
#include <tether/linalg/block3.hpp>
#include <vector>

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

/// By complete orthogonal decomposition.
std::unique_ptr<EquationFactors> dense_factors(const IslandEquations& equations,
                                               double rank_tolerance);
/// Sparse LU with refinement; null: a pivot vanishes.
std::unique_ptr<EquationFactors> sparse_factors(const IslandEquations& equations);
/// Minimum-norm factors of M, and of its transpose once these are asked for.
std::unique_ptr<EquationFactors> deficient_factors(const IslandEquations& equations,
                                                   double rank_tolerance);

}  // namespace tether::contact::detail
