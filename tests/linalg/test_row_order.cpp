// Tether: an order of rows in which A A^T has a small envelope. SPDX-License-Identifier:
// BSD-3-Clause
#include "dense_rows/row_order.hpp"

#include <algorithm>
#include <cstdlib>
#include <numeric>
#include <vector>

#include "support/catch.hpp"

using tether::linalg::FilledPlaces;
using tether::linalg::RowOrder;

namespace {

/// Rows `link` of `chains` chains, each in two columns that it shares with its neighbours; the
/// last of all `rows` is full.
struct Chains {
  static constexpr int kRows = 31, kColumns = 40;
  int chains;

  int links() const { return (kRows - 1) / chains; }
  /// Link 0, 1, .. of all chains, in an order without order.
  int link(int row) const { return row * 13 % (kRows - 1); }
  void find(FilledPlaces* places) const {
    places->resize(kRows, kColumns);
    for (int i = 0; i < kRows; ++i) {
      std::vector<double> entries(kColumns, i == kRows - 1 ? 1.0 : 0.0);
      const int k = link(i), first = k + k / links();  // chains have no column in common
      if (i < kRows - 1)
        entries[static_cast<std::size_t>(first)] = entries[static_cast<std::size_t>(first) + 1] =
            1.0;
      places->note(i, entries.data());
    }
  }
};

}  // namespace

TEST_CASE("chains of rows in any order, and a full row: neighbours are next to each other") {
  for (const int chains : {1, 2, 5}) {
    INFO(chains << " chains");
    const Chains rows{chains};
    FilledPlaces places;
    rows.find(&places);
    std::vector<int> given(Chains::kRows), sorted(Chains::kRows);
    std::iota(given.begin(), given.end(), 0);
    std::rotate(given.begin(), given.end() - 1, given.end());  // the full row comes first
    RowOrder order;
    order.resize(Chains::kRows, Chains::kColumns);
    for (int again = 0; again < 2; ++again) {
      order.run(places, given.data(), Chains::kRows, sorted.data());
      std::vector<int> all = sorted;
      std::sort(all.begin(), all.end());
      for (int k = 0; k < Chains::kRows; ++k) CHECK(all[static_cast<std::size_t>(k)] == k);
      CHECK(sorted.back() == 0);  // the full row
      for (int k = 0; k + 2 < Chains::kRows; ++k) {
        const auto link_at = [&](int place) {
          const int chosen = sorted[static_cast<std::size_t>(place)];
          return rows.link(given[static_cast<std::size_t>(chosen)]);
        };
        if ((k + 1) % rows.links() == 0)
          CHECK(link_at(k) / rows.links() != link_at(k + 1) / rows.links());
        else
          CHECK(std::abs(link_at(k) - link_at(k + 1)) == 1);
      }
    }
  }
}
