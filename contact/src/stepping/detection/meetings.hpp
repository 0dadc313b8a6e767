// Tether: how materials meet. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/stepping.hpp>
#include <vector>

namespace tether::contact::detail {

/// Meetings by pairs of materials. Memory grows with the meetings, whatever the materials are
/// numbered.
class Meetings {
 public:
  /// If a pair is named more than once, the last one counts. Throws std::invalid_argument.
  explicit Meetings(std::vector<Meeting> meetings);

  /// Number of a material among those that meet any; -1: it meets none.
  int row(int material) const;
  /// Index of the meeting of two such numbers (or -1); -1: they pass through each other.
  int find(int row, int other) const;
  const Meeting& operator[](int index) const { return list_[static_cast<std::size_t>(index)]; }
  const std::vector<Meeting>& list() const { return list_; }
  int rows() const { return static_cast<int>(materials_.size()); }

 private:
  struct Partner {
    int other, meeting;
  };
  std::vector<Meeting> list_;
  std::vector<int> materials_;      // ascending
  std::vector<std::size_t> start_;  // of each row in partners_
  std::vector<Partner> partners_;   // of each row ascending in `other`
};

}  // namespace tether::contact::detail
