// Tether: contacts that several processes solve together, without their messages.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <tether/contact/body_solver.hpp>
#include <tether/export.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact {

/// How processes ("ranks", 0 .. size - 1) talk to each other; tether::contact_mpi has it on MPI.
/// All of them call the same functions in the same order.
class RankMessages {
 public:
  /// A partner of exchange().
  struct With {
    int rank;                     ///< of the other side
    std::vector<double> out, in;  ///< of fixed length, which both sides know
  };
  virtual ~RankMessages() = default;
  virtual int size() const = 0;  ///< number of processes
  virtual int rank() const = 0;  ///< of this process
  /// Sends `out` to and fills `in` from each of these; an empty one is no message.
  virtual void exchange(std::vector<With>& with) = 0;
  /// The sum over all ranks, which is exact: at most one gives anything but 0.
  virtual void sum(std::vector<double>& values) = 0;
  /// The numbers of all ranks, counts[rank] of each, one after the other, for `root`.
  virtual void gather(int root, const std::vector<double>& mine, const std::vector<int>& counts,
                      std::vector<double>& all) = 0;
  /// values <- those of `root`, as many on all ranks.
  virtual void broadcast(int root, std::vector<double>& values) = 0;
  /// Ends all processes: this one cannot go on while others wait for it.
  [[noreturn]] virtual void give_up(const char* why) = 0;
};

/// Processes that all have the same bodies and contacts, as a team for BodyOptions::team and
/// SteppingOptions::team. Each sweeps the contacts of its part of the bodies, colour by colour, and
/// all know the whole result then. Bits are those of one process. Every process makes the same
/// calls; what one cannot do all throw.
class RankTeam final : public SolverTeam {
 public:
  /// Fewer contacts than `smallest` are solved by each process itself. `messages` outlives this.
  explicit RankTeam(RankMessages& messages, int smallest = 200);
  ~RankTeam() override;

  void place(const std::vector<Eigen::Vector3d>& positions) override;
  bool solve(const std::vector<RigidBody>& bodies, const std::vector<PointContact>& contacts,
             const std::vector<const Eigen::Vector3d*>& starts, const BodyOptions& options,
             BodySolution& solution) override;
  long problems() const;        ///< problems that were shared
  long swept_contacts() const;  ///< contacts of them that this process swept

 private:
  struct TETHER_HIDDEN Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tether::contact
TETHER_EXPORT_END
