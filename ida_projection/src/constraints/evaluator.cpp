// Tether: evaluation of joined constraint sets on contiguous vectors.
// SPDX-License-Identifier: BSD-3-Clause
#include "constraints/evaluator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "host/shortest.hpp"

namespace tether::ida_projection {

namespace {

/// Index of the first entry that is not finite, or -1. The sum is finite only if all entries are
/// (or if huge entries of both signs overflow, which the search then sorts out).
long first_not_finite(const double* a, long n) {
  double sum = 0.0;
  for (long i = 0; i < n; ++i) sum += a[i];
  if (std::isfinite(sum)) return -1;
  for (long i = 0; i < n; ++i)
    if (!std::isfinite(a[i])) return i;
  return -1;
}

// With more rows C as a dense matrix, which is almost empty, costs more than its entries.
constexpr int kSmallCount = 128;
constexpr double kSmallMatrix = 65536.0;

bool has_sparse_rows(const Constraints& set) {
  return std::holds_alternative<SparseJacobian>(set.jacobian) ||
         std::any_of(set.joined.begin(), set.joined.end(), has_sparse_rows);
}

// A row without entries in its pattern can never move a variable; it differs from a row that is
// zero now.
bool has_rows_without_entries(const Constraints& set) {
  const auto* given = std::get_if<SparseJacobian>(&set.jacobian);
  return (given != nullptr &&
          std::adjacent_find(given->starts.begin(), given->starts.end()) != given->starts.end()) ||
         std::any_of(set.joined.begin(), set.joined.end(), has_rows_without_entries);
}

}  // namespace

bool all_finite(const double* a, std::size_t n) {
  return first_not_finite(a, static_cast<long>(n)) < 0;
}

bool wants_sparse_factors(const Constraints& set, int n) {
  const int rows = set.total_count();
  return has_sparse_rows(set) &&
         (rows > kSmallCount || static_cast<double>(rows) * n > kSmallMatrix ||
          has_rows_without_entries(set));
}

bool has_rows(const Constraints& set) {
  return set.total_count() > 0 || std::holds_alternative<UserProjection>(set.jacobian) ||
         std::holds_alternative<DistributedRows>(set.jacobian);
}

bool has_values(const Constraints& set) {
  return !std::holds_alternative<Gradients>(set.jacobian) &&
         !std::holds_alternative<UserProjection>(set.jacobian) &&
         !std::holds_alternative<DistributedRows>(set.jacobian);
}

Evaluator::Evaluator(const Constraints& constraints, Statistics& statistics, RowsReport* where)
    : report(where != nullptr ? *where : own_), constraints_(constraints), statistics_(statistics) {
  flatten(constraints);
  g_base_.resize(static_cast<std::size_t>(rows_));
  g_shifted_.resize(static_cast<std::size_t>(rows_));
}

void Evaluator::flatten(const Constraints& set) {
  if (set.count > 0) {
    const Part& part =
        parts_.emplace_back(Part{&set, rows_, full_rows_, std::ptrdiff_t(entries_.size())});
    rows_ += set.count;
    if (part.sparse != nullptr)
      entries_.resize(entries_.size() + part.sparse->columns.size());
    else
      full_rows_ += set.count;
    uses_differences_ |= std::holds_alternative<FiniteDifferences>(set.jacobian);
    gives_both_ |= part.gives_both;
    has_sparse_ |= part.sparse != nullptr;
  }
  for (const Constraints& part : set.joined) flatten(part);
}

double* Evaluator::room_for_first_C(const Part& part, int n, const double* C) {
  const std::ptrdiff_t entries = part.entries(n);
  C_room_.reserve(entries, entries + n);
  return C_room_.open(C, entries);
}

TETHER_INLINE int Evaluator::value_of(const Part& part, double t, const double* y, int n,
                                      double* g) {
  return write_g(part, n, g, [&](double* to) {
    return part.set->value(t, ConstVector(y, n), Vector(to, part.set->count));
  });
}

Status Evaluator::checked(int flag, const char* what, const Part& part) {
  if (flag == 0) return Status::success;
  const std::string function = std::string(what) + " of " + constraints_.name(part.first_row);
  const Status status = report.failed(flag, function, thrown_, part.set->count);
  thrown_.clear();
  return status;
}

template <class Call>
TETHER_INLINE Status Evaluator::each(const char*& what, Call&& call) {
  const Part* at = nullptr;
  const int flag = guarded(
      [&]() __attribute__((always_inline)) {
        for (const Part& part : parts_) {
          at = &part;
          if (const int failed = call(part); failed != 0) return failed;
        }
        return 0;
      },
      thrown_);
  return flag == 0 ? Status::success : checked(flag, what, *at);
}

Status Evaluator::value(double t, const double* y, int n, double* g) {
  if (report.fatal) return Status::callback_fatal;
  ++statistics_.value_evaluations;
  sum_ = 0.0;
  const char* what = "value";
  const Status status =
      each(what, [&](const Part& part) { return value_of(part, t, y, n, g + part.first_row); });
  return status == Status::success ? finite(t, g) : status;
}

Status Evaluator::not_finite(double t, const double* g) {
  const long bad = first_not_finite(g, rows_);
  if (bad < 0) return Status::success;
  report.text =
      "g of " + constraints_.name(static_cast<int>(bad)) + " is not finite at t = " + brief(t);
  return Status::not_finite;
}

// `what` names the callback. Entries that are not finite are found by the factorisation, which
// reads them anyway.
TETHER_INLINE int Evaluator::rows_of(const Part& part, const At& at, double* C, double* g,
                                     const char** what) {
  const ConstVector y(at.y, at.n);
  if (g != nullptr && part.gives_both) {
    *what = "value with jacobian";
    return write_g(part, at.n, g, [&](double* to) {
      return write_C(part, at.n, C, [&](double* into) {
        const Vector value(to, part.set->count);
        return part.sparse != nullptr
                   ? part.sparse->fill_with_value(at.t, y, value, Vector(into, part.entries(at.n)))
                   : part.dense->fill_with_value(at.t, y, value,
                                                 Matrix(into, part.set->count, at.n));
      });
    });
  }
  *what = "value";
  const int flag = g != nullptr ? value_of(part, at.t, at.y, at.n, g) : 0;
  if (flag != 0) return flag;
  if (part.dense == nullptr && part.sparse == nullptr) {
    *what = "value (differences)";
    return differences(part, At(at), C);
  }
  *what = "jacobian";
  return write_C(part, at.n, C, [&](double* into) {
    return part.sparse != nullptr ? part.sparse->fill(at.t, y, Vector(into, part.entries(at.n)))
                                  : part.dense->fill(at.t, y, Matrix(into, part.set->count, at.n));
  });
}

TETHER_INLINE Status Evaluator::all_rows(const At& at, double* g, double* entries, double* full,
                                         int Part::*first) {
  if (report.fatal) return Status::callback_fatal;
  ++statistics_.jacobian_evaluations;
  if (g != nullptr) ++statistics_.value_evaluations;
  if (g != nullptr && gives_both_) ++statistics_.joint_evaluations;
  sum_ = 0.0;
  const char* what = "";
  const Status status = each(
      what, [&](const Part& part) __attribute__((always_inline)) {
        double* const C = part.sparse != nullptr
                              ? entries + part.first_entry
                              : full + static_cast<std::ptrdiff_t>(part.*first) * at.n;
        return rows_of(part, at, C, g != nullptr ? g + part.first_row : nullptr, &what);
      });
  return status != Status::success || g == nullptr ? status : finite(at.t, g);
}

Status Evaluator::jacobian(double t, const double* y, int n, const double* scale,
                           const std::vector<int>& columns, double* C, double* value) {
  std::fill(C, C + static_cast<std::ptrdiff_t>(rows_) * n, 0.0);
  std::fill(entries_.begin(), entries_.end(), 0.0);
  const Status status =
      all_rows({t, y, n, scale, columns}, value, entries_.data(), C, &Part::first_row);
  if (has_sparse_) spread_entries(C, n);
  return status;
}

void Evaluator::spread_entries(double* C, int n) const {
  const double* entry = entries_.data();
  for (const Part& part : parts_) {
    if (part.sparse == nullptr) continue;
    for (int i = 0; i < part.set->count; ++i) {
      double* const row = C + static_cast<std::ptrdiff_t>(part.first_row + i) * n;
      for (int e = part.sparse->starts[static_cast<std::size_t>(i)];
           e < part.sparse->starts[static_cast<std::size_t>(i) + 1]; ++e)
        row[part.sparse->columns[static_cast<std::size_t>(e)]] = *entry++;
    }
  }
}

Status Evaluator::entries(double t, const double* y, int n, const double* scale,
                          const std::vector<int>& columns, double* entries, double* full,
                          double* value) {
  std::fill_n(entries, entries_.size(), 0.0);
  std::fill_n(full, static_cast<std::ptrdiff_t>(full_rows_) * n, 0.0);
  return all_rows({t, y, n, scale, columns}, value, entries, full, &Part::first_full);
}

int Evaluator::differences(const Part& part, const At& at, double* C) {
  const auto [t, y, n, scale, columns] = at;
  const int m = part.set->count;
  const auto evaluate = [&](const double* point, double* g) {
    ++statistics_.value_evaluations;
    return value_of(part, at.t, point, at.n, g);
  };

  const double kRootEpsilon = std::sqrt(std::numeric_limits<double>::epsilon());
  double largest = 0.0, relative = 0.0;  // relative: 1 / rtol, where a y_j is far above its atol
  for (int j = 0; j < n; ++j) {
    largest = std::max(largest, std::abs(y[j]));
    if (scale[j] > 0.0) relative = std::max(relative, std::abs(y[j]) / scale[j]);
  }
  y_shifted_.assign(y, y + n);
  int flag = evaluate(y, g_base_.data());
  for (std::size_t k = 0; k < columns.size() && flag == 0; ++k) {
    const auto j = static_cast<std::size_t>(columns[k]);
    // About one tolerance, or sqrt(eps) atol / rtol: where y_j passes zero a smaller increment
    // would be lost in the rounding of g.
    const double least = scale[j] * std::max(1.0, kRootEpsilon * relative);
    double increment = std::max(kRootEpsilon * std::abs(y[j]), std::min(least, 1e-4 * largest));
    if (increment == 0.0) increment = kRootEpsilon;
    y_shifted_[j] = y[j] + increment;
    increment = y_shifted_[j] - y[j];  // the increment after rounding
    flag = evaluate(y_shifted_.data(), g_shifted_.data());
    y_shifted_[j] = y[j];
    for (int i = 0; i < m; ++i)
      C[static_cast<std::size_t>(i) * static_cast<std::size_t>(n) + j] =
          (g_shifted_[static_cast<std::size_t>(i)] - g_base_[static_cast<std::size_t>(i)]) /
          increment;
  }
  return flag;
}

void Evaluator::sensitive(double t, const double* y, int n, const double* scale,
                          const std::function<void(int, int)>& found) {
  double largest = 0.0;
  for (int j = 0; j < n; ++j) largest = std::max({largest, std::abs(y[j]), scale[j]});
  for (const Part& part : parts_) {
    if (!std::holds_alternative<FiniteDifferences>(part.set->jacobian)) continue;
    const int m = part.set->count;
    const auto evaluate = [&](double* g) {
      if (report.fatal) return false;
      ++statistics_.value_evaluations;
      const int flag = guarded([&] { return value_of(part, t, y_shifted_.data(), n, g); }, thrown_);
      return checked(flag, "value", part) == Status::success;
    };
    y_shifted_.assign(y, y + n);
    const bool known = evaluate(g_base_.data());
    for (std::size_t j = 0; j < y_shifted_.size(); ++j) {
      bool same = known;
      for (const double change : {1e-2, -3e-2}) {
        y_shifted_[j] = y[j] + change * (largest > 0.0 ? largest : 1.0);
        same = same && evaluate(g_shifted_.data());
        for (int i = 0; i < m; ++i) {
          const auto k = static_cast<std::size_t>(i);
          if (!same || g_shifted_[k] != g_base_[k]) found(part.first_row + i, static_cast<int>(j));
        }
      }
      y_shifted_[j] = y[j];
    }
  }
}

}  // namespace tether::ida_projection
