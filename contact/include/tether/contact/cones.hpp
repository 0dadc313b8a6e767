// Tether: contact problems over products of cones. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <tether/contact/evaluate.hpp>
#include <tether/contact/solver.hpp>
#include <tether/export.hpp>
#include <tether/linalg/eigen.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact {

/// One factor of the cone K of a ConeProblem: what its rows of the impulse x may be, and what that
/// asks of their velocities w (method, section 8).
struct Cone {
  /// Which x and w a cone allows.
  enum class Kind : std::uint8_t {
    free,         ///< any number of rows, of any sign: w = 0 (joints)
    nonnegative,  ///< 1 row: x >= 0 complementary to w >= 0 (limits, contacts without friction)
    bounded,      ///< 1 row: |x| <= bound; -w in the normal cone there (motors, dry joints)
    planar,       ///< 2 rows: normal, tangent
    friction,     ///< 3: normal, tangent, tangent; |x_t| <= mu x_n
    torsional,    ///< 4: and the moment about the normal, at most `torsional` x_n
    rolling,      ///< 5: the first three and two moments across it, |y_t| <= rolling x_n
    rolling_torsional  ///< 6: normal, tangents, moment about the normal, two across it
  };

  Kind kind = Kind::free;  ///< decides which of the numbers below count
  int rows = 1;            ///< of x, w and b
  /// Coefficient of friction; lengths of rolling and torsional friction, m; largest impulse.
  double mu = 0, rolling = 0, torsional = 0, bound = 0;

  // One of each kind; see Kind for rows and Cone::mu for units.

  /// A cone of Kind::free.
  static Cone free(int rows = 1) { return {Kind::free, rows}; }
  /// A cone of Kind::nonnegative.
  static Cone nonnegative() { return {Kind::nonnegative, 1}; }
  /// A cone of Kind::bounded.
  static Cone bounded(double bound) { return {Kind::bounded, 1, 0, 0, 0, bound}; }
  /// A cone of Kind::planar.
  static Cone planar(double mu) { return {Kind::planar, 2, mu}; }
  /// A cone of Kind::friction.
  static Cone friction(double mu) { return {Kind::friction, 3, mu}; }
  /// A cone of Kind::torsional.
  static Cone with_torsional(double mu, double torsional) {
    return {Kind::torsional, 4, mu, 0, torsional};
  }
  /// A cone of Kind::rolling.
  static Cone with_rolling(double mu, double rolling) { return {Kind::rolling, 5, mu, rolling}; }
  /// A cone of Kind::rolling_torsional.
  static Cone with_rolling(double mu, double rolling, double torsional) {
    return {Kind::rolling_torsional, 6, mu, rolling, torsional};
  }
};

/// The enumerator as text.
const char* name(Cone::Kind kind);

/// Entry of a sparse matrix, counted from 0.
struct MatrixEntry {
  int row = 0, column = 0;  ///< place
  double value = 0;         ///< entry
};

/// w = A x - b for rows in blocks, each with its cone, in any order and of any units. A may be
/// singular (redundant joints, many contacts). A value; fixed once made.
class ConeProblem {
 public:
  ConeProblem() = default;
  /// compliance: velocity over impulse of each row, >= 0, added to the diagonal of A; empty: none.
  /// Throws std::invalid_argument (here and below) on sizes that do not match, values that are not
  /// finite or out of range, contacts whose normal nothing moves and indefinite diagonal blocks.
  static ConeProblem dense(const linalg::MatrixView& A, const linalg::VectorView& b,
                           std::vector<Cone> cones,
                           const linalg::VectorView& compliance = linalg::VectorX());
  /// Entries in any order; equal positions are summed.
  static ConeProblem sparse(const std::vector<MatrixEntry>& A, const linalg::VectorView& b,
                            std::vector<Cone> cones,
                            const linalg::VectorView& compliance = linalg::VectorX());
  /// M v = J'x + f, w = J v + bias: A = J M^-1 J' and b = -(J M^-1 f + bias). M, positive
  /// definite, has f.size() rows; of its two halves one is given, or both: their mean counts. Parts
  /// of M that are connected are factored by themselves (Cholesky); A is dense over the rows of
  /// each.
  static ConeProblem saddle(const std::vector<MatrixEntry>& M, const std::vector<MatrixEntry>& J,
                            const linalg::VectorView& f, const linalg::VectorView& bias,
                            std::vector<Cone> cones,
                            const linalg::VectorView& compliance = linalg::VectorX());

