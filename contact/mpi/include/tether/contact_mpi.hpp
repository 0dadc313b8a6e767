// Tether: contacts of bodies that are spread over MPI ranks. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <mpi.h>

#include <Eigen/Core>
#include <exception>
#include <memory>
#include <tether/contact/ranks.hpp>
#include <tether/export.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact_mpi {

/// threads: of each rank. The same on all ranks.
using Options = contact::BodyOptions;

/// Data that a rank gives: bodies by number, 0 .. n - 1 over all ranks, each on one of them.
/// A contact is on the rank that owns its moving body with the smaller number; PointContact::first
/// and second are numbers of bodies. Contacts are swept in an order that follows from the numbers
/// of their bodies, contacts of two bodies in the order in which they are given.
struct Share {
  std::vector<int> numbers;  ///< of the bodies, in any order
  std::vector<contact::RigidBody> bodies;
  std::vector<contact::PointContact> contacts;
};

/// Messages that one rank has sent in a solve.
struct Traffic {
  long long messages = 0, bytes = 0;              ///< velocities during sweeps
  long long reductions = 0;                       ///< sums over all ranks
  long long other_messages = 0, other_bytes = 0;  ///< bodies, contacts and results
};

/// Lists as those of the Share; the rest is about all ranks and has the same value on each.
struct Solution {
  contact::Status status = contact::Status::unsolved;
  double error = contact::Residuals::kNone;  ///< as BodySolution::error
  int islands = 0, assembled_islands = 0, failed_islands = 0;
  int shared_islands = 0;  ///< swept by several ranks
  int sweeps = 0, colours = 0;
  int warm_started = 0;                   ///< contacts whose id was found
  std::vector<Eigen::Vector3d> impulses;  ///< world axes, on `first`
  std::vector<contact::Regime> regimes;
  std::vector<Eigen::Vector3d> velocities, angular_velocities;
  std::vector<int> replaced;  ///< contacts of this rank, as BodySolution::replaced
  Traffic traffic;            ///< of this rank, counted
  int swept_contacts = 0;     ///< by this rank
};

/// contact::BodySolver over ranks: with contacts in the order of (smaller number
/// of a moving body, the other number, -1 for the world), BodySolver gives the same bits.
///
/// All member functions, the constructor too, are called by all ranks of `comm` together. What one
/// rank refuses is thrown by all, with the number of that rank.
class Solver {
 public:
  explicit Solver(MPI_Comm comm, const Options& options = {});
  ~Solver();
  Solver(Solver&&) noexcept;
  Solver& operator=(Solver&&) noexcept;

  /// Throws std::invalid_argument.
  Solution solve(const Share& share);
  void solve(const Share& share, Solution& solution);

  /// Impulses of the last solve by id of the contact, wherever its bodies have gone since.
  void scale_warm_start(double factor);
  void forget();

 private:
  struct TETHER_HIDDEN Implementation;
  std::unique_ptr<Implementation> implementation_;
};

/// The rank for each of this rank's bodies, such that weights are spread evenly: contact::bisect of
/// all centres. weights >= 0, such as 1 + contacts of the body.
std::vector<int> partition(MPI_Comm comm, const std::vector<int>& numbers,
                           const std::vector<Eigen::Vector3d>& centres,
                           const std::vector<double>& weights);

/// Items of `size` numbers each, one after the other in `items`, to ranks: item k to to[k]. Returns
/// those that have come, from the lowest rank on, each in its order. For bodies that change their
/// rank, and for copies of those near others. Called by all ranks; throws std::invalid_argument.
std::vector<double> send(MPI_Comm comm, int size, const std::vector<double>& items,
                         const std::vector<int>& to);

/// All ranks throw where one has a failure: that of the first such rank, std::invalid_argument if
/// it is one, else std::runtime_error. Called by all ranks.
void agree(MPI_Comm comm, const std::exception_ptr& failure);

}  // namespace tether::contact_mpi
TETHER_EXPORT_END
