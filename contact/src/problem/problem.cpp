// Tether: storage of contact problems. SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/problem.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <tether/linalg/disjoint_sets.hpp>
#include <tether/linalg/index.hpp>
#include <tuple>

#include "problem/body_form.hpp"
#include "problem/criterion.hpp"
#include "problem/refuse.hpp"

namespace tether::contact {
namespace {

using linalg::at;

int dimension_of(const linalg::VectorView& b, const linalg::VectorView& mu) {
  for (int d : {3, 2}) {
    if (b.size() == d * mu.size()) return d;
  }
  throw std::invalid_argument("b has " + std::to_string(b.size()) +
                              " entries: 3 (or 2, in the plane) are needed for each of " +
                              std::to_string(mu.size()) + " friction coefficients mu");
}

// Connected components of the blocks that are not zero.
std::vector<int> find_islands(int n, const std::vector<int>& row_start,
                              const std::vector<int>& columns,
                              const std::vector<PackedBlock>& blocks) {
  linalg::DisjointSets sets(n);
  for (int i = 0; i < n; ++i) {
    for (int k = row_start[at(i)]; k < row_start[at(i + 1)]; ++k) {
      if (sets.root(i) == sets.root(columns[at(k)])) continue;
      if (!detail::is_zero(blocks[at(k)])) sets.join(i, columns[at(k)]);
    }
  }
  // A root precedes the contacts of its island.
  int count = 0;
  std::vector<int> island(at(n));
  for (int i = 0; i < n; ++i)
    island[at(i)] = sets.root(i) == i ? count++ : island[at(sets.root(i))];
  return island;
}

constexpr std::size_t kZero = std::numeric_limits<std::size_t>::max();

/// Place of a block; kZero: the block is zero, but the pattern has the place.
struct Position {
  int row, column;
  std::size_t block;

  bool is_at(const Position& other) const { return row == other.row && column == other.column; }
};

/// Places of all blocks by row, column and their order, with their mirror places, which keep the
/// pattern symmetric, and those of the diagonal.
std::vector<Position> positions(const std::vector<MatrixBlock>& blocks, int n) {
  std::vector<Position> out;
  out.reserve(2 * blocks.size() + at(n));
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    out.push_back({blocks[k].row, blocks[k].column, k});
    if (blocks[k].row != blocks[k].column) out.push_back({blocks[k].column, blocks[k].row, kZero});
  }
  for (int i = 0; i < n; ++i) out.push_back({i, i, kZero});
  std::sort(out.begin(), out.end(), [](const Position& p, const Position& q) {
    return std::tie(p.row, p.column, p.block) < std::tie(q.row, q.column, q.block);
  });
  return out;
}

void check(const std::vector<MatrixBlock>& blocks, int n, int d) {
  for (const MatrixBlock& block : blocks) {
    const auto name = [&] {
      return "block (" + std::to_string(block.row) + ", " + std::to_string(block.column) + "): ";
    };
    if (block.row < 0 || block.row >= n || block.column < 0 || block.column >= n)
      throw std::invalid_argument(name() + "row and column must lie in 0 .. " +
                                  std::to_string(n - 1));
    if (!block.value.topLeftCorner(d, d).allFinite())
      detail::require_finite("A", block.value.topLeftCorner(d, d), name());
  }
}

LocalBlock local_block(int contact, const Eigen::Matrix3d& A, double mu) {
  try {
    return {A, mu};
  } catch (const std::invalid_argument& e) {
    throw std::invalid_argument("contact " + std::to_string(contact) + ": " + e.what());
  }
}

}  // namespace

Problem Problem::dense(const linalg::MatrixView& A, const linalg::VectorView& b,
                       const linalg::VectorView& mu) {
  const int d = dimension_of(b, mu), n = static_cast<int>(mu.size());
  if (A.rows() != b.size() || A.cols() != b.size()) {
    const std::string size = std::to_string(b.size());
    throw std::invalid_argument("A is " + std::to_string(A.rows()) + " x " +
                                std::to_string(A.cols()) + ": must be " + size + " x " + size +
                                ", as b has " + size + " entries");
  }
  detail::require_finite("A", A);
  std::vector<MatrixBlock> blocks;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const auto part = A.block(d * i, d * j, d, d);
      if (i != j && (part.array() == 0).all()) continue;
      blocks.push_back({i, j, Eigen::Matrix3d::Zero()});
      blocks.back().value.topLeftCorner(d, d) = part;
    }
  return sparse(d, std::move(blocks), b, mu);
}

