// Tether: implicit differentiation of a solution, in terms of what the data do to each contact.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <tether/contact/derivative.hpp>

#include "assembled/search/system.hpp"
#include "derivative/island_equations.hpp"

namespace tether::contact::detail {

/// Change of the equations of each contact by a change of the data, or the gradient with respect to
/// it.
struct DataChange {
  Packed shift;                              // of w at fixed impulses: dA x - db
  std::vector<std::array<double, 2>> gamma;  // of gamma = mu c / a
  std::vector<double> mu;                    // of mu alone

  explicit DataChange(std::size_t contacts) : shift(contacts), gamma(contacts), mu(contacts) {}
  /// dgamma_i and dmu_i from the change of the contact's own block and of its coefficient.
  void add(int i, const LocalBlock& L, const Eigen::Matrix3d& block, double friction);
  /// The transpose: gradients with respect to that block (symmetric) and that coefficient.
  Eigen::Matrix3d block_gradient(int i, const LocalBlock& L) const;
  double mu_gradient(int i, const LocalBlock& L) const;
};

/// Impulses and velocities, changes or gradients, in the units of the given problem.
struct SolutionChange {
  Packed x, w;
  double residual = 0;
};

class TETHER_HIDDEN SolutionDerivative {
 public:
  SolutionDerivative(const Problem& problem, Law law, const linalg::VectorView& impulses,
                     const DerivativeOptions& options);

  const Problem& problem() const { return problem_; }
  const DerivativeReport& report() const { return report_; }
  const linalg::VectorX& impulses() const { return impulses_; }
  const Packed& x() const { return x_; }

  SolutionChange forward(const DataChange& change) const;
  DataChange adjoint(const SolutionChange& rows) const;

 private:
  // The law's relation of a touching contact in scaled units: rows of length 1, y = weight dx.
  struct Relation {
    double P[3][3], Q[3][3], friction[3], coupling[3][2];
  };
  void accept(const DerivativeOptions& options);
  void linearise(const DerivativeOptions& options);
  void collect_islands();
  void assemble(IslandEquations& island) const;
  bool slides(const IslandEquations& island) const;
  void judge_rank();
  void advise();

  Problem problem_;
  linalg::VectorX impulses_;
  Packed x_;  // as given
  System system_;
  Packed own_x_, own_w_;    // in the units of system_
  std::vector<int> place_;  // of touching contacts in relations_; -1: open
  std::vector<Relation> relations_;
  std::vector<std::unique_ptr<IslandEquations>> islands_;
  DerivativeReport report_;
};

}  // namespace tether::contact::detail
