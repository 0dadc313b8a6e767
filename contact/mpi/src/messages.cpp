// Tether: messages between ranks by MPI. SPDX-License-Identifier: BSD-3-Clause
#include <cstdio>
#include <cstdlib>
#include <tether/contact_mpi.hpp>

namespace tether::contact_mpi {

Messages::Messages(MPI_Comm comm) {
  MPI_Comm_dup(comm, &comm_);
  MPI_Comm_size(comm_, &size_);
  MPI_Comm_rank(comm_, &rank_);
}

Messages::~Messages() {
  int over = 0;
  MPI_Finalized(&over);
  if (!over) MPI_Comm_free(&comm_);
}

void Messages::exchange(std::vector<With>& with) {
  constexpr int kTag = 1;
  requests_.clear();
  const auto request = [this]() {
    requests_.emplace_back();
    return &requests_.back();
  };
  for (With& w : with) {
    if (w.in.empty()) continue;
    MPI_Irecv(w.in.data(), static_cast<int>(w.in.size()), MPI_DOUBLE, w.rank, kTag, comm_,
              request());
  }
  for (With& w : with) {
    if (w.out.empty()) continue;
    MPI_Isend(w.out.data(), static_cast<int>(w.out.size()), MPI_DOUBLE, w.rank, kTag, comm_,
              request());
    ++traffic.messages;
    traffic.bytes += static_cast<long long>(sizeof(double) * w.out.size());
  }
  MPI_Waitall(static_cast<int>(requests_.size()), requests_.data(), MPI_STATUSES_IGNORE);
}

void Messages::sum(std::vector<double>& values) {
  MPI_Allreduce(MPI_IN_PLACE, values.data(), static_cast<int>(values.size()), MPI_DOUBLE, MPI_SUM,
                comm_);
  ++traffic.reductions;
}

void Messages::gather(int root, const std::vector<double>& mine, const std::vector<int>& counts,
                      std::vector<double>& all) {
  std::vector<int> starts;
  int sum = 0;
  for (int count : counts) {
    starts.push_back(sum);
    sum += count;
  }
  if (rank_ == root) all.resize(static_cast<std::size_t>(sum));
  MPI_Gatherv(mine.data(), static_cast<int>(mine.size()), MPI_DOUBLE, all.data(), counts.data(),
              starts.data(), MPI_DOUBLE, root, comm_);
  traffic.other_messages += rank_ != root;
  traffic.other_bytes += rank_ != root ? static_cast<long long>(8 * mine.size()) : 0;
}

void Messages::broadcast(int root, std::vector<double>& values) {
  MPI_Bcast(values.data(), static_cast<int>(values.size()), MPI_DOUBLE, root, comm_);
}

void Messages::give_up(const char* why) {
  std::fprintf(stderr, "tether: rank %d cannot go on while others wait for it: %s\n", rank_, why);
  MPI_Abort(comm_, 1);
  std::abort();
}

}  // namespace tether::contact_mpi
