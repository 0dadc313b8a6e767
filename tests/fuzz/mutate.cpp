// Tether: mutation of inputs, for compilers without libFuzzer. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
#include <cstring>
#include <limits>

#include "driver.hpp"

namespace tether::fuzz {

namespace {

const std::vector<std::string>& words() {
  static const std::vector<std::string> all = {"nan",
                                               "inf",
                                               "-inf",
                                               "0",
                                               "-0",
                                               "-1",
                                               "1",
                                               "2",
                                               "3",
                                               "0.5",
                                               "1e308",
                                               "-1e308",
                                               "1e-320",
                                               "1e400",
                                               "1e154",
                                               "-1e-200",
                                               "2147483647",
                                               "2147483648",
                                               "-2147483649",
                                               "4294967296",
                                               "9223372036854775807",
                                               "9223372036854775808",
                                               "1e18",
                                               "0x7f",
                                               "1,5",
                                               "+",
                                               "-",
                                               ".",
                                               "e5",
                                               "true",
                                               "\"\"",
                                               "[]",
                                               "{}",
                                               "[[",
                                               "]]",
                                               "=",
                                               "#",
                                               "\n",
                                               "\t",
                                               "'''",
                                               "\"\"\"",
                                               std::string(1, '\0'),
                                               std::string(300, '['),
                                               "\xff\xfe",
                                               "\xc3\x28",
                                               "world",
                                               "[nan, 0, 0]"};
  return all;
}

const std::vector<double>& numbers() {
  constexpr double inf = std::numeric_limits<double>::infinity();
  static const std::vector<double> all = {
      0.0,    -0.0,  1.0, -1.0, 1e308, -1e308,
      1e-320, 1e154, 1e9, inf,  -inf,  std::numeric_limits<double>::quiet_NaN()};
  return all;
}

constexpr const char* kNumber = "0123456789.e-+";

void replace_number(std::string& text, std::size_t at, Random& random) {
  const std::size_t begin = text.find_first_of("0123456789", at);
  if (begin == std::string::npos) return;
  const std::size_t end = std::min(text.find_first_not_of(kNumber, begin), text.size());
  text.replace(begin, end - begin, words()[random.below(words().size())]);
}

void replace_line(std::string& text, std::size_t at, const std::string& with) {
  const std::size_t before = at == 0 ? std::string::npos : text.rfind('\n', at - 1);
  const std::size_t begin = before == std::string::npos ? 0 : before + 1;
  const std::size_t end = std::min(text.find('\n', begin), text.size());
  text.replace(begin, end - begin, with);
}

template <class T>
void write_at(std::string& bytes, std::size_t at, T value) {
  if (bytes.size() < sizeof value) return;
  at = std::min(at / 4 * 4, bytes.size() - sizeof value);
  std::memcpy(&bytes[at], &value, sizeof value);
}

void damage_text(std::string& out, std::size_t at, const std::string& other, Random& random) {
  switch (random.below(5)) {
    case 0:
    case 1:
      return replace_number(out, at, random);
    case 2:
      out.insert(at, words()[random.below(words().size())]);
      return;
    case 3:
      return replace_line(out, at, "");
    default: {
      const std::size_t from = random.below(other.size());
      const std::size_t end = std::min(other.find('\n', from), other.size());
      return replace_line(out, at, other.substr(from, end - from));
    }
  }
}

void damage_numbers(std::string& out, std::size_t at, Random& random) {
  constexpr std::int64_t kCounts[] = {0,
                                      1,
                                      -1,
                                      2,
                                      5,
                                      255,
                                      1 << 20,
                                      0x7fffffff,
                                      -0x7fffffff,
                                      std::numeric_limits<std::int64_t>::max(),
                                      std::numeric_limits<std::int64_t>::min()};
  const std::int64_t count = kCounts[random.below(std::size(kCounts))];
  switch (random.below(3)) {
    case 0:
      return write_at(out, at, numbers()[random.below(numbers().size())]);
    case 1:
      return write_at(out, at, count);
    default:
      return write_at(out, at, static_cast<std::int32_t>(count));
  }
}

}  // namespace

std::string mutated(const std::string& input, const std::string& other, bool text, Random& random) {
  std::string out = input;
  for (std::size_t n = 1 + random.below(4); n > 0; --n) {
    const std::size_t at = random.below(out.size());
    switch (random.below(8)) {
      case 0:
        if (!out.empty()) out[at] = random.byte();
        break;
      case 1:
        if (!out.empty()) out[at] = static_cast<char>(out[at] ^ (1 << random.below(8)));
        break;
      case 2:
        out.erase(at, 1 + random.below(20));
        break;
      case 3:
        if (random.below(4) == 0) out.resize(at);
        break;
      case 4:
        out.insert(at, other.substr(random.below(other.size()), random.below(200)));
        break;
      default:
        if (text)
          damage_text(out, at, other, random);
        else
          damage_numbers(out, at, random);
    }
  }
  return out;
}

}  // namespace tether::fuzz
