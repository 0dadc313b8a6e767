// Tether: Anderson's acceleration on linear maps, where it is GMRES.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <tether/linalg/anderson.hpp>
#include <tether/linalg/block3.hpp>
#include <vector>

#include "support/catch.hpp"

using tether::linalg::Anderson;
using tether::linalg::PackedVector;

namespace {

constexpr int kBlocks = 2;

struct Diagonal {
  double rate[kBlocks][3];

  // Largest error after so many steps from 0 of x = rate x + (1 - rate), whose fixed point is 1.
  double error(int depth, int steps) const {
    Anderson anderson;
    anderson.reset(kBlocks, depth);
    PackedVector x[kBlocks] = {}, g[kBlocks] = {}, f[kBlocks] = {};
    for (int step = 0; step < steps; ++step) {
      for (int k = 0; k < kBlocks; ++k)
        for (int c = 0; c < 3; ++c) {
          g[k].v[c] = rate[k][c] * x[k].v[c] + (1 - rate[k][c]);
          f[k].v[c] = g[k].v[c] - x[k].v[c];
        }
      anderson.step(g, f, x);
    }
    double most = 0;
    for (const PackedVector& block : x)
      for (int c = 0; c < 3; ++c) most = std::max(most, std::abs(block.v[c] - 1));
    return most;
  }
};

}  // namespace

// After one step more than there are rates the residual's polynomial has all of them as its roots.
// The error that is left is the 1e-11 on the diagonal of the Gram matrix times its condition.
TEST_CASE("Anderson: a linear map with k rates is solved after k + 1 steps") {
  const Diagonal two{{{0.9, 0.9, 0.9}, {0.5, 0.5, 0.5}}};
  CHECK(two.error(4, 3) < 1e-7);
  CHECK(two.error(4, 2) > 1e-3);
  const Diagonal four{{{0.95, 0.6, -0.5}, {0.6, 0.2, 0.95}}};
  CHECK(four.error(6, 5) < 1e-6);
  CHECK(four.error(6, 4) > 1e-4);
  const Diagonal diverges{{{2.0, -3.0, 2.0}, {-3.0, 2.0, -3.0}}};
  CHECK(diverges.error(3, 3) < 1e-7);
}

// Odd and even numbers of blocks: sums take eight numbers at a time, and what is left.
TEST_CASE("Anderson: sums over packed vectors have all of their blocks") {
  for (int blocks = 1; blocks <= 5; ++blocks) {
    std::vector<PackedVector> p(static_cast<std::size_t>(blocks)), q(p.size());
    double sum = 0;
    for (int k = 0; k < blocks; ++k)
      for (int c = 0; c < 3; ++c) {
        p[static_cast<std::size_t>(k)].v[c] = 1 + 3 * k + c;
        q[static_cast<std::size_t>(k)].v[c] = 2;
        sum += 2.0 * (1 + 3 * k + c);
      }
    CHECK(tether::linalg::dot(p.data()->v, q.data()->v, 4 * blocks) == sum);
  }
}

// Differences of a map that is at rest are zero, and one that has ended repeats them.
TEST_CASE("Anderson: a map at rest stays there") {
  const Diagonal two{{{0.9, 0.9, 0.9}, {0.5, 0.5, 0.5}}};
  CHECK(two.error(4, 40) < 1e-14);
  CHECK(two.error(1, 400) < 1e-14);
}