Problem Problem::sparse(int dimension, std::vector<MatrixBlock> blocks, const linalg::VectorView& b,
                        const linalg::VectorView& mu) {
  const int n = static_cast<int>(mu.size()), d = dimension;
  detail::require(d == 2 || d == 3, "dimension", d, "must be 2 or 3");
  detail::require(mu.size() <= std::numeric_limits<int>::max() / 3, "size of mu",
                  static_cast<double>(mu.size()), "must be at most 715827882");
  if (b.size() != d * mu.size()) {
    detail::refuse_size(
        "b", b.size(), d * mu.size(),
        std::to_string(d) + " for each of " + std::to_string(n) + " friction coefficients mu");
  }
  detail::require_finite("b", b);
  check(blocks, n, d);
  const std::vector<Position> order = positions(blocks, n);

  Problem out;
  out.dimension_ = d;
  out.b_ = b;
  out.row_start_.assign(at(n + 1), 0);
  std::size_t distinct = 0;
  for (std::size_t k = 0; k < order.size(); ++k)
    distinct += k == 0 || !order[k].is_at(order[k - 1]) ? 1 : 0;
  out.columns_.reserve(distinct);
  out.blocks_.reserve(distinct);
  out.local_.reserve(at(n));
  for (std::size_t k = 0; k < order.size();) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    const Position& first = order[k];
    const int row = first.row, column = first.column;
    for (; k < order.size() && order[k].is_at(first); ++k)
      if (order[k].block != kZero)
        sum.topLeftCorner(d, d) += blocks[order[k].block].value.topLeftCorner(d, d);
    // The plane is a 3-D contact whose second tangent is decoupled and at rest.
    if (d == 2 && row == column) sum(2, 2) = sum(1, 1) > 0 ? sum(1, 1) : sum(0, 0);
    if (!sum.allFinite()) {
      detail::require_finite(
          "sum of blocks", sum,
          "block (" + std::to_string(row) + ", " + std::to_string(column) + "): ");
    }
    out.columns_.push_back(column);
    detail::as_matrix(out.blocks_.emplace_back()) = sum;
    ++out.row_start_[at(row + 1)];
    if (row == column) out.local_.push_back(local_block(row, sum, mu[row]));
  }
  for (int i = 0; i < n; ++i) out.row_start_[at(i + 1)] += out.row_start_[at(i)];
  out.islands_ = find_islands(n, out.row_start_, out.columns_, out.blocks_);
  out.packed_b_ = out.pack(b);
  return out;
}

Problem Problem::rescaled(const std::vector<int>& mass, const std::vector<int>& speed) const {
  const std::size_t islands =
      islands_.empty() ? 0 : at(*std::max_element(islands_.begin(), islands_.end()) + 1);
  for (const auto& [name, list] : {std::pair("mass", &mass), std::pair("speed", &speed)})
    if (list->size() < islands)
      detail::refuse_size(name, static_cast<Eigen::Index>(list->size()),
                          static_cast<Eigen::Index>(islands), "one for each island");
  Problem out = *this;
  out.body_form_.reset();  // of other units
  for (int i = 0; i < contacts(); ++i) {
    const std::size_t island = at(islands_[at(i)]);
    out.local_[at(i)] = detail::rescaled(local_[at(i)], mass[island]);
    for (int k = row_start_[at(i)]; k < row_start_[at(i + 1)]; ++k)
      for (double& v : out.blocks_[at(k)].column) v = std::ldexp(v, mass[island]);
    for (double& v : out.packed_b_[at(i)].v) v = std::ldexp(v, speed[island]);
  }
  out.unpack(out.packed_b_, out.b_);
  return out;
}

Problem Problem::part(const std::vector<int>& contacts) const {
  for (std::size_t r = 0; r < contacts.size(); ++r)
    if (contacts[r] <= (r > 0 ? contacts[r - 1] : -1) || at(contacts[r]) >= local_.size())
      throw std::invalid_argument("Problem::part: contacts[" + std::to_string(r) +
                                  "] = " + std::to_string(contacts[r]) +
                                  ", must ascend from 0 to below " + std::to_string(local_.size()));
  Problem out;
  out.dimension_ = dimension_;
  out.row_start_.push_back(0);
  for (int i : contacts) {
    for (int k = row_start_[at(i)]; k < row_start_[at(i + 1)]; ++k) {
      // Searched for: a table of all contacts would cost many small parts the square of their
      // number.
      const auto column = std::lower_bound(contacts.begin(), contacts.end(), columns_[at(k)]);
      if (column == contacts.end() || *column != columns_[at(k)]) continue;
      out.columns_.push_back(static_cast<int>(column - contacts.begin()));
      out.blocks_.push_back(blocks_[at(k)]);
    }
    out.row_start_.push_back(static_cast<int>(out.columns_.size()));
    out.local_.push_back(local_[at(i)]);
    out.packed_b_.push_back(packed_b_[at(i)]);
  }
  out.islands_ =
      find_islands(static_cast<int>(contacts.size()), out.row_start_, out.columns_, out.blocks_);
  out.unpack(out.packed_b_, out.b_);
  if (body_form_) out.body_form_ = detail::part_of(*body_form_, contacts);
  return out;
}

linalg::MatrixX Problem::dense_matrix() const {
  const int n = contacts(), d = dimension_;
  linalg::MatrixX A = linalg::MatrixX::Zero(d * n, d * n);
  for (int i = 0; i < n; ++i) {
    for (int k = row_start_[at(i)]; k < row_start_[at(i + 1)]; ++k)
      A.block(d * i, d * columns_[at(k)], d, d) =
          detail::as_matrix(blocks_[at(k)]).topLeftCorner(d, d);
  }
  return A;
}

std::vector<PackedVector> Problem::pack(const linalg::VectorView& x) const {
  const int n = contacts(), d = dimension_;
  if (x.size() != d * n) {
    detail::refuse_size("impulses", x.size(), d * n, std::to_string(d) + " for each contact");
  }
  std::vector<PackedVector> out(at(n));
  for (int i = 0; i < n; ++i)
    for (int r = 0; r < d; ++r) out[at(i)].v[r] = x[d * i + r];
  return out;
}

void Problem::unpack(const std::vector<PackedVector>& x, linalg::VectorX& out) const {
  const int n = contacts(), d = dimension_;
  if (x.size() != at(n))
    detail::refuse_size("x", static_cast<Eigen::Index>(x.size()), n, "one for each contact");
  out.resize(d * n);
  for (int i = 0; i < n; ++i)
    for (int r = 0; r < d; ++r) out[d * i + r] = x[at(i)].v[r];
}

}  // namespace tether::contact
