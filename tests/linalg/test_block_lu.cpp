// Tether: sparse LU with 3x3 blocks. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/LU>
#include <random>
#include <tether/linalg/block_lu.hpp>

#include "support/catch.hpp"

using namespace tether::linalg;

// A ring of blocks, so that there is fill; rows of pivot blocks change places.
TEST_CASE("block lu: the sign of the determinant") {
  constexpr int kBlocks = 5;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> any(-1, 1);
  std::vector<int> starts = {0}, columns;
  for (int i = 0; i < kBlocks; ++i) {
    for (int j = 0; j < kBlocks; ++j)
      if ((i - j + kBlocks + 1) % kBlocks < 3) columns.push_back(j);
    starts.push_back(static_cast<int>(columns.size()));
  }
  const BlockPattern pattern{kBlocks, starts.data(), columns.data()};
  BlockLu lu;
  lu.order(pattern);
  lu.analyse(pattern, nullptr);
  int negative = 0;
  for (int k = 0; k < 200; ++k) {
    Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(3 * kBlocks, 3 * kBlocks);
    for (int i = 0; i < kBlocks; ++i)
      for (int p = starts[static_cast<std::size_t>(i)]; p < starts[static_cast<std::size_t>(i) + 1];
           ++p)
        for (int r = 0; r < 3; ++r)
          for (int c = 0; c < 3; ++c)
            dense(3 * i + r, 3 * columns[static_cast<std::size_t>(p)] + c) = any(random);
    for (int row = 0; row < lu.size(); ++row) {
      const int i = lu.block_row(row);
      lu.begin_row(row);
      for (int p = starts[static_cast<std::size_t>(i)]; p < starts[static_cast<std::size_t>(i) + 1];
           ++p) {
        const int j = columns[static_cast<std::size_t>(p)];
        PackedBlock block;
        for (int c = 0; c < 3; ++c)
          for (int r = 0; r < 3; ++r) block.column[4 * c + r] = dense(3 * i + r, 3 * j + c);
        lu.add(j, block.column);
      }
      REQUIRE(lu.end_row());
    }
    const int sign = dense.determinant() < 0 ? -1 : 1;
    CHECK(lu.determinant_sign() == sign);
    negative += sign < 0;
  }
  CHECK(negative > 50);
  CHECK(negative < 150);
}
