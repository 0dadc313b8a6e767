// Tether: what a certificate tells: lines, bodies, rows of joints. SPDX-License-Identifier:
// BSD-3-Clause
#include "told.hpp"

#include <fmt/format.h>

#include <charconv>
#include <sstream>
#include <tether/linalg/pi.hpp>

#include "output/files.hpp"

namespace tether::scene::certificate {

const char* const kForms =
    "form body k mass ix:3 iy:3 iz:3 x:3 q:4 material surface:3 surface_spin:3 axis:3 text\n"
    "form pair first second along across static restitution rolling torsional\n"
    "form engine gravity:3 accuracy text\n"
    "form row k first second on:3 on_2:3 axis:3 length motion:4 text\n"
    "form step k start end residual solved\n"
    "form part start dt composed residual\n"
    "form reached start\n"
    "form instant start events\n"
    "form push k force:3 moment:3 text\n"
    "form pull row x\n"
    "form law k low high wanted compliance gap restitution x text\n"
    "form on law k force:3 moment:3\n"
    "form contact first second on:3 on_2:3 n:3 gap bias slip:3 x:3 moment:3\n"
    "form placed k x:3 q:4\n"
    "form rate k a:3 alpha:3\n"
    "form to k x:3 q:4 v:3 w:3\n"
    "form end lines\n";

namespace {

constexpr std::size_t kLongest = std::size_t{1} << 16;  // bytes of a line

struct Form {
  std::size_t numbers = 0;
  bool text = false;
};

std::map<std::string, Form> read_forms() {
  std::map<std::string, Form> out;
  std::istringstream lines(kForms);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream fields(line);
    std::string form, word;
    fields >> form >> word;
    for (std::string field; fields >> field;) {
      const std::size_t colon = field.find(':');
      if (field == "text")
        out[word].text = true;
      else
        out[word].numbers += colon == std::string::npos ? 1 : std::stoul(field.substr(colon + 1));
    }
  }
  return out;
}

}  // namespace

void Reader::refuse(const std::string& what) const {
  throw Damaged(fmt::format("line {}: {}", line_, what));
}

Reader::Reader(const std::string& file) : in_(file, std::ios::binary), buffer_(kLongest + 2) {
  if (!in_.is_open()) throw Damaged("there is no such file, or it may not be read");
  std::istringstream head(std::string(kCertificateHead) + "1\n" + kForms);
  for (std::string each; std::getline(head, each);)
    if (next_line() != each) refuse("it is no certificate of format 1");
}

bool Reader::next(Record& out) {
  static const std::map<std::string, Form> forms = read_forms();
  const std::string_view line = next_line();
  if (line.data() == nullptr) {
    if (!ended_) refuse("the end is missing: the file was cut");
    return false;
  }
  if (ended_) refuse("it goes on behind its end");
  const std::size_t blank = std::min(line.find(' '), line.size());
  out.word = line.substr(0, blank);
  const auto form = forms.find(out.word);
  if (form == forms.end()) refuse("its first word is none of a certificate");
  out.numbers.clear();
  out.text.clear();
  const char *at = line.data() + blank, *end = line.data() + line.size();
  while (at < end && out.numbers.size() < form->second.numbers) {
    double x = 0;
    const auto [behind, error] = std::from_chars(at + 1, end, x);
    if (error != std::errc() || (behind < end && *behind != ' ') || !std::isfinite(x))
      refuse(fmt::format("number {} of {} is none", out.numbers.size() + 1, out.word));
    out.numbers.push_back(x);
    at = behind;
  }
  if (at < end && form->second.text) out.text.assign(at + 1, end);
  if (out.numbers.size() < form->second.numbers || (at < end && !form->second.text))
    refuse(fmt::format("{} has {} numbers", out.word, form->second.numbers));
  ended_ = out.word == "end";
  if (ended_ && out[0] != static_cast<double>(line_ - 1))
    refuse(fmt::format("{} lines should come before it: a part is missing", out[0]));
  return true;
}

ToldBody::ToldBody(const Record& n)
    : mass(n[1]),
      light(mass > 0 ? 1 / mass : 0),
      material(n[18]),
      inverse(Eigen::Matrix3d::Zero()),
      surface(n.vector(19)),
      surface_spin(n.vector(22)),
      axis(n.vector(25)),
      name(n.text) {
  inertia << n.vector(2), n.vector(5), n.vector(8);
  if (!(mass >= 0) || (mass > 0 && !(inertia.determinant() > 0)))
    throw Damaged("body " + name + " has no mass or inertia that moves");
  if (mass > 0) inverse = inertia.inverse();
  radius = std::sqrt(inertia.trace() * light);
}

ToldRow::ToldRow(const Record& n)
    : first(n[1]),
      second(n[2]),
      name(n.text),
      kind_(n.text.substr(0, n.text.find(' '))),
      on_(n.vector(3)),
      on_second_(n.vector(6)),
      axis_(n.vector(9)),
      length_(n[12]),
      motion_{n[13], n[14], n[15], n[16]} {}

double ToldRow::frequency() const { return 2 * linalg::kPi * std::abs(motion_[2]); }

ToldRow::Value ToldRow::value(const State& a, const State& b, double time) const {
  const auto [rate, amplitude, frequency, phase] = motion_;
  const double turned = 2 * linalg::kPi * frequency * time + phase;
  const double way = rate * time + amplitude * (std::sin(turned) - std::sin(phase));
  const Vector3d zero = Vector3d::Zero();
  const Vector3d axis = kind_ == "point" ? axis_ : b.q * axis_;
  if (kind_ == "angle") {  // of a direction of each; a motion turns the second one about the axis
    const Vector3d u = a.q * on_, v = b.q * (rotation(way * axis_) * on_second_);
    return {u.dot(v), zero, u.cross(v), a.x};
  }
  if (kind_ == "turn") return {0, zero, axis, a.x};
  const Vector3d p = a.x + a.q * on_, d = p - b.x - b.q * on_second_;
  if (kind_ == "distance") return {d.norm() - length_ - way, d / length_, zero, p};
  return {kind_ == "way" ? 0 : axis.dot(d) - way, axis, zero, p};
}

}  // namespace tether::scene::certificate
