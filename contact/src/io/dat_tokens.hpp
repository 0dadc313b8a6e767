// Tether: the words of a text file of numbers. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <locale>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

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
