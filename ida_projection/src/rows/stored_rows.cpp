// Tether: C with its pattern. SPDX-License-Identifier: BSD-3-Clause
#include "rows/stored_rows.hpp"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <tether/linalg/index.hpp>

namespace tether::ida_projection {

using linalg::at;

StoredRows::StoredRows(const Evaluator& evaluator, int n, bool sparse) : n_(n), sparse_(sparse) {
  for (const Evaluator::Part& part : evaluator.parts())
    if (sparse && part.sparse != nullptr)
      columns_.insert(columns_.end(), part.sparse->columns.begin(), part.sparse->columns.end());
  int entry = 0, first_full = static_cast<int>(columns_.size());
  for (const Evaluator::Part& part : evaluator.parts())
    for (int i = 0; i < part.set->count; ++i) {
      const bool full = !sparse || part.sparse == nullptr;
      const int count = full ? n : part.sparse->starts[at(i + 1)] - part.sparse->starts[at(i)];
      int& begin = full ? first_full : entry;
      rows_.push_back({begin, count, full});
      begin += count;
    }
  values_.assign(at(first_full), 0.0);
  seen_.assign(values_.size(), 0);
}

Status StoredRows::evaluate(Evaluator& evaluator, double t, const double* y, const double* WT,
                            const std::vector<int>& columns, double* g) {
  if (sparse_)
    return evaluator.entries(t, y, n_, WT, columns, values_.data(),
                             values_.data() + columns_.size(), g);
  std::fill(values_.begin(), values_.end(), 0.0);
  return evaluator.jacobian_into_zeros(t, y, n_, WT, columns, values_.data(), g);
}

void StoredRows::notice_all() {
  for (std::size_t e = 0; e < seen_.size(); ++e) seen_[e] |= values_[e] != 0.0;
}

// Checks all entries without a branch for each, since hardly ever one has changed.
bool StoredRows::notice(const std::vector<std::size_t>& entries) {
  std::uint64_t bits = 0;
  for (const std::size_t e : entries) {
    std::uint64_t entry;
    std::memcpy(&entry, &values_[e], sizeof entry);
    bits |= (entry << 1) | static_cast<std::uint64_t>(seen_[e]);  // but for the sign
  }
  if (bits == 0) return false;
  for (const std::size_t e : entries) seen_[e] |= values_[e] != 0.0;
  return true;
}

RowPattern StoredRows::pattern(const std::vector<int>& of_rows) const {
  RowPattern rows;
  rows.n = n_;
  for (const int i : of_rows) {
    visit_places(i, [&rows](int j, std::size_t, bool seen) {
      if (seen) rows.columns.push_back(j);
    });
    rows.starts.push_back(static_cast<int>(rows.columns.size()));
  }
  return rows;
}

}  // namespace tether::ida_projection
