// Tether: matrices of the Siconos .dat format. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/cones.hpp>
#include <vector>

#include "io/dat_tokens.hpp"

namespace tether::contact::detail {

struct FileMatrix {
  long rows = 0, columns = 0;
  std::vector<MatrixEntry> entries;
};

/// Storage type (0 dense, 1 blocks of any sizes, 2 sparse), sizes, and what they say.
FileMatrix read_matrix(Tokens& in);

/// Storage 2 after its sizes: triplets or compressed columns as CSparse prints them.
std::vector<MatrixEntry> read_sparse(Tokens& in, long rows, long columns);

}  // namespace tether::contact::detail
