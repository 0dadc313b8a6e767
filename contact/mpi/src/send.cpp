// Tether: items to ranks. SPDX-License-Identifier: BSD-3-Clause
#include <stdexcept>
#include <string>

#include "messages.hpp"

namespace tether::contact_mpi {

std::vector<double> send(MPI_Comm comm, int size, const std::vector<double>& items,
                         const std::vector<int>& to) {
  detail::Messages messages(comm);
  const auto n = static_cast<std::size_t>(size);
  std::vector<std::vector<double>> out(static_cast<std::size_t>(messages.size()));
  std::exception_ptr failure;
  try {
    if (size < 1) throw std::invalid_argument("size = " + std::to_string(size) + ": must be >= 1");
    if (items.size() != n * to.size())
      throw std::invalid_argument("items has " + std::to_string(items.size()) +
                                  " entries: " + std::to_string(n * to.size()) + " are needed, " +
                                  std::to_string(size) + " for each rank in `to`");
    for (std::size_t k = 0; k < to.size(); ++k) {
      if (to[k] < 0 || to[k] >= messages.size())
        throw std::invalid_argument("to[" + std::to_string(k) + "] = " + std::to_string(to[k]) +
                                    ": must lie in 0 .. " + std::to_string(messages.size() - 1));
      const auto begin = items.begin() + static_cast<std::ptrdiff_t>(n * k);
      auto& list = out[static_cast<std::size_t>(to[k])];
      list.insert(list.end(), begin, begin + size);
    }
  } catch (...) {
    failure = std::current_exception();
  }
  agree(messages.comm(), failure);
  std::vector<double> all;
  for (const std::vector<double>& list : messages.to_each(out))
    all.insert(all.end(), list.begin(), list.end());
  return all;
}

}  // namespace tether::contact_mpi
