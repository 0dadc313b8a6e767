// Tether: the fields of one table of a scene file. SPDX-License-Identifier: BSD-3-Clause
#include "fields.hpp"
#include "bounds.hpp"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <tether/linalg/pi.hpp>

namespace tether::scene::files {

namespace {

constexpr double kDegree = linalg::kPi / 180;
// A unit vector may be off by its rounding; beyond it is normalised.
constexpr double kUnitError = 1e-15;

std::string with_unit(std::string_view words, std::string_view unit) {
  return unit.empty() ? std::string(words) : fmt::format("{}, {}", words, unit);
}

}  // namespace

const Range kAny{-kInfinity, kInfinity, false, "a finite number"};
const Range kPositive{0, kInfinity, true, "a finite number > 0"};
const Range kNotNegative{0, kInfinity, false, "a finite number >= 0"};
const Range kPart{0, 1, false, "a number from 0 to 1"};
const Range kPositivePart{0, 1, true, "a number > 0 and <= 1"};

bool Range::holds(double x) const {
  return std::isfinite(x) && x >= low && x <= high && !(low_excluded && x == low);
}

Fields::Fields(const Value* table, std::string path, const std::string& file, Report& report)
    : table_(table), path_(std::move(path)), place_{file, 0, 0}, report_(report) {
  if (table_ != nullptr) place_ = {file, table_->line, table_->column};
}

const Entry* Fields::entry(std::string_view key) {
  if (!contains(known_, key)) known_.emplace_back(key);
  if (table_ == nullptr) return nullptr;
  for (const Entry& each : table_->entries())
    if (each.key == key) return &each;
  return nullptr;
}

const Value* Fields::find(std::string_view key) {
  const Entry* found = entry(key);
  return found != nullptr ? &found->value : nullptr;
}

Place Fields::place(std::string_view key) {
  const Entry* found = entry(key);
  return found != nullptr ? Place{place_.file, found->line, found->column} : place_;
}

std::string Fields::field(std::string_view key) const {
  if (path_.empty()) return std::string(key);
  return fmt::format("{}: {}", path_, key);
}

void Fields::wrong(const Entry& which, const Value& value, std::string allowed) {
  Place at{place_.file, which.line, which.column};
  if (value.line > 0) at.line = value.line, at.column = value.column;
  report_.add(at, field(which.key), shown(value), std::move(allowed));
}

void Fields::wrong(std::string_view key, std::string allowed) {
  if (const Entry* found = entry(key))
    wrong(*found, found->value, std::move(allowed));
  else
    missing(key, std::move(allowed));
}

void Fields::missing(std::string_view key, std::string allowed) {
  entry(key);
  report_.add(place_, field(key), "", "is missing; " + std::move(allowed));
}

double Fields::number(std::string_view key, double otherwise, const Range& range,
                      std::string_view unit) {
  const Entry* found = entry(key);
  if (found == nullptr) return otherwise;
  const Value& value = found->value;
  if (value.kind() == Value::Kind::number && range.holds(value.number())) return value.number();
  wrong(*found, value, "must be " + with_unit(range.words, unit));
  return otherwise;
}

int Fields::count(std::string_view key, int otherwise, int low, int high) {
  const Entry* found = entry(key);
  if (found == nullptr) return otherwise;
  const Value& value = found->value;
  if (value.kind() == Value::Kind::number && value.whole() && value.number() >= low &&
      value.number() <= high)
    return static_cast<int>(value.number());
  wrong(*found, value, fmt::format("must be a whole number from {} to {}", low, high));
  return otherwise;
}

bool Fields::flag(std::string_view key, bool otherwise) {
  const Entry* found = entry(key);
  if (found == nullptr) return otherwise;
  if (found->value.kind() == Value::Kind::boolean) return found->value.boolean();
  wrong(*found, found->value, "must be true or false");
  return otherwise;
}

std::string Fields::text(std::string_view key, const std::string& otherwise) {
  return text(key, otherwise, is_plain, kPlain);
}

std::string Fields::name(std::string_view key, const std::string& otherwise) {
  return text(key, otherwise, is_name, kName);
}

std::string Fields::text(std::string_view key, const std::string& otherwise,
                         bool (*is_good)(std::string_view), const char* good) {
  const Entry* found = entry(key);
  if (found == nullptr) return otherwise;
  if (found->value.kind() != Value::Kind::text) {
    wrong(*found, found->value, "must be a text in quotes");
    return otherwise;
  }
  if (is_good(found->value.text())) return found->value.text();
  wrong(*found, found->value, good);
  return otherwise;
}

// A scene from an untrusted source must not write elsewhere, nor what other programs look for by
// its name: files that begin with a dot, or have no ending, are settings and programs.
std::string Fields::output_name(std::string_view key, std::string_view ending) {
  const std::string file = name(key, "");
  const std::filesystem::path path(file);
  bool hidden = false;
  for (const auto& part : path) hidden = hidden || (part != "." && part.string()[0] == '.');
  if (file.empty() || (!hidden && path.extension() == ending)) return inside(key, file, "output");
  wrong(key, fmt::format("must be the name of a file that ends in {}, in the folder of the output: "
                         "no part of it begins with a dot",
                         ending));
  return "";
}

std::string Fields::input_name(std::string_view key) { return inside(key, text(key, ""), "scene"); }

// No way out of the folder, no pipe of a program that takes names for commands.
std::string Fields::inside(std::string_view key, const std::string& file, const char* whose) {
  if (file.empty()) return "";
  const std::filesystem::path path(file);
  const bool out = path.is_absolute() || contains(path, "..");
  bool odd = file.find_first_of("|<>\\*?:`$;&!") != std::string::npos || file.size() >= 200;
  for (const auto& part : path) {
    const std::string name = part.string();
    odd = odd || name.empty() || std::string_view("-~ ").find(name[0]) != std::string_view::npos ||
          name.back() == ' ';
  }
  if (!out && !odd && path.has_filename() && path.filename() != ".") return file;
  wrong(
      key,
      out ? fmt::format("must stay in the folder of the {}: a relative name without \"..\"", whose)
          : "must be the name of a file, of less than 200 characters, without | < > \\ * ? : ` "
            "$ ; & !, no part of which begins with - or ~ or a blank");
  return "";
}

std::vector<double> Fields::numbers(std::string_view key, const std::vector<std::size_t>& lengths,
                                    std::string_view unit) {
  const Entry* found = entry(key);
  if (found == nullptr) return {};
  const Value& value = found->value;
  std::vector<double> out;
  bool right = value.kind() == Value::Kind::array && contains(lengths, value.items().size());
  if (right)
    for (const Value& item : value.items()) {
      right = right && item.kind() == Value::Kind::number && kAny.holds(item.number());
      out.push_back(item.number());
    }
  if (right) return out;
  wrong(*found, value,
        "must be " +
            with_unit(fmt::format("an array of {} finite numbers", fmt::join(lengths, " or ")),
                      unit));
  return {};
}

Eigen::Vector3d Fields::vector(std::string_view key, const Eigen::Vector3d& otherwise,
                               const Range& range, std::string_view unit) {
  const Entry* found = entry(key);
  if (found == nullptr) return otherwise;
  const std::vector<double> x = numbers(key, {3}, unit);
  if (x.empty()) return otherwise;
  for (const double each : x)
    if (!range.holds(each)) {
      wrong(*found, found->value, "each must be " + with_unit(range.words, unit));
      return otherwise;
    }
  return {x[0], x[1], x[2]};
}

Eigen::Vector3d Fields::direction(std::string_view key, const Eigen::Vector3d& otherwise) {
  const Entry* found = entry(key);
  const Eigen::Vector3d v = vector(key, otherwise, kAny, "");
  const double length = v.stableNorm();
  if (!(length > 0) || !std::isfinite(length)) {
    if (found != nullptr) wrong(*found, found->value, "must not be zero: it is a direction");
    return otherwise;
  }
  // A normalised value is kept, so that a scene written and read again is the same.
  if (std::abs(length - 1) <= kUnitError) return v;
  const Eigen::Vector3d unit = (v / v.lpNorm<Eigen::Infinity>()).normalized();
  return std::abs(unit.stableNorm() - 1) <= kUnitError ? unit : unit.normalized();
}

std::vector<Eigen::Vector3d> Fields::points(std::string_view key, std::size_t least,
                                            std::size_t most) {
  const Entry* found = entry(key);
  if (found == nullptr) return {};
  const Value& value = found->value;
  bool right = value.kind() == Value::Kind::array && value.items().size() >= least &&
               value.items().size() <= most;
  std::vector<Eigen::Vector3d> out;
  if (right)
    for (const Value& item : value.items()) {
      right = right && item.kind() == Value::Kind::array && item.items().size() == 3;
      if (!right) break;
      Eigen::Vector3d p;
      for (int i = 0; i < 3; ++i) {
        const Value& x = item.items()[static_cast<std::size_t>(i)];
        right = right && x.kind() == Value::Kind::number && kAny.holds(x.number());
        p[i] = x.number();
      }
      out.push_back(p);
    }
  if (right) return out;
  const std::string number =
      least == most ? fmt::format("{}", least) : fmt::format("{} to {}", least, most);
  wrong(*found, value, fmt::format("must be an array of {} points [x, y, z], m", number));
  return {};
}

std::vector<std::array<double, 2>> Fields::pairs(std::string_view key, std::size_t most) {
  const Value* value = find(key);
  if (value == nullptr || value->items().size() > most) return {};
  std::vector<std::array<double, 2>> out;
  for (const Value& row : value->items()) {
    if (row.items().size() != 2) return {};
    for (const Value& x : row.items())
      if (x.kind() != Value::Kind::number || !kAny.holds(x.number())) return {};
    out.push_back({row.items()[0].number(), row.items()[1].number()});
  }
  return out;
}

double Fields::angle(const std::string& stem, double otherwise, std::string_view unit_end) {
  const std::string deg = stem + "deg", rad = stem + "rad";
  const Entry* in_deg = entry(deg);
  const Entry* in_rad = entry(rad);
  if (in_deg != nullptr && in_rad != nullptr) {
    wrong(*in_deg, in_deg->value, fmt::format("give {} or {}, not both", deg, rad));
    return otherwise;
  }
  if (in_deg != nullptr)
    return number(deg, otherwise / kDegree, kAny, fmt::format("degrees{}", unit_end)) * kDegree;
  return number(rad, otherwise, kAny, fmt::format("rad{}", unit_end));
}

int Fields::choice(std::string_view key, const std::vector<std::string>& words) {
  const Entry* found = entry(key);
  if (found == nullptr) return -1;
  const Value& value = found->value;
  if (value.kind() == Value::Kind::text) {
    const auto at = std::find(words.begin(), words.end(), value.text());
    if (at != words.end()) return static_cast<int>(at - words.begin());
  }
  const std::string near = value.kind() == Value::Kind::text ? nearest(value.text(), words) : "";
  wrong(*found, value,
        "must be one of " + list(words) +
            (near.empty() ? "" : fmt::format("; did you mean \"{}\"?", near)));
  return -1;
}

const Value* Fields::table(std::string_view key) {
  const Entry* found = entry(key);
  if (found == nullptr) return nullptr;
  if (found->value.kind() == Value::Kind::table) return &found->value;
  wrong(*found, found->value, fmt::format("must be a table: [{}]", key));
  return nullptr;
}

std::vector<const Value*> Fields::tables(std::string_view key) {
  const Entry* found = entry(key);
  if (found == nullptr) return {};
  std::vector<const Value*> out;
  if (found->value.kind() != Value::Kind::array) {
    wrong(*found, found->value, fmt::format("must be an array of tables: [[{}]]", key));
    return {};
  }
  for (const Value& item : found->value.items()) {
    if (item.kind() == Value::Kind::table)
      out.push_back(&item);
    else
      wrong(*found, item, fmt::format("must be a table: [[{}]]", key));
  }
  return out;
}

void Fields::finish() {
  if (table_ == nullptr) return;
  for (const Entry& each : table_->entries()) {
    if (contains(known_, each.key)) continue;
    report_.add({place_.file, each.line, each.column}, field(each.key), shown(each.value),
                "unknown key" + (report_.full() ? "" : hint(each.key, known_)));
  }
}

using Eigen::Vector3d;

int Reader::body(Fields& in, std::string_view key) const {
  if (!in.has(key)) {
    in.missing(key, "the name of a body");
    return 0;
  }
  const std::string name = in.name(key, "");
  const auto found = bodies.find(name);
  if (found != bodies.end()) return found->second;
  in.wrong(key, "no such body" + hint_of(name, scene.bodies));
  return 0;
}

std::vector<int> Reader::several_bodies(Fields& in, std::size_t least, std::size_t most,
                                        const char* allowed) const {
  const Value* value = in.find("bodies");
  if (value == nullptr) {
    in.missing("bodies", allowed);
    return {};
  }
  const auto wrong = [&](std::string why) {
    in.wrong("bodies", std::move(why));
    return std::vector<int>{};
  };
  if (value->kind() != Value::Kind::array || value->items().size() < least ||
      value->items().size() > most)
    return wrong(std::string("must be ") + allowed);
  std::vector<int> out;
  for (const Value& name : value->items()) {
    if (name.kind() != Value::Kind::text) return wrong(std::string("must be ") + allowed);
    const auto found = bodies.find(name.text());
    if (name.text() != "world" && found == bodies.end())
      return wrong(fmt::format("there is no body \"{}\"{}", name.text(),
                               hint_of(name.text(), scene.bodies)));
    out.push_back(name.text() == "world" ? -1 : found->second);
  }
  return out;
}

void Reader::two_bodies(Fields& in, int& first, int& second) const {
  const std::vector<int> both =
      several_bodies(in, 2, 2, "two names of bodies; \"world\" is the ground");
  if (both.empty()) return;
  first = both[0];
  second = both[1];
  if (first == second) in.wrong("bodies", "must be two different bodies");
}

std::string read_name(Fields& in, const std::string& kind) {
  const std::string name = in.name("name", in.path());
  if (in.has("name")) in.rename(fmt::format("{} \"{}\"", kind, name));
  return name;
}

void read_two_points(Fields& in, Vector3d& first, Vector3d& second) {
  if (!in.has("at")) in.missing("at", "the two points [[x, y, z], [x, y, z]], world, m");
  const std::vector<Vector3d> points = in.points("at", 2, 2);
  if (points.empty()) return;
  first = points[0];
  second = points[1];
}

}  // namespace tether::scene::files
