// Tether: the Siconos .dat format. SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/files.hpp>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <limits>
#include <stdexcept>

#include "io/dat_matrix.hpp"

namespace tether::contact {

using detail::Tokens;

namespace {

constexpr long kMostContacts = 10'000'000;

}  // namespace

Problem read_dat(const std::string& path) {
  Tokens in(path);
  const int d = static_cast<int>(in.integer("dimension", 2, 3));
  const int n = static_cast<int>(in.integer("number of contacts", 0, kMostContacts));
  const long storage = in.integer("matrix storage type", 0, 2);
  const long rows = in.integer("matrix rows", 0, std::numeric_limits<int>::max());
  const long columns = in.integer("matrix columns", 0, std::numeric_limits<int>::max());
  const long size = static_cast<long>(d) * n;
  if (rows != size || columns != size) {
    in.fail("the matrix is " + std::to_string(rows) + " x " + std::to_string(columns) + ", " +
            std::to_string(n) + " contacts of dimension " + std::to_string(d) + " need " +
            std::to_string(size));
  }
  Eigen::MatrixXd A;
  std::vector<MatrixBlock> blocks;
  if (storage == 0) {
    if (in.integer("matrix rows", 0, rows) != rows ||
        in.integer("matrix columns", 0, columns) != columns) {
      in.fail("matrix sizes do not match");
    }
    // An entry takes two characters at least; a small file cannot claim a large matrix.
    if (size > 0 && in.left() / (2 * size) < size - 1)
      in.fail("truncated: the file ends in the matrix");
    A.resize(size, size);
    for (long c = 0; c < size; ++c)
      for (long r = 0; r < size; ++r) A(r, c) = in.finite("matrix");
  } else if (storage == 2) {
    for (const MatrixEntry& e : detail::read_sparse(in, rows, columns)) {
      blocks.push_back({e.row / d, e.column / d, Eigen::Matrix3d::Zero()});
      blocks.back().value(e.row % d, e.column % d) = e.value;
    }
  } else {
    const long most = std::numeric_limits<int>::max();
    const long count = in.integer("number of blocks", 0, most);
    if (in.integer("block rows", 0, most) != n || in.integer("block columns", 0, most) != n) {
      in.fail("block rows and columns must equal the number of contacts");
    }
    if (count * 2L * (d * d) > in.left()) in.fail("truncated: the file ends in the matrix");
    for (const char* what : {"row ends", "column ends"}) {
      for (int i = 0; i < n; ++i) {
        if (in.integer(what, 0, size) != static_cast<long>(d) * (i + 1)) {
          in.fail(std::string(what) + ": blocks must have the size of a contact");
        }
      }
    }
    const long filled1 = in.integer("filled1", 0, n + 1L),
               filled2 = in.integer("filled2", 0, count);
    if (filled1 != n + 1L || filled2 != count)
      in.fail("filled1 and filled2 do not match the blocks");
    std::vector<long> start;
    for (long i = 0; i < filled1; ++i) {
      start.push_back(in.integer("row pointers", i == 0 ? 0 : start.back(), count));
    }
    if (start.front() != 0 || start.back() != count)
      in.fail("row pointers do not match the blocks");
    std::vector<int> column;
    for (long k = 0; k < count; ++k)
      column.push_back(static_cast<int>(in.integer("block columns", 0, n - 1L)));
    int row = 0;
    for (long k = 0; k < count; ++k) {
      while (start[static_cast<std::size_t>(row + 1)] <= k) ++row;
      if (in.integer("block number", 0, count) != k) in.fail("block numbers do not ascend");
      MatrixBlock block{row, column[static_cast<std::size_t>(k)], Eigen::Matrix3d::Zero()};
      for (int c = 0; c < d; ++c)
        for (int r = 0; r < d; ++r) block.value(r, c) = in.finite("matrix");
      blocks.push_back(block);
    }
  }
  Eigen::VectorXd b(size), mu(n);
  for (long i = 0; i < size; ++i) b[i] = -in.finite("q");
  for (int i = 0; i < n; ++i) mu[i] = in.finite("mu");
  if (!in.empty())
    in.integer("trailing number", std::numeric_limits<int>::min(), std::numeric_limits<int>::max());
  if (!in.empty()) in.fail("oversized: data after the friction coefficients");
  try {
    return storage == 0 ? Problem::dense(A, b, mu) : Problem::sparse(d, std::move(blocks), b, mu);
  } catch (const std::invalid_argument& e) {
    in.fail(e.what());
  }
}

namespace {

// With 17 digits, as "%.17g " would in the C locale.
void put(std::FILE* file, double value) {
  char text[32];
  char* end =
      std::to_chars(text, text + sizeof text - 1, value, std::chars_format::general, 17).ptr;
  *end++ = ' ';
  std::fwrite(text, 1, static_cast<std::size_t>(end - text), file);
}

}  // namespace

void write_dat(const Problem& problem, const std::string& path, DatStorage storage) {
  std::FILE* file = std::fopen(path.c_str(), "w");
  if (!file) throw std::runtime_error(path + ": cannot be written");
  const int n = problem.contacts(), d = problem.dimension(), size = d * n;
  std::fprintf(file, "%d\n%d\n%d\n%d\n%d\n", d, n, storage == DatStorage::dense ? 0 : 1, size,
               size);
  if (storage == DatStorage::dense) {
    std::fprintf(file, "%d %d\n", size, size);
    const linalg::MatrixX A = problem.dense_matrix();
    for (int c = 0; c < size; ++c) {
      for (int r = 0; r < size; ++r) put(file, A(r, c));
      std::fprintf(file, "\n");
    }
  } else {
    const int count = static_cast<int>(problem.blocks().size());
    std::fprintf(file, "%d\n%d\n%d\n", count, n, n);
    for (int k = 0; k < 2; ++k) {
      for (int i = 1; i <= n; ++i) std::fprintf(file, "%d ", d * i);
      std::fprintf(file, "\n");
    }
    std::fprintf(file, "%d %d\n", n + 1, count);
    for (int p : problem.row_start()) std::fprintf(file, "%d ", p);
    std::fprintf(file, "\n");
    for (int p : problem.columns()) std::fprintf(file, "%d ", p);
    std::fprintf(file, "\n");
    for (int k = 0; k < count; ++k) {
      std::fprintf(file, "%d\n", k);
      for (int c = 0; c < d; ++c)
        for (int r = 0; r < d; ++r)
          put(file, problem.blocks()[static_cast<std::size_t>(k)].column[4 * c + r]);
      std::fprintf(file, "\n");
    }
  }
  for (int i = 0; i < size; ++i) put(file, -problem.b()[i]);
  std::fprintf(file, "\n");
  for (int i = 0; i < n; ++i) put(file, problem.mu(i));
  std::fprintf(file, "\n");
  const bool failed = std::ferror(file) != 0;
  if (std::fclose(file) != 0 || failed) throw std::runtime_error(path + ": cannot be written");
}

}  // namespace tether::contact
