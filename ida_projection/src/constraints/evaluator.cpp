// Tether: evaluation of joined constraint sets on contiguous vectors.
// SPDX-License-Identifier: BSD-3-Clause
#include "constraints/evaluator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "attach/shortest.hpp"

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

// Beyond that C as a whole, of which next to nothing is filled, costs more than its entries.
constexpr int kSmallCount = 128;
constexpr double kSmallMatrix = 65536.0;

bool has_sparse_rows(const Constraints& set) {
  return std::holds_alternative<SparseJacobian>(set.jacobian) ||
         std::any_of(set.joined.begin(), set.joined.end(), has_sparse_rows);
}

// A row whose pattern is empty can never move anything, which a row of zeros may yet do.
bool has_rows_without_entries(const Constraints& set) {
  const auto* given = std::get_if<SparseJacobian>(&set.jacobian);
  return (given != nullptr &&
          std::adjacent_find(given->starts.begin(), given->starts.end()) != given->starts.end()) ||
         std::any_of(set.joined.begin(), set.joined.end(), has_rows_without_entries);
}

}  // namespace

double* GuardedRoom::begin(const double* values, std::ptrdiff_t count, std::ptrdiff_t more) {
  const auto size = static_cast<std::size_t>(count + std::max(more, kLeast));
  if (room_.size() < size) room_.resize(size);
  std::copy(values, values + count, room_.begin());
  std::fill_n(room_.begin() + count, kLookedAt, kUnwritten);
  return room_.data();
}

bool GuardedRoom::end(double* values, std::ptrdiff_t count) const {
  if (static_cast<std::ptrdiff_t>(room_.size()) < count + kLookedAt) return true;  // no memory
  std::copy_n(room_.begin(), count, values);
  const auto behind = room_.begin() + count;
  return std::all_of(behind, behind + kLookedAt, [](double x) { return x == kUnwritten; });
}

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

Evaluator::Evaluator(const Constraints& constraints, Statistics& statistics)
    : constraints_(constraints), statistics_(statistics) {
  flatten(constraints);
  g_base_.resize(static_cast<std::size_t>(rows_));
  g_shifted_.resize(static_cast<std::size_t>(rows_));
}

void Evaluator::flatten(const Constraints& set) {
  if (set.count > 0) {
    parts_.push_back({&set, rows_});
    rows_ += set.count;
    all_dense_ &= std::holds_alternative<DenseJacobian>(set.jacobian);
    if (std::holds_alternative<FiniteDifferences>(set.jacobian)) uses_differences_ = true;
    if (const auto* given = std::get_if<DenseJacobian>(&set.jacobian))
      gives_both_ |= static_cast<bool>(given->fill_with_value);
    if (const auto* given = std::get_if<SparseJacobian>(&set.jacobian))
      gives_both_ |= static_cast<bool>(given->fill_with_value);
  }
  for (const Constraints& part : set.joined) flatten(part);
}

template <class Fill>
int Evaluator::write(const Part& part, int n, double* g, double* C, std::ptrdiff_t entries,
                     Fill&& fill) {
  const std::ptrdiff_t count = part.set->count;
  const bool look_at_C = C != nullptr && !part.C_looked_at;
  double* to = nullptr;
  if (g != nullptr) to = g_room_.begin(g, count, std::max<std::ptrdiff_t>(count, n));
  const int flag = fill(to, look_at_C ? C_room_.begin(C, entries, entries + n) : C);
  if (g != nullptr && !g_room_.end(g, count)) overrun_ = true;
  if (look_at_C && !C_room_.end(C, entries)) overrun_ = true;
  part.C_looked_at |= look_at_C;
  return overrun_ ? -1 : flag;
}

Status Evaluator::checked(int flag, const char* what, const Part& part) {
  if (flag == 0) return Status::success;
  message_ =
      std::string(what) + " of " + constraints_.name(part.first_row) +
      (overrun_ ? " writes past its end: Constraints::count is " + std::to_string(part.set->count)
       : thrown_.empty() ? " returned " + std::to_string(flag)
                         : " threw: " + thrown_);
  thrown_.clear();
  overrun_ = false;
  if (flag < 0) fatal_ = true;
  return flag > 0 ? Status::callback_recoverable : Status::callback_fatal;
}

Status Evaluator::value(double t, const double* y, int n, double* g) {
  if (fatal_) return Status::callback_fatal;
  ++statistics_.value_evaluations;
  const Part* at = nullptr;
  const int flag = guarded(
      [&] {
        int told = 0;
        for (const Part& part : parts_) {
          at = &part;
          told = write(part, n, g + part.first_row, nullptr, 0, [&](double* to, double*) {
            return part.set->value(t, ConstVector(y, n), Vector(to, part.set->count));
          });
          if (told != 0) break;
        }
        return told;
      },
      thrown_);
  return flag == 0 ? finite(t, g) : checked(flag, "value", *at);
}

