// Tether: the entries of a row that are not zero. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include <tether/export.hpp>

TETHER_EXPORT_BEGIN
namespace tether::linalg {

/// visit(j, c[j]) for the entries j of c[0 .. n-1] that are not zero, ascending: four zeros in a
/// row are passed at once.
template <class Visit>
void visit_filled(const double* c, int n, Visit visit) {
  int j = 0;
  for (; j + 4 <= n; j += 4) {
    std::uint64_t bits[4];
    std::memcpy(bits, c + j, sizeof bits);
    if (((bits[0] | bits[1] | bits[2] | bits[3]) << 1) == 0) continue;  // but for the sign
    for (int k = j; k < j + 4; ++k)
      if (c[k] != 0.0) visit(k, c[k]);
  }
  for (; j < n; ++j)
    if (c[j] != 0.0) visit(j, c[j]);
}

/// The columns of each row of an array in which anything but a zero was ever seen. Arrays that are
/// handed over whole mostly hold few entries, in the same places each time. resize() allocates,
/// nothing else does.
class FilledPlaces {
 public:
  /// No place is known.
  void resize(int rows, int columns);
  /// Takes up what is not zero in row i, c[0 .. columns - 1], outside its known places; next to
  /// nothing is done where all of that is zero.
  void note(int i, const double* c) {
    if (others(i, c)) learn(i, c);
  }
  /// The same for all rows, which follow each other from c on, at a third of the work. c is as
  /// before in the end.
  void note_all(double* c);
  /// Zeros in the known places of all rows, which follow each other from c on.
  void clear_all(double* c);
  /// Zeros in the known places of row i.
  void clear(int i, double* c) const {
    for (const int *j = begin(i), *last = end(i); j != last; ++j) c[*j] = 0.0;
  }
  /// The known places of row i, ascending.
  const int* begin(int i) const { return places_.data() + static_cast<std::ptrdiff_t>(i) * n_; }
  /// Behind the last of them.
  const int* end(int i) const { return begin(i) + counts_[static_cast<std::size_t>(i)]; }
  /// Number of all known places; it never shrinks between calls of resize().
  long known() const { return known_; }

 private:
  bool others(int i, const double* c) const;
  void learn(int i, const double* c);

  int n_ = 0;
  long known_ = 0;
  std::vector<int> places_, counts_;
  // One list of the places of all rows, while they are few.
  bool list_all();
  std::vector<std::ptrdiff_t> list_;
  long listed_ = 0;
  std::vector<double> lifted_;  // work space of note_all()
};

}  // namespace tether::linalg
TETHER_EXPORT_END
