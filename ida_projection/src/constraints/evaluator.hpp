// Tether: evaluation of joined constraint sets on contiguous vectors.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <string>
#include <tether/ida_projection/constraints.hpp>
#include <tether/ida_projection/projection.hpp>
#include <tether/ida_projection/statistics.hpp>
#include <tether/linalg/vector_code.hpp>
#include <utility>
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

/// Memory for the results of a callback and for what it writes too much, which marks behind them
/// show.
class GuardedRoom {
 public:
  /// For so many values; `more`: how many too many do no harm.
  void reserve(std::ptrdiff_t count, std::ptrdiff_t more) {
    const auto size = static_cast<std::size_t>(count + std::max(more, kLeast));
    if (room_.size() < size) room_.resize(size);
  }
  /// To be written: so many values, at most as many as were reserved. It has these at first, which
  /// a callback may leave alone.
  double* open(const double* values, std::ptrdiff_t count) {
    double* const room = room_.data();
    for (std::ptrdiff_t i = 0; i < count; ++i) room[i] = values[i];
    std::memcpy(room + count, kUnwritten, sizeof kUnwritten);
    return room;
  }
  /// Copies what was written and adds it to `sum`. False: there was more.
  bool close(double* values, std::ptrdiff_t count, double& sum) const {
    double added = 0.0;
    for (std::ptrdiff_t i = 0; i < count; ++i) added += values[i] = room_[i];
    sum += added;
    return std::memcmp(room_.data() + count, kUnwritten, sizeof kUnwritten) == 0;
  }
  /// call(to) writes `count` values, which are copied to `values`; `to` has these at first. Returns
  /// its flag, or that it has written more.
  template <class Call>
  int written(double* values, std::ptrdiff_t count, std::ptrdiff_t more, Call&& call);

 private:
  static constexpr std::ptrdiff_t kLeast = 64;
  static constexpr double kMark = 3.0517578125e-300;  // unlikely in g
  static constexpr double kUnwritten[] = {kMark, kMark, kMark, kMark};
  std::vector<double> room_;
};

constexpr int kOverran = std::numeric_limits<int>::min();  ///< flag of a callback that did
constexpr double kInvolved = 1e-3;  ///< of a kept row in a dropped one, to be named beside it
/// Tolerances beyond the kept rows: a dropped one that asks for more contradicts them.
constexpr double kContradicts = 0.5;

template <class Call>
int GuardedRoom::written(double* values, std::ptrdiff_t count, std::ptrdiff_t more, Call&& call) {
  reserve(count, more);
  const int flag = call(open(values, count));
  double sum = 0.0;
  return close(values, count, sum) ? flag : kOverran;
}

/// The reason why rows did not succeed.
struct RowsReport {
  std::string text;
  std::vector<int> rows;  ///< that contradict each other
  bool fatal = false;     ///< a callback has returned a negative flag or thrown

  /// A callback that did not succeed: its flag, or what it threw. `count`: of rows, for kOverran.
  Status failed(int flag, const std::string& what, const std::string& thrown, int count) {
    text = what + (flag == kOverran
                       ? " writes past its end: Constraints::count is " + std::to_string(count)
                   : thrown.empty() ? " returned " + std::to_string(flag)
                                    : " threw: " + thrown);
    fatal |= flag < 0;
    return flag > 0 ? Status::callback_recoverable : Status::callback_fatal;
  }
  void contradicting(std::vector<int> found, const Constraints& constraints) {
    rows = std::move(found);
    text = "rows contradict each other:";
    for (const int i : rows) text += " " + std::to_string(i) + " (" + constraints.name(i) + ")";
  }
};

/// slope <- d values / de at e = 0, of fourth order: at(e, values) evaluates them four times.
template <class At>
Status central_differences(double e, std::vector<double>& slope, std::vector<double>& values,
                           At at) {
  std::fill(slope.begin(), slope.end(), 0.0);
  for (const auto& [steps, weight] :
       {std::pair{1.0, 8.0}, {-1.0, -8.0}, {2.0, -1.0}, {-2.0, 1.0}}) {
    const Status status = at(steps * e, values);
    if (status != Status::success) return status;
    for (std::size_t i = 0; i < slope.size(); ++i) slope[i] += weight * values[i];
  }
  for (double& each : slope) each /= 12.0 * e;
  return Status::success;
}