Status Evaluator::value_of(const Part& part, double t, const double* y, int n, double* g) {
  const int flag = guarded(
      [&] {
        return write(part, n, g + part.first_row, nullptr, 0, [&](double* to, double*) {
          return part.set->value(t, ConstVector(y, n), Vector(to, part.set->count));
        });
      },
      thrown_);
  return flag == 0 ? Status::success : checked(flag, "value", part);
}

void Evaluator::count(bool with_value) {
  ++statistics_.jacobian_evaluations;
  if (!with_value) return;
  ++statistics_.value_evaluations;
  if (gives_both_) ++statistics_.joint_evaluations;
}

Status Evaluator::not_finite(double t, const double* g) {
  const long bad = first_not_finite(g, rows_);
  if (bad < 0) return Status::success;
  message_ =
      "g of " + constraints_.name(static_cast<int>(bad)) + " is not finite at t = " + brief(t);
  return Status::not_finite;
}

// Entries that are not finite are found by the factors, which scan them anyway.
Status Evaluator::dense(const Part& part, double t, const double* y, int n, const double* scale,
                        const std::vector<int>& columns, double* C, double* g) {
  const DenseJacobian* given = part.dense;
  const int count = part.set->count;
  const std::ptrdiff_t size = static_cast<std::ptrdiff_t>(count) * n;
  if (g != nullptr && given != nullptr && given->fill_with_value) {
    const int flag = guarded(
        [&] {
          return write(part, n, g + part.first_row, C, size, [&](double* to, double* entries) {
            return given->fill_with_value(t, ConstVector(y, n), Vector(to, count),
                                          Matrix(entries, count, n));
          });
        },
        thrown_);
    return flag == 0 ? Status::success : checked(flag, "value with jacobian", part);
  }
  if (g != nullptr) {
    const Status status = value_of(part, t, y, n, g);
    if (status != Status::success) return status;
  }
  if (given == nullptr) return differences(part, t, y, n, scale, columns, C);
  const int flag = guarded(
      [&] {
        return write(part, n, nullptr, C, size, [&](double*, double* entries) {
          return given->fill(t, ConstVector(y, n), Matrix(entries, count, n));
        });
      },
      thrown_);
  return flag == 0 ? Status::success : checked(flag, "jacobian", part);
}

Status Evaluator::sparse(const Part& part, double t, const double* y, int n, double* entries,
                         double* g) {
  const SparseJacobian& given = *part.sparse;
  const auto count = static_cast<Eigen::Index>(given.columns.size());
  if (g != nullptr && given.fill_with_value) {
    const int flag = guarded(
        [&] {
          return write(part, n, g + part.first_row, entries, count, [&](double* to, double* C) {
            return given.fill_with_value(t, ConstVector(y, n), Vector(to, part.set->count),
                                         Vector(C, count));
          });
        },
        thrown_);
    return flag == 0 ? Status::success : checked(flag, "value with jacobian", part);
  }
  if (g != nullptr) {
    const Status status = value_of(part, t, y, n, g);
    if (status != Status::success) return status;
  }
  const int flag = guarded(
      [&] {
        return write(part, n, nullptr, entries, count, [&](double*, double* C) {
          return given.fill(t, ConstVector(y, n), Vector(C, count));
        });
      },
      thrown_);
  return flag == 0 ? Status::success : checked(flag, "jacobian", part);
}

Status Evaluator::jacobian(double t, const double* y, int n, const double* scale,
                           const std::vector<int>& columns, double* C, double* value) {
  std::fill(C, C + static_cast<std::ptrdiff_t>(rows_) * n, 0.0);
  return jacobian_into_zeros(t, y, n, scale, columns, C, value);
}

Status Evaluator::jacobian_into_zeros(double t, const double* y, int n, const double* scale,
                                      const std::vector<int>& columns, double* C, double* value) {
  if (fatal_) return Status::callback_fatal;
  count(value != nullptr);
  if (all_dense_) return dense_parts(t, y, n, C, value);
  for (const Part& part : parts_) {
    double* block = C + static_cast<std::ptrdiff_t>(part.first_row) * n;
    const Status status = part.sparse != nullptr
                              ? spread(part, t, y, n, block, value)
                              : dense(part, t, y, n, scale, columns, block, value);
    if (status != Status::success) return status;
  }
  return value == nullptr ? Status::success : finite(t, value);
}

// The parts one after the other, as dense() does each, under one guard.
Status Evaluator::dense_parts(double t, const double* y, int n, double* C, double* g) {
  const Part* at = nullptr;
  const char* what = "";
  const ConstVector point(y, n);
  const int flag = guarded(
      [&] {
        int told = 0;
        for (const Part& part : parts_) {
          at = &part;
          const int count = part.set->count;
          const std::ptrdiff_t size = static_cast<std::ptrdiff_t>(count) * n;
          double* const block = C + static_cast<std::ptrdiff_t>(part.first_row) * n;
          double* const value = g != nullptr ? g + part.first_row : nullptr;
          if (g != nullptr && part.dense->fill_with_value) {
            what = "value with jacobian";
            told = write(part, n, value, block, size, [&](double* to, double* entries) {
              return part.dense->fill_with_value(t, point, Vector(to, count),
                                                 Matrix(entries, count, n));
            });
          } else {
            if (g != nullptr) {
              what = "value";
              told = write(part, n, value, nullptr, 0, [&](double* to, double*) {
                return part.set->value(t, point, Vector(to, count));
              });
              if (told != 0) break;
            }
            what = "jacobian";
            told = write(part, n, nullptr, block, size, [&](double*, double* entries) {
              return part.dense->fill(t, point, Matrix(entries, count, n));
            });
          }
          if (told != 0) break;
        }
        return told;
      },
      thrown_);
  if (flag != 0) return checked(flag, what, *at);
  return g == nullptr ? Status::success : finite(t, g);
}

