// Tether: joints and contacts in one solve. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <tether/contact/bodies.hpp>
#include <tether/contact/solver.hpp>
#include <tether/export.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact {

/// Bilateral constraints on velocities, whose impulse x may have either sign,
///
///     sum over bodies of G v  +  compliance x  =  rate,
///
/// G (1 x 6) the row on the velocity (linear, angular about the centre, world axes) of one body.
/// The impulse acts on that body as G' x. Keeps its storage when it is filled anew.
class JointRows {
 public:
  struct Term {
    int body;
    Vector6d G;
  };

  void clear();
  /// Starts a row of joint number `joint` (used in messages). compliance >= 0, velocity over
  /// impulse of the row; rate: velocity of a prescribed motion. Throws std::invalid_argument on
  /// values that are not finite.
  void add(int joint, double rate = 0, double compliance = 0);
  /// Adds the term G v of one more body to the row added last; body -1, the world, is ignored.
  void on(int body, const Vector6d& G);

  int count() const { return static_cast<int>(rate_.size()); }
  int joint(int row) const { return joint_[static_cast<std::size_t>(row)]; }
  double rate(int row) const { return rate_[static_cast<std::size_t>(row)]; }
  double compliance(int row) const { return compliance_[static_cast<std::size_t>(row)]; }
  const Term* begin(int row) const { return terms_.data() + start_[static_cast<std::size_t>(row)]; }
  const Term* end(int row) const {
    return terms_.data() + start_[static_cast<std::size_t>(row) + 1];
  }

 private:
  std::vector<int> start_{0}, joint_;
  std::vector<double> rate_, compliance_;
  std::vector<Term> terms_;
};

struct JointSolution {
  /// Status of the contacts; infeasible also if `blocked` or `contradicting` is not empty.
  Status status = Status::unsolved;
  double error = 0;  ///< Solution::error of the contacts, of the worst island
  /// Largest |G v + compliance x - rate| of a row over the largest speed in the rows of its
  /// mechanism (sum of |G| |v|, |rate|). 0 without rows.
  double joint_error = 0;
  linalg::VectorX impulses;  ///< of the contacts: 3 each (normal, tangent, tangent), N s
  /// Impulses of the rows, N s or N m s. Dependent rows get those of least norm, each row measured
  /// by |G C| with C C' the inverse mass: equal rows get equal shares.
  linalg::VectorX joint_impulses;
  std::vector<Vector6d> velocities;  ///< of the bodies, after all impulses
  /// Contacts that approach though the joints hold their normal velocity: no impulse changes it.
  std::vector<int> blocked;
  /// Joints (numbers of JointRows::add, ascending) with rows that no velocities satisfy together;
  /// the velocities are those of the least squares of the residuals then.
  std::vector<int> contradicting;
  int islands = 0;  ///< of contacts, that joints or bodies connect
  Counts counts;
  std::string advice;
};

/// Bilateral rows and frictional contacts at one instant (README, section 16). The joints are
/// eliminated by the sparse factors of G M^-1 G' (linalg::SparseMinimumNorm): contacts see
///
///     A = J P J',   P = M^-1 - M^-1 G' (G M^-1 G' + compliance)^-1 G M^-1,
///
/// which Solver takes as it is, island by island. Rows may depend on each other, P does not change.
/// A contact whose normal velocity the joints hold (A_nn = 0) has no impulse: it is left out where
/// it does not approach, else named in `blocked`.
///
/// Meant for islands of up to some hundred contacts: A is dense over the contacts of a mechanism.
/// Keep one for a sequence of problems: it reuses the symbolic analysis while the pattern of the
/// rows stays the same.
class JointSolver {
 public:
  explicit JointSolver(const Options& options = {});  ///< throws std::invalid_argument
  ~JointSolver();
  JointSolver(JointSolver&&) noexcept;
  JointSolver& operator=(JointSolver&&) noexcept;

  /// From the velocities of the bodies before the impulses. Throws std::invalid_argument on indices
  /// that do not exist and values that are not finite.
  JointSolution solve(const std::vector<RigidBody>& bodies, const JointRows& joints,
                      const std::vector<ContactRows>& contacts);

 private:
  struct TETHER_HIDDEN Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tether::contact
TETHER_EXPORT_END