/// g and C of a set and of everything joined to it, as one system of m rows.
class Evaluator {
 public:
  /// `where`: it reports there; null: in a report of its own.
  Evaluator(const Constraints& constraints, Statistics& statistics, RowsReport* where = nullptr);
  Evaluator(const Evaluator&) = delete;
  Evaluator& operator=(const Evaluator&) = delete;

  /// Which row the last not_finite or failing callback belongs to. Until `fatal` is put back every
  /// evaluation fails without a call, so that no failed trial point hides it.
  RowsReport& report;

  int rows() const { return rows_; }
  /// So that value() on n unknowns never allocates.
  void reserve(int n) {
    reserved_ = n;
    for (const Part& part : parts_) g_room_.reserve(part.set->count, std::max(part.set->count, n));
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

  /// The same with the sparse sets' entries one after the other in `entries`, and the rows of all
  /// other sets one after the other in `full` (n entries each).
  Status entries(double t, const double* y, int n, const double* scale,
                 const std::vector<int>& columns, double* entries, double* full,
                 double* value = nullptr);

  /// A set of the union and the first of its rows.
  struct Part {
    const Constraints* set;
    int first_row;
    int first_full;              // row, among those of sets that are not sparse
    std::ptrdiff_t first_entry;  // among those of sparse sets
    const DenseJacobian* dense = std::get_if<DenseJacobian>(&set->jacobian);
    const SparseJacobian* sparse = std::get_if<SparseJacobian>(&set->jacobian);
    bool gives_both = (dense != nullptr && static_cast<bool>(dense->fill_with_value)) ||
                      (sparse != nullptr && static_cast<bool>(sparse->fill_with_value));
    mutable bool C_checked = false;  // the first evaluation is
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

 private:
  // A point, and the columns of C that differences visit there.
  struct At {
    double t;
    const double* y;
    int n;
    const double* scale;
    const std::vector<int>& columns;
  };

  void flatten(const Constraints& set);
  Status checked(int flag, const char* what, const Part& part);
  Status finite(double t, const double* g) {
    return std::isfinite(sum_) ? Status::success : not_finite(t, g);
  }
  Status not_finite(double t, const double* g);
  /// A callback that writes g, or C. There is room behind g, the first time behind C, too, for what
  /// it writes too much, which ends the run.
  template <class Fill>
  TETHER_INLINE int write_g(const Part& part, int n, double* g, Fill&& fill) {
    if (n > reserved_) reserve(n);
    const int count = part.set->count;
    const int flag = fill(g_room_.open(g, count));
    return g_room_.close(g, count, sum_) ? flag : kOverran;
  }
  template <class Fill>
  TETHER_INLINE int write_C(const Part& part, int n, double* C, Fill&& fill) {
    double* const into = part.C_checked ? C : room_for_first_C(part, n, C);
    const int flag = fill(into);
    if (into != C) part.C_checked = C_room_.close(C, part.entries(n), sum_);
    return part.C_checked ? flag : kOverran;
  }
  double* room_for_first_C(const Part& part, int n, const double* C);
  /// call(part) for all sets, until one fails; `what` names the callback.
  template <class Call>
  Status each(const char*& what, Call&& call);
  // Calls the callbacks of one set; g and C are written to the places of the set.
  int value_of(const Part& part, double t, const double* y, int n, double* g);
  int rows_of(const Part& part, const At& at, double* C, double* g, const char** what);
  int differences(const Part& part, const At& at, double* C);
  void spread_entries(double* C, int n) const;
  /// The rows of all sets: sparse ones in `entries`, others from row part.*first of `full` on.
  Status all_rows(const At& at, double* g, double* entries, double* full, int Part::*first);

  RowsReport own_;
  const Constraints& constraints_;
  Statistics& statistics_;
  std::vector<Part> parts_;
  GuardedRoom g_room_, C_room_;
  std::vector<double> y_shifted_, g_base_, g_shifted_, entries_;
  std::string thrown_;
  double sum_ = 0.0;  // of what was written: finite if all of it is
  int rows_ = 0, full_rows_ = 0, reserved_ = 0;
  bool uses_differences_ = false, gives_both_ = false, has_sparse_ = false;
};

}  // namespace tether::ida_projection
