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

typedef std::uint64_t v4_of_filled __attribute__((vector_size(32)));

// Sixteen entries at a time, or half of the work is the loop's own.
TETHER_CLONES bool any_filled(const double* c, std::size_t n) {
  constexpr std::size_t kFour = 4, kAtOnce = 4 * kFour;
  std::uint64_t bits = 0;
  v4_of_filled all = {0, 0, 0, 0};
  std::size_t e = 0;
  for (; e + kAtOnce <= n; e += kAtOnce) {
    v4_of_filled first, second, third, fourth;
    std::memcpy(&first, c + e, sizeof first);
    std::memcpy(&second, c + e + kFour, sizeof second);
    std::memcpy(&third, c + e + 2 * kFour, sizeof third);
    std::memcpy(&fourth, c + e + 3 * kFour, sizeof fourth);
    all |= (first | second) | (third | fourth);
  }
  for (std::size_t k = 0; k < kFour; ++k) bits |= all[k];
  for (; e < n; ++e) {
    std::uint64_t entry;
    std::memcpy(&entry, c + e, sizeof entry);
    bits |= entry;
  }
  return (bits << 1) != 0;  // but for the sign
}

constexpr std::size_t kFew = 4;  // entries for each place, where all places are kept in one list

}  // namespace

void FilledPlaces::resize(int rows, int columns) {
  n_ = columns;
  known_ = 0;
  places_.assign(static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns), 0);
  counts_.assign(static_cast<std::size_t>(rows), 0);
  lifted_.resize(places_.size() / kFew);
  list_.resize(places_.size() / kFew);
  listed_ = 0;
}

bool FilledPlaces::list_all() {
  if (known_ == listed_) return true;
  if (static_cast<std::size_t>(known_) > list_.size()) return false;
  std::ptrdiff_t* next = list_.data();
  for (int i = 0; i < static_cast<int>(counts_.size()); ++i)
    for (const int *j = begin(i), *last = end(i); j != last; ++j)
      *next++ = static_cast<std::ptrdiff_t>(i) * n_ + *j;
  listed_ = known_;
  return true;
}

// Known entries are zero while the others are looked at.
void FilledPlaces::note_all(double* c) {
  const auto rows = static_cast<int>(counts_.size());
  bool any = !list_all();
  if (!any) {
    const auto listed = static_cast<std::size_t>(listed_);
    for (std::size_t e = 0; e < listed; ++e) {
      double& entry = c[list_[e]];
      lifted_[e] = entry;
      entry = 0.0;
    }
    any = any_filled(c, places_.size());
    for (std::size_t e = 0; e < listed; ++e) c[list_[e]] = lifted_[e];
  }
  for (int i = 0; any && i < rows; ++i) note(i, c + static_cast<std::ptrdiff_t>(i) * n_);
}

void FilledPlaces::clear_all(double* c) {
  if (list_all())
    for (std::size_t e = 0; e < static_cast<std::size_t>(listed_); ++e) c[list_[e]] = 0.0;
  else
    std::fill_n(c, places_.size(), 0.0);
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
