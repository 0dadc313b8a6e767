// Tether: what every rank knows of all bodies and contacts. SPDX-License-Identifier: BSD-3-Clause
#include "whole_problem.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

namespace tether::contact_mpi::detail {
namespace {

using contact::PointContact;
using contact::RankContact;

struct KnownBody {
  int number, traits;
};

std::size_t at(int i) { return static_cast<std::size_t>(i); }

template <class Work>
void by_all(Messages& messages, const Work& work) {
  std::exception_ptr failure;
  try {
    work();
  } catch (...) {
    failure = std::current_exception();
  }
  agree(messages.comm(), failure);
}

std::vector<KnownBody> known_bodies(const Share& share) {
  if (share.numbers.size() != share.bodies.size())
    throw std::invalid_argument(std::to_string(share.numbers.size()) + " numbers of bodies, but " +
                                std::to_string(share.bodies.size()) + " bodies");
  std::vector<KnownBody> out;
  for (std::size_t k = 0; k < share.bodies.size(); ++k) {
    // A number that is no index is refused below; what is said of the body names it all the same.
    const auto number = static_cast<std::size_t>(std::max(share.numbers[k], 0));
    out.push_back({share.numbers[k], contact::rank_traits(number, share.bodies[k])});
  }
  return out;
}

// The same on all ranks, and so is what it throws.
void place_bodies(const std::vector<KnownBody>& all, const std::vector<int>& ends,
                  WholeProblem& out) {
  const int n = static_cast<int>(all.size());
  out.owner.assign(at(n), -1);
  out.traits.assign(at(n), 0);
  int rank = 0;
  for (int k = 0; k < n; ++k) {
    while (k >= ends[at(rank)]) ++rank;
    const int number = all[at(k)].number;
    if (number < 0 || number >= n)
      throw std::invalid_argument(
          "rank " + std::to_string(rank) + ": number of a body = " + std::to_string(number) +
          ": the " + std::to_string(n) + " bodies of all ranks have the numbers 0 .. " +
          std::to_string(n - 1));
    int& owner = out.owner[at(number)];
    if (owner >= 0)
      throw std::invalid_argument("rank " + std::to_string(rank) + ": body " +
                                  std::to_string(number) + " is on rank " + std::to_string(owner) +
                                  ", too: each is on one rank");
    owner = rank;
    out.traits[at(number)] = static_cast<std::uint8_t>(all[at(k)].traits);
  }
}

int smaller(const RankContact& c) { return c.second >= 0 ? std::min(c.first, c.second) : c.first; }
int other(const RankContact& c) { return c.second >= 0 ? std::max(c.first, c.second) : c.fixed; }

std::vector<RankContact> own_contacts(const Share& share, const WholeProblem& whole, int rank,
                                      contact::Law law) {
  std::vector<RankContact> out;
  for (std::size_t i = 0; i < share.contacts.size(); ++i) {
    out.push_back(contact::rank_contact(i, share.contacts[i], whole.traits, law));
    const int body = smaller(out.back()), owner = whole.owner[at(body)];
    if (owner != rank)
      throw std::invalid_argument("contact " + std::to_string(i) + " belongs to rank " +
                                  std::to_string(owner) + ", which owns body " +
                                  std::to_string(body) + ", the first of its bodies that can move");
  }
  return out;
}

// Numbers contacts by their bodies. Those of two bodies are from one rank, in its order.
void number_contacts(const std::vector<RankContact>& all, const std::vector<int>& ends, int rank,
                     WholeProblem& out) {
  std::vector<int> begin(out.owner.size() + 1, 0), order(all.size()), number(all.size());
  for (const RankContact& c : all) ++begin[at(smaller(c)) + 1];
  for (std::size_t b = 1; b < begin.size(); ++b) begin[b] += begin[b - 1];
  std::vector<int> next(begin.begin(), begin.end() - 1);
  for (std::size_t i = 0; i < all.size(); ++i)
    order[at(next[at(smaller(all[i]))]++)] = static_cast<int>(i);
  for (std::size_t b = 0; b + 1 < begin.size(); ++b)
    std::stable_sort(order.begin() + begin[b], order.begin() + begin[b + 1],
                     [&](int i, int j) { return other(all[at(i)]) < other(all[at(j)]); });
  for (std::size_t k = 0; k < order.size(); ++k) {
    number[at(order[k])] = static_cast<int>(k);
    out.contacts.push_back(all[at(order[k])]);
    out.giver.push_back(
        static_cast<int>(std::upper_bound(ends.begin(), ends.end(), order[k]) - ends.begin()));
  }
  const int first = rank > 0 ? ends[at(rank - 1)] : 0;
  out.mine.assign(number.begin() + first, number.begin() + ends[at(rank)]);
}

}  // namespace

WholeProblem whole_problem(Messages& messages, const Share& share, contact::Law law) {
  WholeProblem out;
  std::vector<KnownBody> bodies;
  std::vector<RankContact> contacts;
  std::vector<int> ends;
  by_all(messages, [&] { bodies = known_bodies(share); });
  bodies = messages.gather_all(bodies, &ends);
  place_bodies(bodies, ends, out);
  by_all(messages, [&] { contacts = own_contacts(share, out, messages.rank(), law); });
  contacts = messages.gather_all(contacts, &ends);
  number_contacts(contacts, ends, messages.rank(), out);
  return out;
}

void require_same(Messages& messages, const Options& b) {
  const std::vector<std::pair<const char*, double>> options = {{"law", static_cast<double>(b.law)},
                                                               {"tolerance", b.tolerance},
                                                               {"max_sweeps", b.max_sweeps},
                                                               {"min_sweeps", b.min_sweeps},
                                                               {"warm_start", b.warm_start},
                                                               {"max_assembled", b.max_assembled},
                                                               {"strict", b.strict},
                                                               {"max_work", b.max_work},
                                                               {"enough", b.enough}};
  std::vector<double> least, most;
  for (const auto& [name, value] : options) least.push_back(value);
  most = least;
  const int n = static_cast<int>(options.size());
  MPI_Allreduce(MPI_IN_PLACE, least.data(), n, MPI_DOUBLE, MPI_MIN, messages.comm());
  MPI_Allreduce(MPI_IN_PLACE, most.data(), n, MPI_DOUBLE, MPI_MAX, messages.comm());
  for (std::size_t k = 0; k < options.size(); ++k) {
    if (least[k] == most[k]) continue;
    throw std::invalid_argument(std::string(options[k].first) + " is " + std::to_string(least[k]) +
                                " on one rank and " + std::to_string(most[k]) +
                                " on another: all ranks need the same");
  }
}

}  // namespace tether::contact_mpi::detail
