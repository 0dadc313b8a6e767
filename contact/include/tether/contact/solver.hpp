// Tether: solver of contact problems. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <tether/contact/evaluate.hpp>
#include <tether/contact/problem.hpp>
#include <tether/export.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact {

/// The number that is compared with Options::tolerance; see Residuals.
enum class Measure : std::uint8_t {
  fixed_point,  ///< independent of units
  natural_map   ///< as Siconos; depends on the units of A and b: for comparisons only
};

/// How a solve ended.
enum class Status : std::uint8_t {
  unsolved,    ///< not tried, or the impulses lie outside of the range of doubles in these units
  solved,      ///< measure <= tolerance, and round-off of A x - b does not exceed it
  stalled,     ///< the iteration no longer makes progress
  cycling,     ///< the iterates repeat without progress; often no solution of the law is near
  work_limit,  ///< max_work reached while there was progress
  round_off,   ///< the remaining error is the round-off of A x - b: a smaller tolerance cannot be
               ///< reached
  infeasible   ///< no impulses keep every w_n >= 0, see Solution::infeasible_direction
};

/// The enumerator as text.
const char* name(Measure measure);
/// The enumerator as text.
const char* name(Status status);

/// Settings of Solver and ConeSolver; illegal values throw where these are made.
struct Options {
  Law law = Law::maximum_dissipation;      ///< of every contact
  double tolerance = 1e-9;                 ///< measure <= tolerance ends the solve; > 0
  Measure measure = Measure::fixed_point;  ///< what is compared with the tolerance
  /// true: the law is never replaced. false: where maximum_dissipation does not converge, contacts
  /// with eccentricity > 0.98 get the Coulomb rule in a second attempt; Solution::replaced lists
  /// them.
  bool strict = false;
  double max_work = 1e10;  ///< estimated nanoseconds, counted from operations
  /// Once 3/4 of max_work are spent, an error of at most this ends the solve, as work_limit:
  /// a hard problem then does not use all of max_work. 0: off.
  double enough = 0;
};

/// Work of a solve.
struct Counts {
  int sweeps = 0, factorisations = 0;  ///< of all contacts; of sparse matrices
  double work = 0;                     ///< estimated nanoseconds

  /// Adds the work of another solve.
  void add(const Counts& other) {
    sweeps += other.sweeps;
    factorisations += other.factorisations;
    work += other.work;
  }
};

/// Impulses (N s), velocities (m/s) and what is known of them; entries by contact, then component.
struct Solution {
  Status status = Status::unsolved;      ///< whether the law holds to the tolerance
  linalg::VectorX impulses, velocities;  ///< x and w = A x - b
  std::vector<Regime> regimes;           ///< of each contact
  std::vector<int> replaced;  ///< contacts with the Coulomb rule instead of maximum_dissipation
  double error = Residuals::kNone;  ///< the measure that was compared with the tolerance
  /// Status::infeasible: normal impulses d >= 0 (dimension * contacts entries, the largest 1) with
  /// A d = 0 to round-off and b.d > 0, so that d.w = -b.d < 0 whatever the impulses. Else empty.
  std::vector<double> infeasible_direction;
  Counts counts;       ///< work of the solve
  std::string advice;  ///< what to try when it is not solved
};

/// Solves Problems and keeps its workspace between them. Results depend only on the problem, the
/// options and the start, never on timing. Not for use by two threads at once.
class Solver {
 public:
  explicit Solver(const Options& options = {});  ///< throws std::invalid_argument on illegal values
  ~Solver();
  Solver(Solver&&) noexcept;
  Solver& operator=(Solver&&) noexcept;

  /// A problem that cannot be solved is a status with advice, not an exception.
  Solution solve(const Problem& problem);
  /// Start from the given impulses (dimension * contacts entries).
  Solution solve(const Problem& problem, const linalg::VectorView& start);
  /// The same, into storage that is used again.
  void solve(const Problem& problem, Solution& solution);

  const Options& options() const;  ///< those given at the start

 private:
  struct TETHER_HIDDEN Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tether::contact
TETHER_EXPORT_END
