// Tether: the lines of a certificate. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fstream>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace tether::scene::certificate {

/// A file that cannot be judged: damaged, cut, or with a part missing.
struct Damaged : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A line as docs/certificate.md explains it.
struct Record {
  std::string word, text;
  std::vector<double> numbers;
};

/// Reads a certificate line by line.
class Reader {
 public:
  /// Throws Damaged, as next() does.
  explicit Reader(const std::string& file);
  /// False behind the last line, which says how many there are.
  bool next(Record& out);

 private:
  [[noreturn]] void refuse(const std::string& what) const;

  std::ifstream in_;
  std::vector<char> buffer_;  // of a line
  long line_ = 1;
  bool ended_ = false;
};

}  // namespace tether::scene::certificate
