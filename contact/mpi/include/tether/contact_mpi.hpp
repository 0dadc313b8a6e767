// Tether: contacts that MPI ranks solve together. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <mpi.h>

#include <tether/contact/ranks.hpp>
#include <tether/export.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact_mpi {

/// Messages that one rank has sent.
struct Traffic {
  long long messages = 0, bytes = 0;              ///< velocities during sweeps
  long long reductions = 0;                       ///< sums over all ranks
  long long other_messages = 0, other_bytes = 0;  ///< results
};

/// For a contact::RankTeam. On a communicator of its own, so that no message of the caller's is
/// met; made and destroyed by all ranks of `comm` together.
class Messages final : public contact::RankMessages {
 public:
  explicit Messages(MPI_Comm comm);
  ~Messages() override;
  Messages(const Messages&) = delete;
  Messages& operator=(const Messages&) = delete;

  MPI_Comm comm() const { return comm_; }
  int size() const override { return size_; }
  int rank() const override { return rank_; }
  void exchange(std::vector<With>& with) override;
  void sum(std::vector<double>& values) override;
  void gather(int root, const std::vector<double>& mine, const std::vector<int>& counts,
              std::vector<double>& all) override;
  void broadcast(int root, std::vector<double>& values) override;
  [[noreturn]] void give_up(const char* why) override;

  Traffic traffic;  ///< since the caller has set it to zero

 private:
  MPI_Comm comm_ = MPI_COMM_NULL;
  int size_ = 1, rank_ = 0;
  std::vector<MPI_Request> requests_;
};

}  // namespace tether::contact_mpi
TETHER_EXPORT_END
