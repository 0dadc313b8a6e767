// Tether: an order of rows in which A A^T has a small envelope. SPDX-License-Identifier:
// BSD-3-Clause
#include "row_order.hpp"

#include <algorithm>

namespace tether::linalg {

namespace {

constexpr int kMostTests = 2;  // for a row at an end of its group

}  // namespace

void RowOrder::resize(int rows, int columns) {
  const auto each_row = static_cast<std::size_t>(rows);
  const auto each_column = static_cast<std::size_t>(columns);
  starts_.assign(each_column + 1, 0);
  owners_.assign(each_row * each_column, 0);
  degrees_.assign(each_row, 0);
  reached_.assign(each_row, 0);
  visited_.assign(each_row, 0);
}

void RowOrder::list_columns(const FilledPlaces& places) {
  const auto for_places = [&](auto take) {
    for (int k = 0; k < count_; ++k)
      for (const int *j = places.begin(rows_[k]), *last = places.end(rows_[k]); j != last; ++j)
        take(k, starts_[static_cast<std::size_t>(*j)]);
  };
  std::fill(starts_.begin(), starts_.end(), 0);
  for_places([](int, int& start) { ++start; });
  int sum = 0;
  for (int& start : starts_) start = sum += start;  // ends so far
  for_places([this](int k, int& start) { owners_[static_cast<std::size_t>(--start)] = k; });
}

// Visits each neighbour of row k once, without k itself.
template <class Visit>
void RowOrder::for_neighbours(int k, Visit visit) {
  visited_[static_cast<std::size_t>(k)] = ++visit_;
  for (const int *j = places_->begin(rows_[k]), *last = places_->end(rows_[k]); j != last; ++j) {
    const auto column = static_cast<std::size_t>(*j);
    for (int e = starts_[column]; e < starts_[column + 1]; ++e) {
      const int l = owners_[static_cast<std::size_t>(e)];
      int& before = visited_[static_cast<std::size_t>(l)];
      if (before == visit_) continue;
      before = visit_;
      visit(l);
    }
  }
}

// Lists the rows that are reached from `start` in queue_[first ..], breadth first, rows with few
// neighbours first. Returns the end of the list.
int RowOrder::reach(int start, int first) {
  int end = first;
  const auto take = [&](int k) {
    reached_[static_cast<std::size_t>(k)] = 1;
    queue_[end++] = k;
  };
  take(start);
  for (int head = first; head < end; ++head) {
    int* const begin = queue_ + end;
    for_neighbours(queue_[head], [&](int l) {
      if (reached_[static_cast<std::size_t>(l)] == 0) take(l);
    });
    std::sort(begin, queue_ + end, [this](int k, int l) {
      const int a = degrees_[static_cast<std::size_t>(k)];
      const int b = degrees_[static_cast<std::size_t>(l)];
      return a != b ? a < b : k < l;
    });
  }
  return end;
}

int RowOrder::far_from(int start, int first) {
  for (int look = 0; look < kMostTests; ++look) {
    const int end = reach(start, first);
    start = queue_[end - 1];
    for (int e = first; e < end; ++e) reached_[static_cast<std::size_t>(queue_[e])] = 0;
  }
  return start;
}

void RowOrder::run(const FilledPlaces& places, const int* rows, int count, int* sorted) {
  places_ = &places;
  rows_ = rows;
  count_ = count;
  queue_ = sorted;
  list_columns(places);
  visit_ = 0;
  std::fill(visited_.begin(), visited_.end(), 0);
  const auto each_row = [count](auto body) {
    for (int k = 0; k < count; ++k) body(k, static_cast<std::size_t>(k));
  };
  each_row([this](int k, std::size_t row) {
    int degree = 0;
    for_neighbours(k, [&degree](int) { ++degree; });
    degrees_[row] = degree;
    reached_[row] = 2 * degree > count_ ? 1 : 0;
  });
  int end = 0;
  each_row([&](int k, std::size_t row) {
    if (reached_[row] == 0) end = reach(far_from(k, end), end);
  });
  std::reverse(sorted, sorted + end);
  each_row([&](int k, std::size_t row) {
    if (2 * degrees_[row] > count) sorted[end++] = k;
  });
}

}  // namespace tether::linalg
