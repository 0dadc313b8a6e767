// Tether: the factors of a Delassus matrix that bodies have given. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <tether/linalg/block3.hpp>
#include <vector>

namespace tether::contact::detail {

/// A = H H' with H = J C, C C' the inverse mass of each body. Of each body a contact has two
/// blocks, of its linear and its angular velocity: nodes 2 k and 2 k + 1 of body k.
struct BodyForm {
  struct Contact {
    int body[2];                       // -1: none, or one that is fixed
    linalg::PackedBlock H[2][2];       // of each body: linear, angular; contact rows
    linalg::PackedBlock turned[2][2];  // the same, transposed
  };
  int bodies = 0;
  std::vector<Contact> contacts;
};

}  // namespace tether::contact::detail
