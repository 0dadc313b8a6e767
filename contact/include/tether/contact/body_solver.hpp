// Tether: many contacts between bodies, the Delassus matrix never formed. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <tether/contact/bodies.hpp>
#include <tether/contact/solver.hpp>
#include <tether/export.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact {

/// Contact at r1 from the centre of `first`, r2 from that of `second` (-1: the fixed world); the
/// unit normal points from `second` to `first`. One of the two bodies must be able to move.
struct PointContact {
  /// The identity of a contact that has none.
  static constexpr std::uint64_t kNoId = ~std::uint64_t{0};

  int first = 0, second = -1;  ///< indices of bodies; second may be -1
  /// Arms from the centres of mass to the point, world axes, m.
  Eigen::Vector3d r1 = Eigen::Vector3d::Zero(), r2 = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< unit, world axes
  /// Coefficient of friction. 0: solved as one equation, the tangents cost nothing.
  double mu = 0;
  /// Added to the normal velocity, w_n = n . (J v) + bias >= 0, m/s; a time stepper gives gap /
  /// time_step.
  double bias = 0;
  /// Identity from one solve to the next (with `first` and `second` in the same order), unique
  /// within a solve; kNoId: never warm-started.
  std::uint64_t id = kNoId;
  /// Added to the relative velocity, in the surface, world axes, m/s: of a belt.
  Eigen::Vector3d slip = Eigen::Vector3d::Zero();
};

class SolverTeam;

namespace detail {
class ConeIslands;
}  // namespace detail

/// Settings of BodySolver; illegal values throw where it is made.
struct BodyOptions {
  Law law = Law::maximum_dissipation;  ///< of every contact
  /// Wanted Residuals::fixed_point of each contact: the error of its velocity over the largest
  /// velocity that a contact of its island needs.
  double tolerance = 1e-6;
  /// Sweeps over one island, at most; more only where they are forecast to cost less than the
  /// assembled problem. They end before where `max_work` is spent and progress has ended. An
  /// island that needs more and is not assembled ends with the best iterate found.
  int max_sweeps = 200000;
  /// Sweeps before an island of more than 64 contacts may be called solved. The tolerance is
  /// relative to the whole island, so a single contact of many may be off by far more than its
  /// share. Such local errors fade within a few sweeps. Errors common to many contacts do not and
  /// are seen by the tolerance.
  int min_sweeps = 0;
  int threads = 1;         ///< results have the same bits for every number of threads
  bool warm_start = true;  ///< contacts with an id start from their impulse of the previous solve
  /// Largest number of contacts of an island that may be assembled and given to Solver, whose
  /// stages also solve stacks, large mass ratios and high friction. That happens where the work
  /// predicted from the contact graph is less than that of the remaining sweeps, or sweeps have
  /// ended, and max_work allows it. Sweeps go on where an attempt fails, and the next one has more
  /// work. Bounds the memory: 1.3 kB a contact in a packing, 20 to 30 kB with a
  /// factorisation. 0: never.
  int max_assembled = 100000;
  bool strict = false;    ///< as Options::strict, for assembled islands
  double max_work = 3e9;  ///< as Options::max_work, for each assembled island; and see max_sweeps
  double enough = 0;      ///< as Options::enough, for each assembled island
  /// Processes that share the work of each solve, all with the same bodies, contacts and options;
  /// null: none. Outlives the solver. See RankTeam.
  SolverTeam* team = nullptr;
};

/// Start of the next solve: the impulses of the last one and the ids of their contacts, in the
/// order of that solve.
struct WarmStart {
  std::vector<std::uint64_t> ids;         ///< PointContact::id
  std::vector<Eigen::Vector3d> impulses;  ///< world axes, on `first`, N s
};

