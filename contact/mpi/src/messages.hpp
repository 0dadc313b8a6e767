// Tether: messages between ranks by MPI. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <tether/contact_mpi.hpp>
#include <vector>

namespace tether::contact_mpi::detail {

/// On a communicator of its own, so that no message of the caller's is met.
class Messages final : public contact::RankMessages {
 public:
  explicit Messages(MPI_Comm comm) {
    MPI_Comm_dup(comm, &comm_);
    MPI_Comm_size(comm_, &size_);
    MPI_Comm_rank(comm_, &rank_);
  }
  ~Messages() override {
    int over = 0;
    MPI_Finalized(&over);
    if (!over) MPI_Comm_free(&comm_);
  }
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

  /// The numbers of all ranks, one after the other.
  template <class Number>
  std::vector<Number> gather_all(const std::vector<Number>& mine, std::vector<int>* ends = nullptr);
  /// Any number of values to each rank; what each sends.
  template <class Number>
  std::vector<std::vector<Number>> to_each(const std::vector<std::vector<Number>>& out);

  Traffic traffic;  // since the caller has set it to zero

 private:
  MPI_Comm comm_ = MPI_COMM_NULL;
  int size_ = 1, rank_ = 0;
  std::vector<MPI_Request> requests_;
};

template <class Number>
std::vector<Number> Messages::gather_all(const std::vector<Number>& mine, std::vector<int>* ends) {
  const int bytes = static_cast<int>(mine.size() * sizeof(Number));
  std::vector<int> counts(static_cast<std::size_t>(size_)), starts;
  MPI_Allgather(&bytes, 1, MPI_INT, counts.data(), 1, MPI_INT, comm_);
  int sum = 0;
  if (ends) ends->clear();
  for (int count : counts) {
    starts.push_back(sum);
    sum += count;
    if (ends) ends->push_back(sum / static_cast<int>(sizeof(Number)));
  }
  std::vector<Number> all(static_cast<std::size_t>(sum) / sizeof(Number));
  MPI_Allgatherv(mine.data(), bytes, MPI_BYTE, all.data(), counts.data(), starts.data(), MPI_BYTE,
                 comm_);
  traffic.other_messages += size_ - 1;
  traffic.other_bytes += static_cast<long long>(bytes) * (size_ - 1);
  return all;
}

template <class Number>
std::vector<std::vector<Number>> Messages::to_each(const std::vector<std::vector<Number>>& out) {
  const auto ranks = static_cast<std::size_t>(size_);
  std::vector<int> counts(ranks), given(ranks), starts(ranks), places(ranks);
  std::vector<Number> sent;
  for (std::size_t r = 0; r < ranks; ++r) {
    counts[r] = static_cast<int>(out[r].size() * sizeof(Number));
    starts[r] = static_cast<int>(sent.size() * sizeof(Number));
    sent.insert(sent.end(), out[r].begin(), out[r].end());
    traffic.other_messages += counts[r] > 0 && static_cast<int>(r) != rank_;
    traffic.other_bytes += static_cast<int>(r) != rank_ ? counts[r] : 0;
  }
  MPI_Alltoall(counts.data(), 1, MPI_INT, given.data(), 1, MPI_INT, comm_);
  int sum = 0;
  for (std::size_t r = 0; r < ranks; ++r) {
    places[r] = sum;
    sum += given[r];
  }
  std::vector<Number> all(static_cast<std::size_t>(sum) / sizeof(Number));
  MPI_Alltoallv(sent.data(), counts.data(), starts.data(), MPI_BYTE, all.data(), given.data(),
                places.data(), MPI_BYTE, comm_);
  std::vector<std::vector<Number>> in(ranks);
  for (std::size_t r = 0; r < ranks; ++r) {
    const auto begin = all.begin() + places[r] / static_cast<int>(sizeof(Number));
    in[r].assign(begin, begin + given[r] / static_cast<int>(sizeof(Number)));
  }
  return in;
}

}  // namespace tether::contact_mpi::detail