// Sparse rows as full ones.
Status Evaluator::spread(const Part& part, double t, const double* y, int n, double* block,
                         double* g) {
  const SparseJacobian& given = *part.sparse;
  entries_.assign(given.columns.size(), 0.0);
  const Status status = sparse(part, t, y, n, entries_.data(), g);
  if (status != Status::success) return status;
  for (int i = 0; i < part.set->count; ++i)
    for (int e = given.starts[static_cast<std::size_t>(i)];
         e < given.starts[static_cast<std::size_t>(i) + 1]; ++e)
      block[static_cast<std::ptrdiff_t>(i) * n + given.columns[static_cast<std::size_t>(e)]] =
          entries_[static_cast<std::size_t>(e)];
  return status;
}

Status Evaluator::entries(double t, const double* y, int n, const double* scale,
                          const std::vector<int>& columns, double* entries, double* full,
                          double* value) {
  if (fatal_) return Status::callback_fatal;
  count(value != nullptr);
  for (const Part& part : parts_) {
    const SparseJacobian* given = part.sparse;
    double*& at = given != nullptr ? entries : full;
    const std::ptrdiff_t size = given != nullptr
                                    ? static_cast<std::ptrdiff_t>(given->columns.size())
                                    : static_cast<std::ptrdiff_t>(part.set->count) * n;
    std::fill(at, at + size, 0.0);
    const Status status = given != nullptr ? sparse(part, t, y, n, at, value)
                                           : dense(part, t, y, n, scale, columns, at, value);
    if (status != Status::success) return status;
    at += size;
  }
  return value == nullptr ? Status::success : finite(t, value);
}

Status Evaluator::differences(const Part& part, double t, const double* y, int n,
                              const double* scale, const std::vector<int>& columns, double* C) {
  const int m = part.set->count;
  const auto evaluate = [&](const double* at, double* g) {
    ++statistics_.value_evaluations;
    const int flag = guarded(
        [&] {
          return write(part, n, g, nullptr, 0, [&](double* to, double*) {
            return part.set->value(t, ConstVector(at, n), Vector(to, m));
          });
        },
        thrown_);
    return checked(flag, "value (differences)", part);
  };

  const double kRootEpsilon = std::sqrt(std::numeric_limits<double>::epsilon());
  double largest = 0.0, relative = 0.0;  // relative: 1 / rtol, where a y_j is far above its atol
  for (int j = 0; j < n; ++j) {
    largest = std::max(largest, std::abs(y[j]));
    if (scale[j] > 0.0) relative = std::max(relative, std::abs(y[j]) / scale[j]);
  }
  y_shifted_.assign(y, y + n);
  Status status = evaluate(y, g_base_.data());
  for (std::size_t k = 0; k < columns.size() && status == Status::success; ++k) {
    const auto j = static_cast<std::size_t>(columns[k]);
    // About one tolerance, or the root of rounding of atol / rtol: less would drown in the rounding
    // of g where y_j passes zero.
    const double least = scale[j] * std::max(1.0, kRootEpsilon * relative);
    double increment = std::max(kRootEpsilon * std::abs(y[j]), std::min(least, 1e-4 * largest));
    if (increment == 0.0) increment = kRootEpsilon;
    y_shifted_[j] = y[j] + increment;
    increment = y_shifted_[j] - y[j];  // the increment after rounding
    status = evaluate(y_shifted_.data(), g_shifted_.data());
    y_shifted_[j] = y[j];
    for (int i = 0; i < m; ++i)
      C[static_cast<std::size_t>(i) * static_cast<std::size_t>(n) + j] =
          (g_shifted_[static_cast<std::size_t>(i)] - g_base_[static_cast<std::size_t>(i)]) /
          increment;
  }
  return status;
}

void Evaluator::sensitive(double t, const double* y, int n, const double* scale,
                          const std::function<void(int, int)>& found) {
  double largest = 0.0;
  for (int j = 0; j < n; ++j) largest = std::max({largest, std::abs(y[j]), scale[j]});
  for (const Part& part : parts_) {
    if (!std::holds_alternative<FiniteDifferences>(part.set->jacobian)) continue;
    const int m = part.set->count;
    const auto evaluate = [&](double* g) {
      if (fatal_) return false;
      ++statistics_.value_evaluations;
      const int flag = guarded(
          [&] {
            return write(part, n, g, nullptr, 0, [&](double* to, double*) {
              return part.set->value(t, ConstVector(y_shifted_.data(), n), Vector(to, m));
            });
          },
          thrown_);
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
