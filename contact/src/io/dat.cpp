// Tether: the Siconos .dat format. SPDX-License-Identifier: BSD-3-Clause

#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <locale>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "io/file_problem.hpp"

namespace tether::contact::detail {

constexpr std::size_t kMostOfPipe = std::size_t{1} << 30;

class Tokens {
 public:
  explicit Tokens(const std::string& path) : path_(path) {
    std::ifstream file(path, std::ios::binary);
    if (!file) throw std::runtime_error(path + ": cannot be opened");
    // Pipes and devices may never end: they are read up to a limit, and not beyond binary data.
    std::error_code ignored;
    const bool regular = std::filesystem::is_regular_file(path, ignored);
    std::vector<char> part(1 << 16);
    while (file.read(part.data(), static_cast<std::streamsize>(part.size())), file.gcount() > 0) {
      const auto count = static_cast<std::size_t>(file.gcount());
      text_.append(part.data(), count);
      if (std::memchr(part.data(), '\0', count) != nullptr) break;
      if (!regular && text_.size() > kMostOfPipe) {
        fail("oversized: more than " + std::to_string(kMostOfPipe) +
             " bytes, and not a regular file");
      }
    }
    if (file.bad()) fail("cannot be read");
    at_ = text_.data();
    end_ = at_ + text_.size();
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw std::runtime_error(path_ + ": " + what);
  }

  bool empty() {
    skip();
    return at_ == end_;
  }
  long integer(const char* what, long least, long most) {
    const double value = number(what);
    if (!(value >= static_cast<double>(least) && value <= static_cast<double>(most)) ||
        value != std::floor(value)) {
      std::ostringstream text;
      text.imbue(std::locale::classic());
      text << what << " is " << value << "; an integer from " << least << " to " << most
           << " is expected";
      fail(text.str());
    }
    return static_cast<long>(value);
  }
  double finite(const char* what) {
    const double value = number(what);
    if (!std::isfinite(value)) fail(std::string(what) + " has an entry that is not finite");
    return value;
  }
  long left() const { return static_cast<long>(end_ - at_); }
  /// Words from here to the end.
  long words_left() const {
    long count = 0;
    bool inside = false;
    for (const char* c = at_; c != end_; ++c) {
      const bool in = !separates(*c);
      count += in && !inside;
      inside = in;
    }
    return count;
  }
  /// The next line that is not empty, without white space before it; for a few hundred bytes.
  std::string line(const char* what) {
    skip();
    if (at_ == end_) fail(std::string("truncated: the file ends in ") + what);
    const char* stop = at_;
    while (stop != end_ && *stop != '\n' && stop - at_ < 400) ++stop;
    std::string out(at_, stop);
    at_ = stop;
    return out;
  }
  /// A character that must come next, white space before it.
  void expect(char c, const char* what) {
    skip();
    if (at_ == end_ || *at_ != c) fail(std::string("'") + c + "' is expected in " + what);
    ++at_;
  }

 private:
  void skip() {
    while (at_ != end_ && (*at_ == ' ' || *at_ == '\n' || *at_ == '\t' || *at_ == '\r')) ++at_;
  }
  // Independent of the locale that the host has set.
  double number(const char* what) {
    skip();
    if (at_ == end_) fail(std::string("truncated: the file ends in ") + what);
    if (*at_ == '\0') fail(std::string("binary data in ") + what);
    const char* begin = *at_ == '+' && at_ + 1 != end_ && at_[1] != '-' ? at_ + 1 : at_;
    double value = 0;
    const auto [stop, error] = std::from_chars(begin, end_, value);
    if (error == std::errc::result_out_of_range) {
      fail(std::string("out of the range of double precision in ") + what + ": '" + word(at_) +
           "'");
    }
    if (error != std::errc() || (stop != end_ && !separates(*stop))) {
      fail(std::string("not a number in ") + what + ": '" + word(at_) + "'");
    }
    at_ = stop;
    return value;
  }
  static bool separates(char c) {
    return c == ' ' || c == '\n' || c == '\t' || c == '\r' || c == '\0';
  }
  // Without what a terminal would obey: of ASCII, and a question mark for the rest.
  std::string word(const char* begin) const {
    std::string out;
    for (const char* c = begin; c != end_ && out.size() < 20 && !separates(*c); ++c)
      out += *c > ' ' && *c < 0x7f ? *c : '?';
    return out;
  }

  std::string path_, text_;
  const char *at_ = nullptr, *end_ = nullptr;
};

}  // namespace tether::contact::detail

