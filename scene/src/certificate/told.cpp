// Tether: what a certificate tells: lines, joints. SPDX-License-Identifier: BSD-3-Clause
#include "told.hpp"

#include <fmt/format.h>

#include <charconv>
#include <tuple>

#include "output/files.hpp"

namespace tether::scene::certificate {

namespace {

constexpr std::size_t kLongest = std::size_t{1} << 16;  // bytes of a line

// Numbers of a line; "+": or more; "t": then a text.
const std::map<std::string, std::string> kForms = {
    {"body", "9t"},        {"surface", "10"}, {"pair", "7"},    {"gravity", "3"}, {"engine", "0t"},
    {"joint", "23t"},      {"coupled", "3+"}, {"step", "5"},    {"part", "4"},    {"trial", "4"},
    {"extrapolated", "1"}, {"start", "1"},    {"instant", "2"}, {"arrives", "1"}, {"push", "7t"},
    {"contact", "22"},     {"pull", "14"},    {"law", "10+"},   {"placed", "8"},  {"to", "14"},
    {"rate", "7"},         {"end", "1"}};

// Directions in which points, and turns, are held. d: from point to point; u: across both axes.
const std::map<std::string, std::pair<const char*, const char*>> kHeld = {
    {"ball", {"xyz", ""}},     {"hinge", {"xyz", "xy"}}, {"slider", {"xy", "xyz"}},
    {"fixed", {"xyz", "xyz"}}, {"planar", {"z", "xy"}},  {"universal", {"xyz", "u"}},
    {"distance", {"d", ""}}};

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
  const auto form = kForms.find(out.word);
  if (form == kForms.end()) refuse("its first word is none of a certificate");
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

ToldJoint::ToldJoint(const Record& line) : name(line.text) {
  const Numbers& n = line.numbers;
  kind = name.substr(0, name.find(' '));
  name.erase(0, std::min(name.size(), kind.size() + 1));
  for (std::size_t k = 0; k < 2; ++k)
    body[k] = n[1 + k], point_[k] = vector(n, 3 + 7 * k), frame_[k] = quaternion(n, 6 + 7 * k);
  length_ = n[17], driven_ = n[18] == 1, has_laws = n[18] == 2;
  std::copy_n(n.begin() + 19, 4, motion_);
  const auto found = kHeld.find(kind);
  if (found == kHeld.end()) throw Damaged("joint of a kind \"" + kind + "\"");
  std::tie(held_, turns_) = found->second;
  if (driven_ && kind == "slider") held_ += 'z';
  if (driven_ && kind == "hinge") turns_ += 'z';
}

ToldJoint::Place ToldJoint::place(const Told (&s)[2]) const {
  const Quaterniond first = s[0].q * frame_[0], second = s[1].q * frame_[1];
  Place p;
  p.at = s[0].x + s[0].q * point_[0];
  p.d = p.at - s[1].x - s[1].q * point_[1];
  p.turn = second.conjugate() * first;
  const auto direction = [&](char c) -> Vector3d {
    if (c == 'd') return p.d / std::max(p.d.norm(), 1e-300);
    if (c == 'u') return (first * Vector3d::UnitZ()).cross(second * Vector3d::UnitX());
    return second * Vector3d::Unit(c - 'x');
  };
  for (const char c : held_) p.held.push_back(direction(c));
  for (const char c : turns_) p.turns.push_back(direction(c));
  p.z = direction('z');
  return p;
}

std::array<Numbers, 3> ToldJoint::errors(const Told (&s)[2], double t) const {
  Place p = place(s);
  const Vector3d u = s[0].velocity(p.at - s[0].x) - s[1].velocity(p.at - s[1].x);
  Numbers off, slips, spins;
  for (const Vector3d& k : p.held) off.push_back(k.dot(p.d)), slips.push_back(k.dot(u));
  for (const Vector3d& k : p.turns) spins.push_back(k.dot(s[0].w - s[1].w));
  if (kind == "distance") off[0] -= length_;
  if (driven_) {
    const auto [rate, amplitude, frequency, phase] = motion_;
    const double w = 2 * linalg::kPi * frequency;
    const double way = rate * t + amplitude * (std::sin(w * t + phase) - std::sin(phase));
    const double fast = rate + amplitude * w * std::cos(w * t + phase);
    if (kind == "hinge")
      p.turn = rotation({0, 0, -way}) * p.turn, spins.back() -= fast;
    else
      off.back() -= way, slips.back() -= fast;
  }
  const Vector3d z = p.turn * Vector3d::UnitZ(), twice = 2 * p.turn.vec();
  if (turns_ == "u") off.push_back(z.x());
  if (turns_ == "xy") off.insert(off.end(), {z.x(), z.y()});
  if (turns_ == "xyz") off.insert(off.end(), {twice.x(), twice.y(), twice.z()});
  return {off, slips, spins};
}

std::array<double, 2> ToldJoint::accelerations(const Told (&s)[2],
                                               const std::array<Vector3d, 2> (&rates)[2],
                                               double t) const {
  const double fast = std::max(s[0].w.norm(), s[1].w.norm());
  const double h = 1e-3 / (1 + fast + 2 * linalg::kPi * std::abs(motion_[2]));
  const auto after = [&](double k) {
    Told moved[2];
    for (int i = 0; i < 2; ++i)
      moved[i] = {s[i].x + k * s[i].v, s[i].v + k * rates[i][0], s[i].w + k * rates[i][1],
                  rotation(k * s[i].w) * s[i].q};
    return errors(moved, t + k);
  };
  const std::array<Numbers, 3> ahead = after(h), behind = after(-h);
  std::array<double, 2> out{};
  for (std::size_t i = 0; i < 2; ++i)
    for (std::size_t k = 0; k < ahead[i + 1].size(); ++k)
      out[i] = std::max(out[i], std::abs(ahead[i + 1][k] - behind[i + 1][k]) / (2 * h));
  return out;
}

}  // namespace tether::scene::certificate
