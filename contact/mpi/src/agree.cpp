// Tether: what one rank refuses is thrown by all. SPDX-License-Identifier: BSD-3-Clause
#include <stdexcept>
#include <string>
#include <tether/contact_mpi.hpp>

namespace tether::contact_mpi {

void agree(MPI_Comm comm, const std::exception_ptr& failure) {
  int size = 0, rank = 0;
  MPI_Comm_size(comm, &size);
  MPI_Comm_rank(comm, &rank);
  int first = failure ? rank : size;
  MPI_Allreduce(MPI_IN_PLACE, &first, 1, MPI_INT, MPI_MIN, comm);
  if (first == size) return;
  std::string text;
  int said[2] = {0, 0};  // length, whether std::invalid_argument
  if (first == rank) {
    try {
      std::rethrow_exception(failure);
    } catch (const std::invalid_argument& e) {
      text = e.what();
      said[1] = 1;
    } catch (const std::exception& e) {
      text = e.what();
    } catch (...) {
      text = "an exception that is no std::exception";
    }
    said[0] = static_cast<int>(text.size());
  }
  MPI_Bcast(said, 2, MPI_INT, first, comm);
  text.resize(static_cast<std::size_t>(said[0]));
  MPI_Bcast(text.data(), said[0], MPI_CHAR, first, comm);
  text = "rank " + std::to_string(first) + ": " + text;
  if (said[1]) throw std::invalid_argument(text);
  throw std::runtime_error(text);
}

}  // namespace tether::contact_mpi
