// Tether: order and fill of a symmetric elimination. SPDX-License-Identifier: BSD-3-Clause
#include "elimination.hpp"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <numeric>

namespace tether::linalg {

std::vector<int> minimum_degree_order(const BlockPattern& pattern) {
  const int n = pattern.size, entries = pattern.starts[n];
  // Entries are inserted one by one: Eigen's own copies require ascending columns, which the order
  // does not need.
  Eigen::SparseMatrix<double> whole(n, n);
  whole.resizeNonZeros(entries);
  std::copy(pattern.starts, pattern.starts + n + 1, whole.outerIndexPtr());
  std::copy(pattern.columns, pattern.columns + entries, whole.innerIndexPtr());
  std::fill(whole.valuePtr(), whole.valuePtr() + entries, 1.0);
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> permutation;
  Eigen::internal::minimum_degree_ordering(whole, permutation);
  return {permutation.indices().data(), permutation.indices().data() + n};
}

// The rows of column k are the later neighbours of k and those of its children in the elimination
// tree.
void find_fill(const BlockPattern& pattern, const std::vector<int>& order,
               const std::vector<int>& position, std::vector<int>& starts, std::vector<int>& rows) {
  const int n = static_cast<int>(order.size());
  std::vector<int> mark(at(n), -1), first_child(at(n), -1), sibling(at(n), -1);
  starts.assign(1, 0);
  rows.clear();
  for (int k = 0; k < n; ++k) {
    const std::size_t begin = rows.size();
    mark[at(k)] = k;
    const auto add = [&](int j) {
      if (j <= k || mark[at(j)] == k) return;
      mark[at(j)] = k;
      rows.push_back(j);
    };
    const int i = order[at(k)];
    for (int p = pattern.starts[i]; p < pattern.starts[i + 1]; ++p)
      add(position[at(pattern.columns[p])]);
    for (int c = first_child[at(k)]; c >= 0; c = sibling[at(c)])
      for (int p = starts[at(c)]; p < starts[at(c + 1)]; ++p) add(rows[at(p)]);
    std::sort(rows.begin() + static_cast<std::ptrdiff_t>(begin), rows.end());
    if (rows.size() > begin) {
      const int parent = rows[begin];
      sibling[at(k)] = first_child[at(parent)];
      first_child[at(parent)] = k;
    }
    starts.push_back(static_cast<int>(rows.size()));
  }
}

void transpose(int n, const std::vector<int>& starts, const std::vector<int>& columns,
               std::vector<int>& row_starts, std::vector<int>& rows) {
  row_starts.assign(at(n) + 1, 0);
  for (const int j : columns) ++row_starts[at(j) + 1];
  std::partial_sum(row_starts.begin(), row_starts.end(), row_starts.begin());
  std::vector<int> next(row_starts.begin(), row_starts.end() - 1);
  rows.resize(columns.size());
  for (int i = 0; i + 1 < static_cast<int>(starts.size()); ++i)
    for (int e = starts[at(i)]; e < starts[at(i) + 1]; ++e)
      rows[at(next[at(columns[at(e)])]++)] = i;
}

}  // namespace tether::linalg
