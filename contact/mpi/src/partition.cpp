// Tether: bodies over ranks by their places. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <exception>
#include <numeric>
#include <stdexcept>
#include <string>
#include <tether/contact_mpi.hpp>

#include "messages.hpp"

namespace tether::contact_mpi {

namespace {

void check(const std::vector<int>& numbers, const std::vector<Eigen::Vector3d>& centres,
           const std::vector<double>& weights) {
  if (centres.size() != numbers.size() || weights.size() != numbers.size())
    throw std::invalid_argument(std::to_string(numbers.size()) + " numbers of bodies, but " +
                                std::to_string(centres.size()) + " centres and " +
                                std::to_string(weights.size()) + " weights");
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    const std::string body = "body " + std::to_string(numbers[k]);
    if (numbers[k] < 0) throw std::invalid_argument(body + ": numbers must be >= 0");
    if (!centres[k].allFinite()) throw std::invalid_argument(body + ": centre must be finite");
    if (!(weights[k] >= 0 && weights[k] <= 1e30))
      throw std::invalid_argument(body + ": weight must lie in 0 .. 1e30");
  }
}

struct Place {
  double number, centre[3], weight;
};

}  // namespace

std::vector<int> partition(MPI_Comm comm, const std::vector<int>& numbers,
                           const std::vector<Eigen::Vector3d>& centres,
                           const std::vector<double>& weights) {
  std::exception_ptr failure;
  try {
    check(numbers, centres, weights);
  } catch (...) {
    failure = std::current_exception();
  }
  agree(comm, failure);
  detail::Messages messages(comm);
  std::vector<Place> mine;
  for (std::size_t k = 0; k < numbers.size(); ++k)
    mine.push_back({static_cast<double>(numbers[k]),
                    {centres[k][0], centres[k][1], centres[k][2]},
                    weights[k]});
  // By number: the same parts whoever owns the bodies.
  std::vector<Place> all = messages.gather_all(mine);
  std::sort(all.begin(), all.end(),
            [](const Place& a, const Place& b) { return a.number < b.number; });
  std::vector<Eigen::Vector3d> positions;
  std::vector<double> work;
  for (const Place& each : all) {
    positions.push_back(Eigen::Map<const Eigen::Vector3d>(each.centre));
    work.push_back(each.weight);
  }
  const std::vector<int> part = contact::bisect(positions, work, messages.size());
  std::vector<int> out;
  for (const Place& each : mine) {
    const auto found =
        std::lower_bound(all.begin(), all.end(), each,
                         [](const Place& a, const Place& b) { return a.number < b.number; });
    out.push_back(part[static_cast<std::size_t>(found - all.begin())]);
  }
  return out;
}

}  // namespace tether::contact_mpi
