// Tether: matrices of the Siconos .dat format. SPDX-License-Identifier: BSD-3-Clause
#include "io/dat_matrix.hpp"

#include <cstdio>
#include <limits>
#include <tether/linalg/index.hpp>

namespace tether::contact::detail {

namespace {

constexpr long kMost = std::numeric_limits<int>::max();
// Words that the shortest entry takes, and the white space between them: what is left of the file
// bounds what it may claim.
constexpr long kNumber = 2, kTriplet = 8, kColumn = 6;

void claim(Tokens& in, long count, long bytes) {
  if (count > in.left() / bytes + 1) in.fail("truncated: the file ends in the matrix");
}

std::vector<MatrixEntry> read_dense(Tokens& in, long rows, long columns) {
  if (in.integer("matrix rows", 0, kMost) != rows ||
      in.integer("matrix columns", 0, kMost) != columns)
    in.fail("matrix sizes do not match");
  if (rows > 0) claim(in, columns, kNumber * rows);
  std::vector<MatrixEntry> out;
  for (long c = 0; c < columns; ++c)
    for (long r = 0; r < rows; ++r)
      if (const double v = in.finite("matrix"); v != 0)
        out.push_back({static_cast<int>(r), static_cast<int>(c), v});
  return out;
}

std::vector<MatrixEntry> read_blocks(Tokens& in, long rows, long columns) {
  const long count = in.integer("number of blocks", 0, kMost);
  const long sides[2] = {in.integer("block rows", 0, rows),
                         in.integer("block columns", 0, columns)};
  claim(in, sides[0] + sides[1] + count, kNumber);
  std::vector<long> end[2];
  for (int side = 0; side < 2; ++side) {
    const char* what = side == 0 ? "row ends" : "column ends";
    for (long i = 0; i < sides[side]; ++i)
      end[side].push_back(
          in.integer(what, i == 0 ? 0 : end[side].back(), side == 0 ? rows : columns));
    if ((end[side].empty() ? 0 : end[side].back()) != (side == 0 ? rows : columns))
      in.fail(std::string(what) + " do not end with the matrix");
  }
  const long filled1 = in.integer("filled1", 0, sides[0] + 1),
             filled2 = in.integer("filled2", 0, count);
  if (filled1 != sides[0] + 1 || filled2 != count)
    in.fail("filled1 and filled2 do not match the blocks");
  std::vector<long> start, column;
  for (long i = 0; i < filled1; ++i)
    start.push_back(in.integer("row pointers", i == 0 ? 0 : start.back(), count));
  if (start.front() != 0 || start.back() != count) in.fail("row pointers do not match the blocks");
  for (long k = 0; k < count; ++k) column.push_back(in.integer("block columns", 0, sides[1] - 1));
  std::vector<MatrixEntry> out;
  const auto first = [&](int side, long i) {
    return i == 0 ? 0 : end[side][static_cast<std::size_t>(i - 1)];
  };
  long row = 0;
  for (long k = 0; k < count; ++k) {
    while (start[static_cast<std::size_t>(row + 1)] <= k) ++row;
    if (in.integer("block number", 0, count) != k) in.fail("block numbers do not ascend");
    const long c0 = column[static_cast<std::size_t>(k)];
    for (long c = first(1, c0); c < end[1][static_cast<std::size_t>(c0)]; ++c)
      for (long r = first(0, row); r < end[0][static_cast<std::size_t>(row)]; ++r)
        if (const double v = in.finite("matrix"); v != 0)
          out.push_back({static_cast<int>(r), static_cast<int>(c), v});
  }
  return out;
}

}  // namespace

std::vector<MatrixEntry> read_sparse(Tokens& in, long rows, long columns) {
  constexpr long kTriplets = 1, kColumns = 2;
  const long origin = in.integer("sparse storage (1: triplets, 2: columns)", kTriplets, kColumns);
  if (in.line("the sparse matrix").rfind("CSparse", 0) != 0)
    in.fail("a line that begins with CSparse is expected in the sparse matrix");
  const std::string head = in.line("the sparse matrix");
  long m = -1, n = -1, most = -1, count = -1;
  const char* form = origin == kTriplets ? "triplet: %9ld-by-%9ld, nzmax: %18ld nnz: %18ld"
                                         : "%9ld-by-%9ld, nzmax: %18ld nnz: %18ld";
  if (std::sscanf(head.c_str(), form, &m, &n, &most, &count) != 4 || m != rows || n != columns ||
      count < 0)
    in.fail("the head of the sparse matrix does not match it");
  claim(in, count, origin == kTriplets ? kTriplet : kColumn);
  std::vector<MatrixEntry> out;
  const auto row = [&] { return static_cast<int>(in.integer("row", 0, rows - 1)); };
  if (origin == kTriplets) {
    for (long k = 0; k < count; ++k) {
      const int r = row(), c = static_cast<int>(in.integer("column", 0, columns - 1));
      in.expect(':', "the sparse matrix");
      out.push_back({r, c, in.finite("matrix")});
    }
    return out;
  }
  long next = 0;
  for (long c = 0; c < columns; ++c) {
    long number = -1, from = -1, to = -2;
    if (std::sscanf(in.line("the sparse matrix").c_str(), "col %9ld : locations %18ld to %18ld",
                    &number, &from, &to) != 3 ||
        number != c || from != next || to < from - 1 || to >= count)
      in.fail("column " + std::to_string(c) + " of the sparse matrix does not follow the last one");
    for (; next <= to; ++next) {
      const int r = row();
      in.expect(':', "the sparse matrix");
      out.push_back({r, static_cast<int>(c), in.finite("matrix")});
    }
  }
  if (next != count) in.fail("the sparse matrix has fewer entries than it says");
  return out;
}

FileMatrix read_matrix(Tokens& in) {
  const long storage = in.integer("matrix storage type", 0, 2);
  FileMatrix out;
  out.rows = in.integer("matrix rows", 0, kMost);
  out.columns = in.integer("matrix columns", 0, kMost);
  out.entries = storage == 0   ? read_dense(in, out.rows, out.columns)
                : storage == 1 ? read_blocks(in, out.rows, out.columns)
                               : read_sparse(in, out.rows, out.columns);
  return out;
}

}  // namespace tether::contact::detail
