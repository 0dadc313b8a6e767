// Tether: DistributedRows over the ranks of MPI. SPDX-License-Identifier: BSD-3-Clause
//
// A header of its own: the library does not need MPI, the program that includes this links it.
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <mpi.h>
#include <stdexcept>
#include <string>
#include <tether/ida_projection/constraints.hpp>
#include <utility>
#include <vector>

namespace tether::ida_projection {

/// Copies between the owners of unknowns, which are numbered through from rank 0 to the last as in
/// N_VectorParallel, and those ranks that have ghosts of them. All members are collective.
class GhostExchange {
 public:
  /// `ids`: the global numbers of this rank's ghosts. Throws std::invalid_argument, on every rank,
  /// where a number is none, or one of this rank's own.
  GhostExchange(MPI_Comm comm, int unknowns, std::vector<long long> ids)
      : comm_(comm), ids_(std::move(ids)) {
    int ranks = 1;
    MPI_Comm_size(comm_, &ranks);
    std::vector<long long> first(static_cast<std::size_t>(ranks) + 1, 0);
    const long long own = unknowns;
    MPI_Allgather(&own, 1, MPI_LONG_LONG, first.data() + 1, 1, MPI_LONG_LONG, comm_);
    for (std::size_t r = 1; r < first.size(); ++r) first[r] += first[r - 1];
    int rank = 0;
    MPI_Comm_rank(comm_, &rank);
    first_ = first[static_cast<std::size_t>(rank)];

    // The wishes of this rank to each, and then of each to this one.
    const auto n = static_cast<std::size_t>(ranks);
    std::vector<std::vector<long long>> wanted(n);
    std::vector<std::vector<int>> places(n);
    long long bad = -1;
    for (std::size_t k = 0; k < ids_.size(); ++k) {
      const long long id = ids_[k];
      const bool here = id >= first_ && id < first_ + unknowns;
      if (id < 0 || id >= first.back() || here) {
        bad = static_cast<long long>(k);
        break;
      }
      const auto owner = static_cast<std::size_t>(std::upper_bound(first.begin(), first.end(), id) -
                                                  first.begin() - 1);
      wanted[owner].push_back(id - first[owner]);
      places[owner].push_back(static_cast<int>(k));
    }
    int failed = bad >= 0 ? 1 : 0;
    MPI_Allreduce(MPI_IN_PLACE, &failed, 1, MPI_INT, MPI_MAX, comm_);
    if (failed != 0)
      throw std::invalid_argument(
          bad < 0 ? std::string("GhostExchange: another rank has a wrong number of a ghost")
                  : "GhostExchange: ghost " + std::to_string(bad) + " copies unknown " +
                        std::to_string(ids_[static_cast<std::size_t>(bad)]) + "; it must be 0 .. " +
                        std::to_string(first.back() - 1) + " and not this rank's own");
    std::vector<int> asked(n), asking(n);
    for (std::size_t r = 0; r < n; ++r) asked[r] = static_cast<int>(wanted[r].size());
    MPI_Alltoall(asked.data(), 1, MPI_INT, asking.data(), 1, MPI_INT, comm_);
    std::vector<MPI_Request> open;
    std::vector<std::vector<long long>> of_others(n);
    for (std::size_t r = 0; r < n; ++r) {
      of_others[r].resize(static_cast<std::size_t>(asking[r]));
      if (asking[r] > 0)
        MPI_Irecv(of_others[r].data(), asking[r], MPI_LONG_LONG, static_cast<int>(r), kTag, comm_,
                  &open.emplace_back());
      if (asked[r] > 0)
        MPI_Isend(wanted[r].data(), asked[r], MPI_LONG_LONG, static_cast<int>(r), kTag, comm_,
                  &open.emplace_back());
    }
    MPI_Waitall(static_cast<int>(open.size()), open.data(), MPI_STATUSES_IGNORE);
    for (std::size_t r = 0; r < n; ++r) {
      if (asked[r] > 0) ghosts_.push_back({static_cast<int>(r), std::move(places[r])});
      if (asking[r] > 0)
        owned_.push_back({static_cast<int>(r), {of_others[r].begin(), of_others[r].end()}});
    }
    for (const bool own_part : {false, true})
      for (const Part& part : own_part ? owned_ : ghosts_)
        (own_part ? out_ : in_).emplace_back(part.places.size());
  }

