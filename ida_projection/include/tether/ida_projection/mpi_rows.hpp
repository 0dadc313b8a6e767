// Tether: DistributedRows over the ranks of MPI. SPDX-License-Identifier: BSD-3-Clause
//
// A header of its own: the library does not need MPI, the program that includes this links it.
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <mpi.h>
#include <numeric>
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
      : comm_(comm), ids_(std::move(ids)), places_(ids_.size()), held_(ids_.size()) {
    int ranks = 1, rank = 0;
    MPI_Comm_size(comm_, &ranks);
    MPI_Comm_rank(comm_, &rank);
    std::vector<long long> first(static_cast<std::size_t>(ranks) + 1, 0);
    const long long own = unknowns;
    MPI_Allgather(&own, 1, MPI_LONG_LONG, first.data() + 1, 1, MPI_LONG_LONG, comm_);
    std::partial_sum(first.begin(), first.end(), first.begin());
    first_ = first[static_cast<std::size_t>(rank)];
    refuse_wrong(unknowns, first.back());

    // Ghosts by their owners, who are told which unknowns are copied.
    std::iota(places_.begin(), places_.end(), std::size_t{0});
    std::stable_sort(places_.begin(), places_.end(),
                     [this](std::size_t a, std::size_t b) { return ids_[a] < ids_[b]; });
    std::vector<long long> wanted;
    for (const std::size_t k : places_) wanted.push_back(ids_[k]);
    for (std::size_t r = 0; r + 1 < first.size(); ++r) {
      const auto begin = std::lower_bound(wanted.begin(), wanted.end(), first[r]);
      ghosts_.starts.push_back(static_cast<int>(begin - wanted.begin()));
      ghosts_.counts.push_back(
          static_cast<int>(std::lower_bound(begin, wanted.end(), first[r + 1]) - begin));
    }
    owned_ = ghosts_;
    MPI_Alltoall(ghosts_.counts.data(), 1, MPI_INT, owned_.counts.data(), 1, MPI_INT, comm_);
    for (std::size_t r = 1; r < owned_.starts.size(); ++r)
      owned_.starts[r] = owned_.starts[r - 1] + owned_.counts[r - 1];
    std::vector<long long> asked(
        static_cast<std::size_t>(owned_.starts.back() + owned_.counts.back()));
    exchange(wanted, ghosts_, asked, owned_, MPI_LONG_LONG);
    for (const long long id : asked) copied_.push_back(id - first_);
    sent_.resize(copied_.size());
  }

  /// Global numbers of the unknowns that its ghosts copy, in the order of the ghosts.
  const std::vector<long long>& ids() const { return ids_; }

  /// ghosts <- the unknowns that they copy.
  void update(const double* own, double* ghosts) {
    for (std::size_t i = 0; i < copied_.size(); ++i) sent_[i] = own[copied_[i]];
    exchange(sent_, owned_, held_, ghosts_, MPI_DOUBLE);
    for (std::size_t i = 0; i < places_.size(); ++i) ghosts[places_[i]] = held_[i];
  }
  /// own <- own + what the ghosts of it hold, in the order of the ranks.
  void add(const double* ghosts, double* own) {
    for (std::size_t i = 0; i < places_.size(); ++i) held_[i] = ghosts[places_[i]];
    exchange(held_, ghosts_, sent_, owned_, MPI_DOUBLE);
    for (std::size_t i = 0; i < copied_.size(); ++i) own[copied_[i]] += sent_[i];
  }

 private:
  struct Parts {  // of an array, one for each rank
    std::vector<int> counts, starts;
  };

  template <class Number>
  void exchange(const std::vector<Number>& out, const Parts& to, std::vector<Number>& in,
                const Parts& from, MPI_Datatype type) {
    MPI_Alltoallv(out.data(), to.counts.data(), to.starts.data(), type, in.data(),
                  from.counts.data(), from.starts.data(), type, comm_);
  }
  void refuse_wrong(int unknowns, long long all) const {
    const auto bad = std::find_if(ids_.begin(), ids_.end(), [&](long long id) {
      return id < 0 || id >= all || (id >= first_ && id < first_ + unknowns);
    });
    int failed = bad != ids_.end() ? 1 : 0;
    MPI_Allreduce(MPI_IN_PLACE, &failed, 1, MPI_INT, MPI_MAX, comm_);
    if (failed == 0) return;
    throw std::invalid_argument(
        bad == ids_.end() ? std::string("GhostExchange: another rank has a wrong number of a ghost")
                          : "GhostExchange: ghost " + std::to_string(bad - ids_.begin()) +
                                " copies unknown " + std::to_string(*bad) + "; it must be 0 .. " +
                                std::to_string(all - 1) + " and not this rank's own");
  }

  MPI_Comm comm_;
  std::vector<long long> ids_;
  long long first_ = 0;
  Parts ghosts_, owned_;             // ghosts here, and copies elsewhere of unknowns here
  std::vector<std::size_t> places_;  // of each ghost, in the order of owners
  std::vector<long long> copied_;    // the unknown of each copy
  std::vector<double> held_, sent_;  // their values, in the same orders
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