//
// dimension (2, 3; 5: with rolling), number of contacts, a matrix; then
//   local:  q, mu (, mu_r)         w = M x + q
//   global: H, q, b, mu (, mu_r)   M v = H x + q, w = H'v + b

namespace tether::contact::detail {

namespace {

constexpr long kMost = std::numeric_limits<int>::max();
// The rest of the file bounds the entries that it may claim: the shortest takes two bytes.
void claim(Tokens& in, long count, long each = 1) {
  if (count > in.left() / (2 * each) + 1) in.fail("truncated: the file ends in the matrix");
}

std::vector<MatrixEntry> read_dense(Tokens& in, long rows, long columns) {
  if (in.integer("matrix rows", 0, kMost) != rows ||
      in.integer("matrix columns", 0, kMost) != columns)
    in.fail("matrix sizes do not match");
  if (rows > 0) claim(in, columns, rows);
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
  claim(in, sides[0] + sides[1] + count);
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
        out.push_back({static_cast<int>(r), static_cast<int>(c), in.finite("matrix")});
  }
  return out;
}

/// Triplets or compressed columns as CSparse prints them.
std::vector<MatrixEntry> read_sparse(Tokens& in, long rows, long columns) {
  enum : long { triplets_first = 1, columns_first };
  const long origin =
      in.integer("sparse storage (1: triplets, 2: columns)", triplets_first, columns_first);
  if (in.line("the sparse matrix").rfind("CSparse", 0) != 0)
    in.fail("a line that begins with CSparse is expected in the sparse matrix");
  const std::string head = in.line("the sparse matrix");
  long m = -1, n = -1, most = -1, count = -1;
  const char* form = origin == triplets_first ? "triplet: %9ld-by-%9ld, nzmax: %18ld nnz: %18ld"
                                              : "%9ld-by-%9ld, nzmax: %18ld nnz: %18ld";
  if (std::sscanf(head.c_str(), form, &m, &n, &most, &count) != 4 || m != rows || n != columns ||
      count < 0)
    in.fail("the head of the sparse matrix does not match it");
  claim(in, count);
  std::vector<MatrixEntry> out;
  const auto row = [&] { return static_cast<int>(in.integer("row", 0, rows - 1)); };
  if (origin == triplets_first) {
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

/// Storage type (0 dense, 1 blocks of any sizes, 2 sparse), sizes, and what they say.
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

}  // namespace

FileProblem read_dat(const std::string& path) {
  Tokens in(path);
  FileProblem out;
  out.dimension = static_cast<int>(in.integer("dimension", 2, 5));
  if (out.dimension == 4) in.fail("dimension is 4; 2, 3 or 5 is expected");
  const long n = in.integer("number of contacts", 0, 10'000'000), size = out.dimension * n;
  out.A = read_matrix(in);
  const auto need = [&](const char* what, const FileMatrix& M, long rows, long columns) {
    if (M.rows != rows || M.columns != columns)
      in.fail(std::string(what) + " is " + std::to_string(M.rows) + " x " +
              std::to_string(M.columns) + ", must be " + std::to_string(rows) + " x " +
              std::to_string(columns));
  };
  need("the matrix", out.A, out.A.rows, out.A.rows);
  const long coefficients = out.dimension == 5 ? 2 : 1;
  // Both begin alike; a global file has a matrix more.
  const bool local = out.A.rows == size && in.words_left() <= size + coefficients * n + 1;
  if (!local) {
    const FileMatrix H = read_matrix(in);
    need("H", H, out.A.rows, size);
    out.J = H.transposed();
  }
  const long words = (local ? 0 : out.A.rows) + size + coefficients * n;
  if (in.words_left() < words) in.fail("truncated: the file ends in its vectors");
  const auto vector = [&](const char* what, long count) {
    linalg::VectorX v(count);
    for (long i = 0; i < count; ++i) v[i] = in.finite(what);
    return v;
  };
  if (!local) out.f = vector("q", out.A.rows);
  out.q = vector(local ? "q" : "b", size);
  out.mu = vector("mu", n);
  if (out.dimension == 5) out.rolling = vector("mu_r", n);
  if (!in.empty())
    in.integer("trailing number", std::numeric_limits<int>::min(), std::numeric_limits<int>::max());
  if (!in.empty()) in.fail("oversized: data after the friction coefficients");
  return out;
}

}  // namespace tether::contact::detail

namespace tether::contact {

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
