// Tether: values of a page: JSON that may stand inside HTML, and numbers in base 64.
// SPDX-License-Identifier: BSD-3-Clause
#include "page_text.hpp"

#include <cstring>
#include <nlohmann/json.hpp>

#include "output/files.hpp"
#include "picture/canvas.hpp"

namespace tether::scene::player {

namespace {

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

// Outside of strings JSON has none of these characters, and in them each may be written by its
// code.
std::string script_text(const nlohmann::json& value) {
  constexpr std::string_view kHtml = "<>&'";
  constexpr const char* kCodes[] = {"\\u003c", "\\u003e", "\\u0026", "\\u0027"};
  std::string out;
  for (const char c : value.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace)) {
    const std::size_t at = kHtml.find(c);
    if (at == std::string_view::npos)
      out += c;
    else
      out += kCodes[at];
  }
  return out;
}

std::string page_head(const std::string& title, std::string_view style) {
  std::string out =
      "<!DOCTYPE html>\n" + std::string(kMarkup) +
      "<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src "
      "'unsafe-inline'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>" +
      picture::markup_text(title) + "</title>\n<style>\n";
  out += style;
  return out + "</style>\n</head>\n<body>\n";
}

std::string base64(const std::vector<float>& values) {
  return base64(little_endian<std::uint32_t>(values));
}
std::string base64(const std::vector<std::int16_t>& values) {
  return base64(little_endian<std::uint16_t>(values));
}

}  // namespace tether::scene::player