  long long first() const { return first_; }  ///< global number of this rank's first unknown
  /// Global numbers of the unknowns that its ghosts copy, in the order of the ghosts.
  const std::vector<long long>& ids() const { return ids_; }

  /// ghosts <- the unknowns that they copy.
  void update(const double* own, double* ghosts) {
    for (std::size_t k = 0; k < owned_.size(); ++k)
      for (std::size_t i = 0; i < out_[k].size(); ++i) out_[k][i] = own[owned_[k].places[i]];
    exchange(owned_, out_, ghosts_, in_);
    for (std::size_t k = 0; k < ghosts_.size(); ++k)
      for (std::size_t i = 0; i < in_[k].size(); ++i) ghosts[ghosts_[k].places[i]] = in_[k][i];
  }
  /// own <- own + what the ghosts of it hold, in the order of the ranks.
  void add(const double* ghosts, double* own) {
    for (std::size_t k = 0; k < ghosts_.size(); ++k)
      for (std::size_t i = 0; i < in_[k].size(); ++i) in_[k][i] = ghosts[ghosts_[k].places[i]];
    exchange(ghosts_, in_, owned_, out_);
    for (std::size_t k = 0; k < owned_.size(); ++k)
      for (std::size_t i = 0; i < out_[k].size(); ++i) own[owned_[k].places[i]] += out_[k][i];
  }

 private:
  struct Part {
    int rank;
    std::vector<int> places;
  };
  using Buffers = std::vector<std::vector<double>>;

  void exchange(const std::vector<Part>& to, const Buffers& sent, const std::vector<Part>& from,
                Buffers& received) {
    open_.clear();
    for (std::size_t k = 0; k < from.size(); ++k)
      MPI_Irecv(received[k].data(), static_cast<int>(received[k].size()), MPI_DOUBLE, from[k].rank,
                kTag, comm_, &open_.emplace_back());
    for (std::size_t k = 0; k < to.size(); ++k)
      MPI_Isend(sent[k].data(), static_cast<int>(sent[k].size()), MPI_DOUBLE, to[k].rank, kTag,
                comm_, &open_.emplace_back());
    MPI_Waitall(static_cast<int>(open_.size()), open_.data(), MPI_STATUSES_IGNORE);
  }

  static constexpr int kTag = 7261;
  MPI_Comm comm_;
  std::vector<long long> ids_;
  long long first_ = 0;
  std::vector<Part> ghosts_, owned_;  // by rank: ghosts here, and unknowns with ghosts there
  Buffers in_, out_;                  // of ghosts_, of owned_
  std::vector<MPI_Request> open_;
};

/// DistributedRows without `fill` for rows that this rank gives by global columns: entries
/// starts[i] .. starts[i + 1] - 1 of row i are in columns[..], each column once. Column j of the
/// result's `columns` is an unknown of this rank, or a ghost, in ascending order of the global
/// numbers. Collective over `comm`, the communicator of the N_Vector, on which `unknowns` of y are
/// this rank's. Throws std::invalid_argument, on every rank, for a column that is none.
inline DistributedRows distributed_rows(MPI_Comm comm, int unknowns, std::vector<int> starts,
                                        const std::vector<long long>& columns) {
  long long first = 0;
  const long long own = unknowns;
  MPI_Exscan(&own, &first, 1, MPI_LONG_LONG, MPI_SUM, comm);  // leaves the 0 of rank 0 alone
  std::vector<long long> ids;
  for (const long long j : columns)
    if (j < first || j >= first + own) ids.push_back(j);
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  const auto exchange = std::make_shared<GhostExchange>(comm, unknowns, std::move(ids));

  DistributedRows rows;
  rows.unknowns = unknowns;
  rows.ghosts = static_cast<int>(exchange->ids().size());
  rows.starts = std::move(starts);
  for (const long long j : columns) {
    const std::vector<long long>& ghosts = exchange->ids();
    const bool here = j >= first && j < first + own;
    rows.columns.push_back(static_cast<int>(
        here ? j - first
             : unknowns + (std::lower_bound(ghosts.begin(), ghosts.end(), j) - ghosts.begin())));
  }
  rows.update_ghosts = [exchange](ConstVector y, Vector ghosts) {
    exchange->update(y.data(), ghosts.data());
  };
  rows.add_ghosts = [exchange](ConstVector ghosts, Vector y) {
    exchange->add(ghosts.data(), y.data());
  };
  return rows;
}

}  // namespace tether::ida_projection
