// Tether: evaluation of joined constraint sets on contiguous vectors.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <tether/ida_projection/constraints.hpp>
#include <tether/ida_projection/projection.hpp>
#include <tether/ida_projection/statistics.hpp>
#include <vector>

#include "host/guarded.hpp"

namespace tether::ida_projection {

/// Whether the rows on n unknowns get sparse factors: if the set contains a SparseJacobian and is
/// large. A small set gets dense factors however it is given. The same rows then give the same run
/// bit for bit, and pivots find their rank.
bool wants_sparse_factors(const Constraints& set, int n);
/// Whether there is anything to project onto. Rows of other processes count.
bool has_rows(const Constraints& set);
/// Whether g is given by Constraints::value on the whole y, and C by entries or differences.
bool has_values(const Constraints& set);

/// Why the set, or one joined to it, cannot be evaluated on so many unknowns; empty if it can.
std::string wrong_length(const Constraints& set, long unknowns);

bool all_finite(const double* a, std::size_t n);

/// Memory behind the results of a callback, which shows whether it writes too much.
class GuardedRoom {
 public:
  void reserve(std::ptrdiff_t count, std::ptrdiff_t more) {
    const auto size = static_cast<std::size_t>(count + std::max(more, kLeast));
    if (room_.size() < size) room_.resize(size);
  }
  /// Place for `count` values, as they were written last; `more`: how many too many do no harm.
  double* begin(std::ptrdiff_t count, std::ptrdiff_t more) {
    reserve(count, more);
    for (std::ptrdiff_t i = 0; i < kChecked; ++i) behind(count)[i] = kUnwritten;
    return room_.data();
  }
  /// Copies them; false: more were written.
  bool end(double* values, std::ptrdiff_t count) {
    if (room_.empty()) return true;  // there was no memory for it
    for (std::ptrdiff_t i = 0; i < count; ++i) values[i] = room_[static_cast<std::size_t>(i)];
    bool unwritten = true;
    for (std::ptrdiff_t i = 0; i < kChecked; ++i)
      unwritten = unwritten && behind(count)[i] == kUnwritten;
    return unwritten;
  }

 private:
  static constexpr double kUnwritten = 3.0517578125e-300;  // unlikely in g
  static constexpr std::ptrdiff_t kLeast = 64, kChecked = 4;
  double* behind(std::ptrdiff_t count) { return room_.data() + count; }
  std::vector<double> room_;
};

/// g and C of a set and of everything joined to it, as one system of m rows.
class Evaluator {
 public:
  explicit Evaluator(const Constraints& constraints, Statistics& statistics);

  int rows() const { return rows_; }
  /// So that value() on n unknowns never allocates.
  void reserve(int n) {
    for (Part& part : parts_) part.g_room.reserve(part.set->count, std::max(part.set->count, n));
  }
  bool uses_differences() const { return uses_differences_; }
  /// Whether some rows have a function that gives g and C together.
  bool gives_both() const { return gives_both_; }

  /// g(t, y), m entries. success, not_finite, callback_recoverable or callback_fatal.
  Status value(double t, const double* y, int n, double* g);

  /// C(t, y), m x n row-major. `scale` (n entries, > 0) are the error weights WT for the difference
  /// increments. `columns`: those that differences need to visit, all others stay zero. `value`:
  /// null, or receives g(t, y) as value() does, in one call of the rows that give both.
  Status jacobian(double t, const double* y, int n, const double* scale,
                  const std::vector<int>& columns, double* C, double* value = nullptr);
  /// The same where C is zero throughout.
  Status jacobian_into_zeros(double t, const double* y, int n, const double* scale,
                             const std::vector<int>& columns, double* C, double* value = nullptr);

  /// The same with the sparse sets' entries one after the other in `entries`, and the rows of all
  /// other sets one after the other in `full` (n entries each).
  Status entries(double t, const double* y, int n, const double* scale,
                 const std::vector<int>& columns, double* entries, double* full,
                 double* value = nullptr);

  /// A set of the union and the first of its rows.
  struct Part {
    const Constraints* set;
    int first_row;
    const DenseJacobian* dense = std::get_if<DenseJacobian>(&set->jacobian);
    const SparseJacobian* sparse = std::get_if<SparseJacobian>(&set->jacobian);
    bool gives_both = (dense != nullptr && static_cast<bool>(dense->fill_with_value)) ||
                      (sparse != nullptr && static_cast<bool>(sparse->fill_with_value));
    mutable bool C_checked = false;
    mutable GuardedRoom g_room = {};
    /// How many entries of C it has, on n unknowns.
    std::ptrdiff_t entries(int n) const {
      return sparse != nullptr ? static_cast<std::ptrdiff_t>(sparse->columns.size())
                               : static_cast<std::ptrdiff_t>(set->count) * n;
    }
  };
  const std::vector<Part>& parts() const { return parts_; }

  /// found(row, column) for the entries that g can fill as a function of y, for the sets that leave
  /// C to differences: those where g notices a large change of y_j, or cannot take it.
  void sensitive(double t, const double* y, int n, const double* scale,
                 const std::function<void(int, int)>& found);

  /// Which row the last not_finite or failing callback belongs to, or what it threw.
  const std::string& message() const { return message_; }

  /// Whether a callback has returned a negative flag or thrown. Until forget() every evaluation
  /// then fails without a call, so that no failed trial point hides it.
  bool fatal() const { return fatal_; }
  void forget() { fatal_ = false; }

 private:
  void flatten(const Constraints& set);
  Status checked(int flag, const char* what, const Part& part);
  Status finite(double t, const double* g) {
    double sum = 0.0;
    for (int i = 0; i < rows_; ++i) sum += g[i];
    return std::isfinite(sum) ? Status::success : not_finite(t, g);
  }
  Status not_finite(double t, const double* g);
  /// A callback that writes g, C (`entries` of it) or both, with room behind them for what it
  /// writes too much, which ends the run. C, whose copy would cost, is checked the first time.
  template <class Fill>
  int write(const Part& part, int n, double* g, double* C, std::ptrdiff_t entries, Fill&& fill);
  // Calls the callbacks of one set; g and C are written to the places of the set.
  int value_of(const Part& part, double t, const double* y, int n, double* g);
  int rows_of(const Part& part, double t, const double* y, int n, const double* scale,
              const std::vector<int>& columns, double* C, double* g, const char** what);
  int differences(const Part& part, double t, const double* y, int n, const double* scale,
                  const std::vector<int>& columns, double* C);
  /// The rows of all sets, the C of each at place(set).
  template <class Place>
  Status all_rows(double t, const double* y, int n, const double* scale,
                  const std::vector<int>& columns, double* g, Place place);

  const Constraints& constraints_;
  Statistics& statistics_;
  std::vector<Part> parts_;
  GuardedRoom C_room_;
  std::vector<double> y_shifted_, g_base_, g_shifted_, entries_;
  std::string message_, thrown_;
  int rows_ = 0;
  bool uses_differences_ = false, gives_both_ = false, has_sparse_ = false;
  bool fatal_ = false;
  bool overrun_ = false;
};

}  // namespace tether::ida_projection
