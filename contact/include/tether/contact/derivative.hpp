// Tether: derivatives of the solution of a contact problem. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <tether/contact/cones.hpp>
#include <tether/export.hpp>
#include <utility>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact {

namespace detail {
struct TETHER_HIDDEN DerivativeParts;
}  // namespace detail

/// Which impulses count as a solution, and which contacts as kinks.
struct DerivativeOptions {
  /// Largest Residuals::fixed_point of impulses that count as a solution; > 0. Derivatives have
  /// about this relative error, times the condition of the problem.
  double tolerance = 1e-5;
  /// A contact nearer to another regime than this part of the velocity that its island needs (or
  /// than ten times the error of the impulses) is at a kink; >= 0.
  double kink = 1e-6;
  /// Directions that the equations see by less than this part of the largest are undetermined;
  /// > 0. At least the error of the impulses in islands in which contacts slide; at least 3e-7 in
  /// islands of more than 400 touching contacts that lose rank.
  double rank_tolerance = 1e-9;
  /// Contacts that obey the law's replacement, as Solution::replaced.
  std::vector<int> replaced;
};

/// Whether the derivative is one of a single solution.
enum class DerivativeStatus : std::uint8_t {
  unique,       ///< of the one solution nearby
  minimum_norm  ///< impulses are not unique (hyperstatic): of all changes the least is given
};

/// The enumerator as text.
const char* name(DerivativeStatus status);

/// A contact near another regime, where only one-sided derivatives exist.
struct Kink {
  int contact = 0;                     ///< or cone
  Regime branch = Regime::separating;  ///< whose derivative is given
  Regime other = Regime::separating;   ///< the one that is as near
  double margin = 0;                   ///< distance to it over the velocity that the island needs
};

/// Whether the derivative exists, and of what.
struct DerivativeReport {
  DerivativeStatus status = DerivativeStatus::unique;  ///< of the impulses
  /// Every contact is strictly open, sticking or sliding: `kinks` is empty. Otherwise the solution
  /// has one-sided derivatives only, of which one branch's is given.
  bool strictly_regular() const { return kinks.empty(); }
  std::vector<Regime> regimes;  ///< the branch of each contact
  std::vector<Kink> kinks;      ///< contacts near another regime
  int unknowns = 0, rank = 0;   ///< components of touching contacts, and how many are determined
  std::vector<int> not_unique;  ///< contacts whose impulses are not determined
  /// Velocities w = A x - b are determined even where impulses are not.
  bool velocities_unique = true;
  double error = Residuals::kNone;  ///< Residuals::fixed_point of the impulses
  std::string advice;               ///< what the above means for the use of the derivative
};

/// A direction in which the data of a problem change, or the gradient of a number with respect to
/// them. Empty members of a direction: no change.
struct ProblemDirection {
  /// By row and column, with the compliance; equal places are summed. Gradient: the entries of the
  /// problem, those of the blocks that a Problem stores.
  std::vector<MatrixEntry> A;
  linalg::VectorX b;                              ///< by row
  linalg::VectorX mu, rolling, torsional, bound;  ///< by contact or cone, of those that have one
};

/// Change of a solution for a change of its problem.
struct SolutionDirection {
  linalg::VectorX impulses, velocities;  ///< dx and dw = A dx + dA x - db, by row
  /// |M y - r| / |r| of the equations solved. Not small: the direction leaves the range of a
  /// problem whose rank is deficient, and the solution jumps (one of four legs is lifted).
  double residual = 0;
};

/// J v and J' v of the solution x, w of a problem by implicit differentiation on the branch of the
/// present regimes. These are dx = 0 (open), dw = 0 (sticking), and dw_n = 0, |x_t| = mu x_n and
/// the law's direction of slip (sliding), in scaled units one sparse matrix
///
///     M y = r,   M = P + Q A     (method, eq. 31)
///
/// that is factored once, each island by itself. Up to 100 touching contacts it is a complete
/// orthogonal decomposition, beyond a sparse LU. Where that is singular the former up to 400, then
/// sparse minimum-norm factors (of M' apart, once adjoint() asks). Over cones those of the contacts
/// that stand for them, and of the free rows by theirs. Not for use by two threads at once.
class Derivative {
 public:
  /// Over cones, contacts in it are blocks of the problem (`regimes`: one for each, of free ones
  /// sticking, of bounded ones sticking or sliding). One with moments may stand in a list several
  /// times. Unknowns and rank count components of the contacts that stand for the cones.
  const DerivativeReport& report() const;
  const linalg::VectorX& impulses() const;  ///< the solution itself

  /// Change of impulses and velocities for a change of the data. Throws std::invalid_argument on
  /// sizes that do not match, entries outside of the matrix and values that are not finite.
  SolutionDirection forward(const ProblemDirection& direction) const;
  /// The gradient of impulses.x + velocities.w for given rows (empty: 0).
  ProblemDirection adjoint(const linalg::VectorView& impulses,
                           const linalg::VectorView& velocities = linalg::VectorX()) const;

 private:
  friend Derivative derivative(const Problem&, Law, const linalg::VectorView&,
                               const DerivativeOptions&);
  friend Derivative derivative(const ConeProblem&, const linalg::VectorView&,
                               const DerivativeOptions&);
  explicit Derivative(std::shared_ptr<const detail::DerivativeParts> parts)
      : parts_(std::move(parts)) {}
  std::shared_ptr<const detail::DerivativeParts> parts_;
};

/// Factors the equations at `impulses`, a solution of `problem` under `law`. Throws
/// std::invalid_argument where it is none within options.tolerance, and on values out of range.
Derivative derivative(const Problem& problem, Law law, const linalg::VectorView& impulses,
                      const DerivativeOptions& options = {});
/// The same at the impulses of a Solution, with its replaced contacts.
Derivative derivative(const Problem& problem, Law law, const Solution& solution,
                      const DerivativeOptions& options = {});
/// Over cones under Law::coulomb; options.replaced is not used.
Derivative derivative(const ConeProblem& problem, const linalg::VectorView& impulses,
                      const DerivativeOptions& options = {});

}  // namespace tether::contact
TETHER_EXPORT_END
