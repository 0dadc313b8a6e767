// Tether: values of a page: JSON that may stand inside HTML, and numbers in base 64.
// SPDX-License-Identifier: BSD-3-Clause
#include "json.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstring>

namespace tether::scene::player {

namespace {

constexpr std::uint32_t kReplacement = 0xfffd;

/// The next character of UTF-8 text, which is shortened by it; kReplacement for a byte that begins
/// none: cut, overlong, a surrogate or beyond U+10FFFF.
std::uint32_t next_character(std::string_view& text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const std::uint32_t first = byte(0);
  const std::size_t length = first < 0x80             ? 1
                             : (first & 0xe0) == 0xc0 ? 2
                             : (first & 0xf0) == 0xe0 ? 3
                             : (first & 0xf8) == 0xf0 ? 4
                                                      : 0;
  constexpr std::array<std::uint32_t, 5> kLeast = {0, 0, 0x80, 0x800, 0x10000};
  std::uint32_t code = length < 2 ? first : first & (0x7fu >> length);
  bool good = length > 0 && length <= text.size();
  for (std::size_t i = 1; good && i < length; ++i) {
    good = (byte(i) & 0xc0) == 0x80;
    code = code << 6 | (byte(i) & 0x3fu);
  }
  good = good && code >= kLeast[length] && code <= 0x10ffff && (code < 0xd800 || code > 0xdfff);
  text.remove_prefix(good ? length : 1);
  return good ? code : kReplacement;
}

void append_utf8(std::uint32_t code, std::string& out) {
  const auto put = [&](std::uint32_t byte) { out += static_cast<char>(byte); };
  if (code < 0x80) return put(code);
  if (code < 0x800) return put(0xc0 | code >> 6), put(0x80 | (code & 0x3f));
  if (code < 0x10000)
    put(0xe0 | code >> 12);
  else
    put(0xf0 | code >> 18), put(0x80 | (code >> 12 & 0x3f));
  put(0x80 | (code >> 6 & 0x3f)), put(0x80 | (code & 0x3f));
}

template <class Values>
std::string list(const Values& values) {
  std::string out = "[";
  for (const double x : values) out += (out.size() > 1 ? "," : "") + json(x);
  return out + "]";
}

std::string base64(const std::string& bytes) {
  constexpr const char* kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t three = 0;
    for (std::size_t k = i; k < i + 3; ++k)
      three = three << 8 | (k < bytes.size() ? static_cast<unsigned char>(bytes[k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k)
      out += i + k <= bytes.size() ? kDigits[three >> (18 - 6 * k) & 0x3f] : '=';
  }
  return out;
}

template <class Bits, class T>
std::string little_endian(const std::vector<T>& values) {
  static_assert(sizeof(Bits) == sizeof(T));
  std::string bytes;
  bytes.reserve(values.size() * sizeof(T));
  for (const T value : values) {
    Bits bits;
    std::memcpy(&bits, &value, sizeof bits);
    for (std::size_t k = 0; k < sizeof bits; ++k)
      bytes += static_cast<char>(bits >> (8 * k) & 0xff);
  }
  return bytes;
}

}  // namespace

std::string json(std::string_view text) {
  std::string out = "\"";
  while (!text.empty()) {
    const std::uint32_t c = next_character(text);
    const bool control = c < 0x20 || (c >= 0x7f && c < 0xa0) || c == 0x2028 || c == 0x2029;
    if (control || c == '"' || c == '\\' || c == '<' || c == '>' || c == '&' || c == '\'')
      out += fmt::format("\\u{:04x}", c);
    else
      append_utf8(c, out);
  }
  return out + "\"";
}

std::string json(double x) { return std::isfinite(x) ? fmt::format("{:.9g}", x) : "null"; }
std::string json(const Eigen::Vector3d& v) { return list(std::array{v.x(), v.y(), v.z()}); }
std::string json(const Eigen::Quaterniond& q) {
  return list(std::array{q.w(), q.x(), q.y(), q.z()});
}
std::string json(const std::vector<double>& values) { return list(values); }

std::string html(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const std::uint32_t c = next_character(text);
    if (c < 0x20 || (c >= 0x7f && c < 0xa0))
      out += ' ';
    else if (c == '<' || c == '>' || c == '&' || c == '"' || c == '\'')
      out += fmt::format("&#{};", c);
    else
      append_utf8(c, out);
  }
  return out;
}

std::string base64(const std::vector<float>& values) {
  return base64(little_endian<std::uint32_t>(values));
}
std::string base64(const std::vector<std::int16_t>& values) {
  return base64(little_endian<std::uint16_t>(values));
}

}  // namespace tether::scene::player
