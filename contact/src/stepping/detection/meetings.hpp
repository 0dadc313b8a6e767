// Tether: how materials meet. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <tether/contact/stepping.hpp>
#include <vector>

namespace tether::contact::detail {

/// Meetings by pairs of materials. Memory grows with the meetings, whatever the materials are
/// numbered.
class Meetings {
 public:
  /// If a pair is named more than once, the last one counts. Throws std::invalid_argument.
  explicit Meetings(std::vector<Meeting> meetings);

  /// Index of the meeting of two materials; -1: they pass through each other.
  int find(int first, int second) const;
  const Meeting& operator[](int index) const { return list_[static_cast<std::size_t>(index)]; }
  const std::vector<Meeting>& list() const { return list_; }

 private:
  std::vector<Meeting> list_;
  std::vector<std::array<int, 3>> pairs_;  // materials, the lower one first, and place in list_
};

}  // namespace tether::contact::detail
