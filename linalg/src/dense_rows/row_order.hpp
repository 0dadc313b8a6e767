// Tether: an order of rows in which A A^T has a small envelope. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <tether/linalg/filled.hpp>
#include <vector>

namespace tether::linalg {

/// The reverse Cuthill-McKee order (George and Liu, Computer Solution of Large Sparse Positive
/// Definite Systems, section 4.3) of rows that are neighbours where they share a column. Rows next
/// to more than half of the others, such as an energy, would make all of them close to each other:
/// they come last, and nothing is reached through them. resize() allocates, nothing else does.
class RowOrder {
 public:
  void resize(int rows, int columns);
  /// sorted[0 .. count - 1] <- 0 .. count - 1 in that order, k standing for row rows[k].
  void run(const FilledPlaces& places, const int* rows, int count, int* sorted);

 private:
  void list_columns(const FilledPlaces& places);
  template <class Visit>
  void for_neighbours(int k, Visit visit);
  int reach(int start, int first);
  int far_from(int start, int first);

  const int* rows_ = nullptr;
  const FilledPlaces* places_ = nullptr;
  int count_ = 0;
  std::vector<int> starts_, owners_;  // of each column: which rows have it
  std::vector<int> degrees_;          // of rows: how many neighbours
  std::vector<char> reached_;
  int visit_ = 0;
  std::vector<int> visited_;  // in which call of for_neighbours()
  int* queue_ = nullptr;
};

}  // namespace tether::linalg