/// Impulses (N s) of the contacts, velocities (m/s, rad/s) of the bodies, in the order given.
struct BodySolution {
  Status status = Status::unsolved;  ///< solved if all islands are, else that of the worst
  double error = Residuals::kNone;   ///< as in BodyOptions::tolerance, of the worst island
  /// Number of islands, of those that Solver was given, and of those that are not solved.
  int islands = 0, assembled_islands = 0, failed_islands = 0;
  int sweeps = 0, colours = 0;  ///< the most of any island; colours order its sweeps
  int warm_started = 0;         ///< contacts whose id was found
  std::vector<int> replaced;    ///< as Solution::replaced
  bool spheres = false;  ///< no contact needed the general block: all spheres or frictionless
  std::vector<Eigen::Vector3d> impulses;  ///< world axes, on `first`
  std::vector<Regime> regimes;            ///< of each contact
  /// Motion of each body after the impulses, m/s and rad/s.
  std::vector<Eigen::Vector3d> velocities, angular_velocities;
};

class RankTeam;

/// Processes that share the work of a BodySolver; RankTeam implements it on RankMessages.
class SolverTeam {
 public:
  virtual ~SolverTeam() = default;
  /// Positions of bodies, by index: near ones are swept by the same process. Optional.
  virtual void place(const std::vector<Eigen::Vector3d>& positions) = 0;
  /// As BodySolver::solve. starts: impulse to start from of each contact, null: zero; empty: none.
  /// False: not worth messages, each process solves it by itself.
  virtual bool solve(const std::vector<RigidBody>& bodies,
                     const std::vector<PointContact>& contacts,
                     const std::vector<const Eigen::Vector3d*>& starts, const BodyOptions& options,
                     BodySolution& solution) = 0;
};

/// Solves each island of bodies in contact by itself: Gauss-Seidel on the velocities of the bodies,
/// and Solver where that converges slowly. The result of an island depends neither on the other
/// islands nor on the number of threads.
///
/// Keep one for a run of time steps: it holds the workspace, the threads and the impulses by id.
/// Not for use by two threads at once.
class BodySolver {
  friend class RankTeam;
  friend class detail::ConeIslands;

 public:
  explicit BodySolver(const BodyOptions& options = {});  ///< throws std::invalid_argument
  ~BodySolver();
  BodySolver(BodySolver&&) noexcept;
  BodySolver& operator=(BodySolver&&) noexcept;

  /// Throws std::invalid_argument on values that are not finite and indices that do not exist.
  BodySolution solve(const std::vector<RigidBody>& bodies,
                     const std::vector<PointContact>& contacts);
  /// The same, into storage that is used again: allocates only while the storage grows and where an
  /// island has to be assembled.
  void solve(const std::vector<RigidBody>& bodies, const std::vector<PointContact>& contacts,
             BodySolution& solution);

  const BodyOptions& options() const;            ///< those in force
  void set_options(const BodyOptions& options);  ///< throws std::invalid_argument; keeps the memory

  /// Multiplies the impulses that the next warm start will find, as for a changed time step.
  void scale_warm_start(double factor);
  /// Undoes the effect of the last solve on the next warm start. At most once for each solve.
  void take_back();
  /// Drops all stored impulses: the next solve starts from zero.
  void forget();
  /// The complete memory from one solve to the next. Throws std::invalid_argument if the lengths
  /// of its arrays differ.
  WarmStart warm_start() const;
  void set_warm_start(const WarmStart& start);  ///< the reverse of warm_start()

 private:
  struct TETHER_HIDDEN Implementation;
  std::unique_ptr<Implementation> implementation_;
};

/// evaluate() of a Problem, without forming it. Impulses in world axes, on `first`.
Residuals evaluate(const std::vector<RigidBody>& bodies, const std::vector<PointContact>& contacts,
                   Law law, const std::vector<Eigen::Vector3d>& impulses);

/// The same contacts for delassus() and Solver.
std::vector<ContactRows> to_contacts(const std::vector<PointContact>& contacts);

}  // namespace tether::contact
TETHER_EXPORT_END
