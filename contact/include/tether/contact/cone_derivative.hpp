// Tether: derivatives of solutions over products of cones. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <tether/contact/cones.hpp>
#include <tether/contact/derivative.hpp>
#include <tether/export.hpp>
#include <utility>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact {

namespace detail {
struct TETHER_HIDDEN ConeDerivativeParts;
}

/// A direction in which the data of a ConeProblem change, or the gradient of a number with respect
/// to them. A holds its compliance: a change of that is one of the diagonal. Empty: no change.
struct ConeDirection {
  std::vector<MatrixEntry> A;  ///< equal places are summed; gradient: the entries of the problem
  linalg::VectorX b;           ///< by row
  linalg::VectorX mu, rolling, torsional, bound;  ///< by block; of blocks that have none: ignored
};

using ConeSolutionDirection = SolutionDirection;  ///< by row

/// J v and J' v of the solution x, w of a ConeProblem under Law::coulomb: those of the contacts
/// that stand for its cones (Derivative, whose factors they use), and of the free rows by theirs.
/// Not for use by two threads at once.
class ConeDerivative {
 public:
  /// Contacts in it are blocks of the problem (`regimes`: one for each, of free ones sticking, of
  /// bounded ones sticking or sliding); a block with moments may stand in a list several times.
  /// unknowns and rank count components of the contacts that stand for the cones.
  const DerivativeReport& report() const;

  /// Throws std::invalid_argument on sizes that do not match, entries outside of the matrix and
  /// values that are not finite.
  SolutionDirection forward(const ConeDirection& direction) const;
  /// The gradient of impulses.x + velocities.w for given rows; empty: 0.
  ConeDirection adjoint(const linalg::VectorView& impulses,
                        const linalg::VectorView& velocities = linalg::VectorX()) const;

 private:
  friend ConeDerivative derivative(const ConeProblem&, const linalg::VectorView&,
                                   const DerivativeOptions&);
  explicit ConeDerivative(std::shared_ptr<const detail::ConeDerivativeParts> parts)
      : parts_(std::move(parts)) {}
  std::shared_ptr<const detail::ConeDerivativeParts> parts_;
};

/// At `impulses`, a solution of `problem` under Law::coulomb within options.tolerance: otherwise,
/// and on bad values, throws std::invalid_argument. options.replaced is not used.
ConeDerivative derivative(const ConeProblem& problem, const linalg::VectorView& impulses,
                          const DerivativeOptions& options = {});

}  // namespace tether::contact
TETHER_EXPORT_END
