// Tether: the factors of a Delassus matrix that bodies have given. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <map>
#include <memory>
#include <tether/linalg/block3.hpp>
#include <tether/linalg/index.hpp>
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

/// Of some contacts, with the bodies that they have.
inline std::shared_ptr<const BodyForm> part_of(const BodyForm& whole,
                                               const std::vector<int>& contacts) {
  auto out = std::make_shared<BodyForm>();
  std::map<int, int> number;
  for (int i : contacts) {
    out->contacts.push_back(whole.contacts[linalg::at(i)]);
    for (int& body : out->contacts.back().body)
      if (body >= 0) body = number.emplace(body, static_cast<int>(number.size())).first->second;
  }
  out->bodies = static_cast<int>(number.size());
  return out;
}

}  // namespace tether::contact::detail
