// Tether: contacts that several processes solve together, without their messages.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <tether/contact/body_solver.hpp>
#include <tether/export.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact {

/// Properties of a body that decide the kinds of its contacts, as bits that all processes know.
/// Throws std::invalid_argument, with the number, for a body that BodySolver refuses.
std::uint8_t rank_traits(std::size_t number, const RigidBody& body);

/// A contact as all processes know it: what the order of sweeping depends on. Bodies by number.
struct RankContact {
  int first = 0, second = -1;  ///< those that move; second -1: there is one
  int fixed = -1;              ///< the one that does not move, -1: none
  std::uint8_t kind = 0;
};
/// traits: of each body. Throws std::invalid_argument as rank_traits, and where both bodies are
/// fixed.
RankContact rank_contact(std::size_t number, const PointContact& contact,
                         const std::vector<std::uint8_t>& traits, Law law);

/// How processes ("ranks", 0 .. size - 1) talk to each other; tether::contact_mpi has it on MPI.
/// All of them call the same functions in the same order.
class RankMessages {
 public:
  struct With {
    int rank;
    std::vector<double> out, in;  ///< of fixed length, which both sides know
  };
  virtual ~RankMessages() = default;
  virtual int size() const = 0;
  virtual int rank() const = 0;
  /// Sends `out` to and fills `in` from each of these; an empty one is no message.
  virtual void exchange(std::vector<With>& with) = 0;
  /// The sum over all ranks, which is exact: at most one gives anything but 0.
  virtual void sum(std::vector<double>& values) = 0;
  /// The numbers of all ranks, counts[rank] of each, one after the other, for `root`.
  virtual void gather(int root, const std::vector<double>& mine, const std::vector<int>& counts,
                      std::vector<double>& all) = 0;
  virtual void broadcast(int root, std::vector<double>& values) = 0;
  /// Ends all processes: this one cannot go on while others wait for it.
  [[noreturn]] virtual void give_up(const char* why) = 0;
};

/// Messages that this rank sends by the plan, for one sweep over all shared islands and for one
/// evaluation of their residuals; 48 bytes a velocity. Bodies go to the rank that sweeps them next,
/// after each colour.
struct RankTraffic {
  long long messages = 0, velocities = 0;
  long long look_messages = 0, look_velocities = 0;
  long long sums = 0;  ///< numbers in the sum over all ranks that ends both, 3 a chunk
};

/// Islands of a solve: of all ranks together `all` and `shared`; `assembled` and `failed` add up
/// over ranks.
struct RankIslands {
  int all = 0, shared = 0, assembled = 0, failed = 0;
};

/// Status and error of two parts of a solve together; the error is NaN where one of them is.
Status worse(Status a, Status b);
double worse(double a, double b);

/// The part of one rank of BodySolver: contacts are swept colour by colour, in its order and with
/// its bits, for any number of ranks. All ranks plan the whole graph of contacts alike, so that it
/// needs no messages; bodies and contacts themselves are where they are used.
class RankSolver {
 public:
  /// warm_start is not used: `starts` says it. Throws std::invalid_argument.
  explicit RankSolver(const BodyOptions& options);
  ~RankSolver();
  RankSolver(RankSolver&&) noexcept;
  RankSolver& operator=(RankSolver&&) noexcept;

  const BodyOptions& options() const;
  void set_options(const BodyOptions& options);  ///< throws std::invalid_argument

  /// The order of sweeping, and who sweeps what. owner: rank of each body. The contacts are the
  /// same on all ranks, in an order which the result depends on.
  void plan(const std::vector<RankContact>& contacts, const std::vector<int>& owner, int ranks,
            int rank);
  /// Numbers of the contacts that solve() takes, in its order.
  const std::vector<int>& contacts() const;
  /// Numbers of bodies, in its order.
  const std::vector<int>& bodies() const;
  /// The rank that sweeps each contact, and the one that knows the velocity of each body after a
  /// solve (its owner, where no contact moves it).
  const std::vector<int>& contact_ranks() const;
  const std::vector<int>& body_ranks() const;
  RankTraffic traffic() const;
  RankIslands islands() const;  ///< after a solve

  /// Bodies and contacts as bodies() and contacts() say, the bodies of contacts by their place in
  /// bodies() (-1: the world); starts: impulses to start from, world axes, on `first`, empty: none.
  /// Velocities in `solution` are those of all contacts for bodies with body_ranks() here only;
  /// status, error and counts are of the islands that this rank has a part of.
  void solve(const std::vector<RigidBody>& bodies, const std::vector<PointContact>& contacts,
             const std::vector<Eigen::Vector3d>& starts, RankMessages& messages,
             BodySolution& solution);

 private:
  struct TETHER_HIDDEN Implementation;
  std::unique_ptr<Implementation> implementation_;
};

/// Processes that all have the same bodies and contacts, as a team for BodyOptions::team and
/// SteppingOptions::team: each sweeps the contacts of its part of the bodies, and
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
  /// Problems that were shared, and contacts of them that this process swept.
  long problems() const;
  long swept_contacts() const;

 private:
  struct TETHER_HIDDEN Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tether::contact
TETHER_EXPORT_END
