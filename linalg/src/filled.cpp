// Tether: the places of an array that can be filled. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <tether/linalg/filled.hpp>
#include <tether/linalg/vector_code.hpp>

namespace tether::linalg {

namespace {

TETHER_CLONES std::int64_t filled_entries(const double* c, int n) {
  std::int64_t count = 0;
  for (int j = 0; j < n; ++j) count += c[j] != 0.0 ? 1 : 0;
  return count;
}

}  // namespace

void FilledPlaces::resize(int rows, int columns) {
  n_ = columns;
  known_ = 0;
  places_.assign(static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns), 0);
  counts_.assign(static_cast<std::size_t>(rows), 0);
}

// Counts entries, of which there are no more than in the known places if all others are zero.
bool FilledPlaces::others(int i, const double* c) const {
  if (counts_[static_cast<std::size_t>(i)] == n_) return false;
  std::int64_t known = 0;
  for (const int *j = begin(i), *last = end(i); j != last; ++j) known += c[*j] != 0.0 ? 1 : 0;
  return filled_entries(c, n_) != known;
}

void FilledPlaces::learn(int i, const double* c) {
  int* places = places_.data() + static_cast<std::ptrdiff_t>(i) * n_;
  int& count = counts_[static_cast<std::size_t>(i)];
  const int before = count;
  visit_filled(c, n_, [&](int j, double) {
    if (!std::binary_search(places, places + before, j)) places[count++] = j;
  });
  std::inplace_merge(places, places + before, places + count);
  known_ += count - before;
}

}  // namespace tether::linalg
