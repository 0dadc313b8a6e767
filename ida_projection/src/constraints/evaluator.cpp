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
    parts_.push_back({&set, rows_});
    rows_ += set.count;
    uses_differences_ |= std::holds_alternative<FiniteDifferences>(set.jacobian);
    gives_both_ |= parts_.back().gives_both;
    has_sparse_ |= parts_.back().sparse != nullptr;
  }
  for (const Constraints& part : set.joined) flatten(part);
}

template <class Fill>
int Evaluator::write(const Part& part, int n, double* g, double* C, std::ptrdiff_t entries,
                     Fill&& fill) {
  const std::ptrdiff_t count = part.set->count;
  const bool check_jacobian_rows = C != nullptr && !part.C_checked;
  double* const to =
      g != nullptr ? part.g_room.begin(count, std::max<std::ptrdiff_t>(count, n)) : nullptr;
  double* into = C;
  if (check_jacobian_rows) {
    into = C_room_.begin(entries, entries + n);
    std::copy(C, C + entries, into);
  }
  const int flag = fill(to, into);
  const bool within = (g == nullptr || part.g_room.end(g, count)) &
                      (!check_jacobian_rows || C_room_.end(C, entries));
  part.C_checked |= check_jacobian_rows;
  return within ? flag : kOverran;
}

Status Evaluator::checked(int flag, const char* what, const Part& part) {
  if (flag == 0) return Status::success;
  const std::string function = std::string(what) + " of " + constraints_.name(part.first_row);
  const Status status = report.failed(flag, function, thrown_, part.set->count);
  thrown_.clear();
  return status;
}

int Evaluator::value_of(const Part& part, double t, const double* y, int n, double* g) {
  return write(part, n, g, nullptr, 0, [&](double* to, double*) {
    return part.set->value(t, ConstVector(y, n), Vector(to, part.set->count));
  });
}

Status Evaluator::value(double t, const double* y, int n, double* g) {
  if (report.fatal) return Status::callback_fatal;
  ++statistics_.value_evaluations;
  const Part* at = nullptr;
  const int flag = guarded(
      [&] {
        for (const Part& part : parts_) {
          at = &part;
          const int failed = value_of(part, t, y, n, g + part.first_row);
          if (failed != 0) return failed;
        }
        return 0;
      },
      thrown_);
  return flag == 0 ? finite(t, g) : checked(flag, "value", *at);
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
int Evaluator::rows_of(const Part& part, double t, const double* y, int n, const double* scale,
                       const std::vector<int>& columns, double* C, double* g, const char** what) {
  const int count = part.set->count;
  const bool both = g != nullptr && part.gives_both;
  if (g != nullptr && !both) {
    *what = "value";
    const int flag = value_of(part, t, y, n, g);
    if (flag != 0) return flag;
  }
  if (part.dense == nullptr && part.sparse == nullptr) {
    *what = "value (differences)";
    return differences(part, t, y, n, scale, columns, C);
  }
  *what = both ? "value with jacobian" : "jacobian";
  const std::ptrdiff_t size = part.entries(n);
  const ConstVector point(y, n);
  return write(part, n, both ? g : nullptr, C, size, [&](double* to, double* entries) {
    if (part.sparse != nullptr) {
      const Vector into(entries, size);
      return both ? part.sparse->fill_with_value(t, point, Vector(to, count), into)
                  : part.sparse->fill(t, point, into);
    }
    const Matrix into(entries, count, n);
    return both ? part.dense->fill_with_value(t, point, Vector(to, count), into)
                : part.dense->fill(t, point, into);
  });
}

template <class Place>
Status Evaluator::all_rows(double t, const double* y, int n, const double* scale,
                           const std::vector<int>& columns, double* g, Place place) {
  if (report.fatal) return Status::callback_fatal;
  ++statistics_.jacobian_evaluations;
  if (g != nullptr) ++statistics_.value_evaluations;
  if (g != nullptr && gives_both_) ++statistics_.joint_evaluations;
  const Part* at = nullptr;
  const char* what = "";
  const int flag = guarded(
      [&] {
        for (const Part& part : parts_) {
          at = &part;
          const int failed = rows_of(part, t, y, n, scale, columns, place(part),
                                     g != nullptr ? g + part.first_row : nullptr, &what);
          if (failed != 0) return failed;
        }
        return 0;
      },
      thrown_);
  if (flag != 0) return checked(flag, what, *at);
  return g == nullptr ? Status::success : finite(t, g);
}

// Sparse rows are spread where all have been evaluated.
Status Evaluator::jacobian(double t, const double* y, int n, const double* scale,
                           const std::vector<int>& columns, double* C, double* value) {
  std::fill(C, C + static_cast<std::ptrdiff_t>(rows_) * n, 0.0);
  if (!has_sparse_)
    return all_rows(t, y, n, scale, columns, value, [&](const Part& part) {
      return C + static_cast<std::ptrdiff_t>(part.first_row) * n;
    });
  std::ptrdiff_t sparse = 0;
  for (const Part& part : parts_) sparse += part.sparse != nullptr ? part.entries(n) : 0;
  entries_.assign(static_cast<std::size_t>(sparse), 0.0);
  double* entry = entries_.data();
  const Status status =
      all_rows(t, y, n, scale, columns, value, [&, next = entry](const Part& part) mutable {
        if (part.sparse == nullptr) return C + static_cast<std::ptrdiff_t>(part.first_row) * n;
        double* const place = next;
        next += part.entries(n);
        return place;
      });
  for (const Part& part : parts_) {
    if (part.sparse == nullptr) continue;
    for (int i = 0; i < part.set->count; ++i) {
      double* const row = C + static_cast<std::ptrdiff_t>(part.first_row + i) * n;
      for (int e = part.sparse->starts[static_cast<std::size_t>(i)];
           e < part.sparse->starts[static_cast<std::size_t>(i) + 1]; ++e)
        row[part.sparse->columns[static_cast<std::size_t>(e)]] = *entry++;
    }
  }
  return status;
}

Status Evaluator::entries(double t, const double* y, int n, const double* scale,
                          const std::vector<int>& columns, double* entries, double* full,
                          double* value) {
  return all_rows(t, y, n, scale, columns, value, [&](const Part& part) {
    double*& next = part.sparse != nullptr ? entries : full;
    double* const place = next;
    next += part.entries(n);
    std::fill(place, next, 0.0);
    return place;
  });
}

int Evaluator::differences(const Part& part, double t, const double* y, int n, const double* scale,
                           const std::vector<int>& columns, double* C) {
  const int m = part.set->count;
  const auto evaluate = [&](const double* at, double* g) {
    ++statistics_.value_evaluations;
    return value_of(part, t, at, n, g);
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