  int rows() const { return static_cast<int>(b_.size()); }   ///< of all cones
  const std::vector<Cone>& cones() const { return cones_; }  ///< in the order of their rows
  /// The first of the rows of a cone.
  int first_row(int cone) const { return first_[static_cast<std::size_t>(cone)]; }
  const linalg::VectorX& b() const { return b_; }  ///< by row
  /// A, with the compliance. Rows ascend, columns ascend in each.
  const std::vector<MatrixEntry>& entries() const { return entries_; }
  /// Entries row_start()[i] .. row_start()[i + 1] - 1 belong to row i; rows() + 1 numbers.
  const std::vector<int>& row_start() const { return row_start_; }
  linalg::MatrixX dense_matrix() const;  ///< A, rows() x rows(), with the compliance
  /// A x - b, sums in long double.
  linalg::VectorX velocities(const linalg::VectorView& impulses) const;
  /// Factor that makes the velocity of a row comparable with others. It is 1/sqrt of the mean of
  /// the diagonal of A over the rows that belong together (normal and tangents; both rolling
  /// moments; any other row alone). 0 where that is 0.
  const std::vector<double>& row_scale() const { return scale_; }

 private:
  linalg::VectorX b_;
  std::vector<Cone> cones_;
  std::vector<int> first_, row_start_;
  std::vector<MatrixEntry> entries_;
  std::vector<double> scale_;
};

/// How far impulses are from the law, block by block, without units: the error in velocity of each
/// row times row_scale(), over the largest that a block of its island needs (method, section 3.1).
struct ConeResiduals {
  double error = Residuals::kNone;  ///< the largest
  int worst = -1;                   ///< the block that has it
  std::vector<double> blocks;       ///< at least what round-off makes of A x
};

/// Law::coulomb takes every cone, frictionless no bounds and moments, maximum_dissipation no free
/// rows either (it follows each contact's own block of A, which they change):
/// std::invalid_argument. NaN where an impulse is not finite.
ConeResiduals evaluate(const ConeProblem& problem, Law law, const linalg::VectorView& impulses);

/// Impulses and velocities by row, and what is known of them.
struct ConeSolution {
  Status status = Status::unsolved;      ///< whether the law holds to the tolerance
  linalg::VectorX impulses, velocities;  ///< x and w = A x - b, by row
  ConeResiduals residuals;               ///< of the impulses, block by block
  double error = Residuals::kNone;       ///< residuals.error: what was compared with the tolerance
  std::vector<int> replaced;             ///< blocks, as Solution::replaced: those it is not true of
  /// Free rows that nothing satisfies together (status infeasible); the impulses are those of least
  /// squares then, nearly.
  std::vector<int> contradicting;
  /// Blocks that approach though free rows hold their normal (status infeasible).
  std::vector<int> blocked;
  /// As Solution::infeasible_direction, by row; free rows have the impulses that it causes.
  std::vector<double> infeasible_direction;
  Counts counts;       ///< work of the solve
  std::string advice;  ///< what to try when it is not solved
};

/// Solves ConeProblems by a Solver: free rows are eliminated (sparse factors of their part of A,
/// proximal steps where rows depend on each other), and every other cone is made of 3-D friction
/// cones.
class ConeSolver {
 public:
  /// `measure` is not used. Throws std::invalid_argument on illegal values.
  explicit ConeSolver(const Options& options = {});
  ~ConeSolver();
  ConeSolver(ConeSolver&&) noexcept;
  ConeSolver& operator=(ConeSolver&&) noexcept;

  /// Throws std::invalid_argument on a cone that the law does not take, see evaluate().
  ConeSolution solve(const ConeProblem& problem);
  /// Start from the given impulses, by row.
  ConeSolution solve(const ConeProblem& problem, const linalg::VectorView& start);

 private:
  struct TETHER_HIDDEN Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tether::contact
TETHER_EXPORT_END
