// Tether: impulses of the last solve, found by contact id from every rank. SPDX-License-Identifier:
// BSD-3-Clause
#include "impulse_directory.hpp"

namespace tether::contact_mpi::detail {

namespace {

using contact::PointContact;

std::size_t keeper(std::uint64_t id, int ranks) {
  id = (id ^ id >> 32) * 0x9e3779b97f4a7c15u;
  return static_cast<std::size_t>(id >> 32) % static_cast<std::size_t>(ranks);
}

struct Kept {
  std::uint64_t id;
  double p[3];
};
struct Found {
  double p[3], known;
};

}  // namespace

std::vector<Eigen::Vector3d> ImpulseDirectory::find(Messages& messages,
                                                    const std::vector<PointContact>& contacts,
                                                    int& known) {
  const int ranks = messages.size();
  std::vector<std::vector<std::uint64_t>> asked(static_cast<std::size_t>(ranks));
  for (const PointContact& c : contacts)
    if (c.id != PointContact::kNoId) asked[keeper(c.id, ranks)].push_back(c.id);
  std::vector<std::vector<Found>> answers;
  for (const std::vector<std::uint64_t>& ids : messages.to_each(asked)) {
    answers.emplace_back();
    for (std::uint64_t id : ids) {
      const auto it = kept_.find(id);
      const bool has = it != kept_.end();
      const Eigen::Vector3d p = has ? it->second : Eigen::Vector3d::Zero();
      answers.back().push_back({{p[0], p[1], p[2]}, has ? 1.0 : 0.0});
    }
  }
  const std::vector<std::vector<Found>> found = messages.to_each(answers);
  std::vector<std::size_t> next(found.size(), 0);
  std::vector<Eigen::Vector3d> out(contacts.size(), Eigen::Vector3d::Zero());
  known = 0;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (contacts[i].id == PointContact::kNoId) continue;
    const std::size_t k = keeper(contacts[i].id, ranks);
    const Found& f = found[k][next[k]++];
    out[i] = Eigen::Map<const Eigen::Vector3d>(f.p);
    known += f.known != 0;
  }
  MPI_Allreduce(MPI_IN_PLACE, &known, 1, MPI_INT, MPI_SUM, messages.comm());
  return out;
}

void ImpulseDirectory::keep(Messages& messages, const std::vector<PointContact>& contacts,
                            const std::vector<Eigen::Vector3d>& impulses) {
  const int ranks = messages.size();
  std::vector<std::vector<Kept>> given(static_cast<std::size_t>(ranks));
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (contacts[i].id == PointContact::kNoId) continue;
    const Eigen::Vector3d& p = impulses[i];
    given[keeper(contacts[i].id, ranks)].push_back({contacts[i].id, {p[0], p[1], p[2]}});
  }
  kept_.clear();
  for (const std::vector<Kept>& list : messages.to_each(given))
    for (const Kept& k : list) kept_[k.id] = Eigen::Map<const Eigen::Vector3d>(k.p);
}

}  // namespace tether::contact_mpi::detail
