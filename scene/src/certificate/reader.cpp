// Tether: the lines of a certificate. SPDX-License-Identifier: BSD-3-Clause
#include "reader.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "output/files.hpp"

namespace tether::scene::certificate {

namespace {

constexpr std::size_t kLongest = std::size_t{1} << 16;  // bytes of a line

// Numbers of a line; "+": or more; "t": then a text.
const std::map<std::string, std::string>& forms() {
  static const std::map<std::string, std::string> all = {
      {"body", "9t"},   {"surface", "10"}, {"pair", "7"},         {"gravity", "3"},
      {"engine", "0t"}, {"joint", "23t"},  {"coupled", "3+"},     {"step", "5"},
      {"part", "4"},    {"trial", "4"},    {"extrapolated", "1"}, {"start", "1"},
      {"instant", "2"}, {"arrives", "1"},  {"push", "7t"},        {"contact", "22"},
      {"pull", "14"},   {"law", "10+"},    {"placed", "8"},       {"to", "14"},
      {"rate", "7"},    {"end", "1"}};
  return all;
}

}  // namespace

void Reader::refuse(const std::string& what) const {
  throw Damaged(fmt::format("line {}: {}", line_, what));
}

Reader::Reader(const std::string& file) : in_(file, std::ios::binary), buffer_(kLongest + 2) {
  if (!in_.is_open()) throw Damaged("there is no such file, or it may not be read");
  std::string head(std::string_view(kCertificateHead).size() + 2, '\0');
  in_.read(head.data(), static_cast<std::streamsize>(head.size()));
  if (!in_ || head != std::string(kCertificateHead) + "1\n")
    refuse("it is no certificate of format 1");
}

bool Reader::next(Record& out) {
  ++line_;
  in_.getline(buffer_.data(), static_cast<std::streamsize>(buffer_.size()));
  if (in_.gcount() == 0) {
    if (!ended_) refuse("the end is missing: the file was cut");
    return false;
  }
  if (ended_) refuse("it goes on behind its end");
  if (!in_ || in_.eof()) refuse("it is cut, or longer than any");
  const std::string_view line(buffer_.data(), static_cast<std::size_t>(in_.gcount()) - 1);
  const std::size_t blank = std::min(line.find(' '), line.size());
  out.word = line.substr(0, blank);
  const auto form = forms().find(out.word);
  if (form == forms().end()) refuse("its first word is none of a certificate");
  const std::size_t least = std::stoul(form->second);
  const bool more = form->second.back() == '+', text = form->second.back() == 't';
  out.numbers.clear();
  out.text.clear();
  const char *at = line.data() + blank, *end = line.data() + line.size();
  while (at < end && (more || out.numbers.size() < least)) {
    double x = 0;
    const auto [behind, error] = std::from_chars(at + 1, end, x);
    // Bounds of laws may be infinite; they are the sixth number.
    const bool bound = out.word == "law" && out.numbers.size() == 5 && !std::isnan(x);
    if (error != std::errc() || (behind < end && *behind != ' ') || !(std::isfinite(x) || bound))
      refuse(fmt::format("number {} of {} is none", out.numbers.size() + 1, out.word));
    out.numbers.push_back(x);
    at = behind;
  }
  if (at < end && text) out.text.assign(at + 1, end);
  if (out.numbers.size() < least || (at < end && !text))
    refuse(fmt::format("{} has {} numbers", out.word, least));
  ended_ = out.word == "end";
  if (ended_ && out.numbers[0] != static_cast<double>(line_ - 1))
    refuse(fmt::format("{} lines should come before it: a part is missing", out.numbers[0]));
  return true;
}

}  // namespace tether::scene::certificate
