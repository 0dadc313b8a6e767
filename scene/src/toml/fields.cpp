// Tether: the fields of one table of a scene file. SPDX-License-Identifier: BSD-3-Clause
#include "fields.hpp"
#include "bounds.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <tether/linalg/pi.hpp>

namespace tether::scene::files {

namespace {

constexpr double kDegree = linalg::kPi / 180;
// A unit vector may be off by its rounding; beyond it is normalised.
constexpr double kUnitError = 1e-15;
constexpr double kAboveZero = std::numeric_limits<double>::denorm_min();

std::string with_unit(std::string_view words, std::string_view unit) {
  return unit.empty() ? std::string(words) : fmt::format("{}, {}", words, unit);
}

}  // namespace

const Range kAny{-kInfinity, kInfinity, "a finite number"};
const Range kPositive{kAboveZero, kInfinity, "a finite number > 0"};
const Range kNotNegative{0, kInfinity, "a finite number >= 0"};
const Range kPart{0, 1, "a number from 0 to 1"};
const Range kPositivePart{kAboveZero, 1, "a number > 0 and <= 1"};

bool Range::holds(double x) const { return std::isfinite(x) && x >= low && x <= high; }

void Fields::wrong(const Entry& which, const Value& value, std::string allowed) {
  Place at{place_.file, which.line, which.column};
  if (value.line > 0) at.line = value.line, at.column = value.column;
  report_.add(at, field(which.key), shown(value), std::move(allowed));
}

double Fields::number(std::string_view key, double otherwise, const Range& range,
                      std::string_view unit) {
  return value(
      key, otherwise,
      [&](const Value& v) {
        const bool right = v.kind() == Value::Kind::number && range.holds(v.number());
        return right ? std::optional(v.number()) : std::nullopt;
      },
      [&] { return "must be " + with_unit(range.words, unit); });
}

int Fields::count(std::string_view key, int otherwise, int low, int high) {
  return value(
      key, otherwise,
      [&](const Value& v) {
        const bool right =
            v.kind() == Value::Kind::number && v.whole() && v.number() >= low && v.number() <= high;
        return right ? std::optional(static_cast<int>(v.number())) : std::nullopt;
      },
      [&] { return fmt::format("must be a whole number from {} to {}", low, high); });
}

std::string Fields::text(std::string_view key, const std::string& otherwise,
                         bool (*is_good)(std::string_view), const char* good) {
  bool is_text = false;
  return value(
      key, otherwise,
      [&](const Value& v) {
        is_text = v.kind() == Value::Kind::text;
        return is_text && is_good(v.text()) ? std::optional(v.text()) : std::nullopt;
      },
      [&] { return is_text ? good : "must be a text in quotes"; });
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
  return value(
      key, std::vector<double>(),
      [&](const Value& v) -> std::optional<std::vector<double>> {
        if (!contains(lengths, v.items().size()) || !is_numbers(v, v.items().size())) return {};
        std::vector<double> out;
        for (const Value& item : v.items()) out.push_back(item.number());
        return out;
      },
      [&] {
        const auto words = fmt::format("an array of {} finite numbers", fmt::join(lengths, " or "));
        return "must be " + with_unit(words, unit);
      });
}

Eigen::Vector3d Fields::vector(std::string_view key, const Eigen::Vector3d& otherwise,
                               const Range& range, std::string_view unit) {
  const std::vector<double> x = numbers(key, {3}, unit);
  if (x.empty()) return otherwise;
  if (all_of(x, [&](double each) { return range.holds(each); })) return {x[0], x[1], x[2]};
  wrong(key, "each must be " + with_unit(range.words, unit));
  return otherwise;
}

Eigen::Vector3d Fields::direction(std::string_view key, const Eigen::Vector3d& otherwise) {
  const Eigen::Vector3d v = vector(key, otherwise, kAny, "");
  const double length = v.stableNorm();
  if (!(length > 0) || !std::isfinite(length)) {
    if (has(key)) wrong(key, "must not be zero: it is a direction");
    return otherwise;
  }
  // A normalised value is kept, so that a scene written and read again is the same.
  if (std::abs(length - 1) <= kUnitError) return v;
  const Eigen::Vector3d unit = (v / v.lpNorm<Eigen::Infinity>()).normalized();
  return std::abs(unit.stableNorm() - 1) <= kUnitError ? unit : unit.normalized();
}

std::vector<Eigen::Vector3d> Fields::points(std::string_view key, std::size_t least,
                                            std::size_t most) {
  return value(
      key, std::vector<Eigen::Vector3d>(),
      [&](const Value& v) {
        std::optional<std::vector<Eigen::Vector3d>> out(std::in_place);
        if (!each_row(v, least, most, 3, [&](const Value::Items& p) {
              out->emplace_back(p[0].number(), p[1].number(), p[2].number());
            }))
          out.reset();
        return out;
      },
      [&] {
        return fmt::format("must be an array of {}{} points [x, y, z], m", least,
                           least == most ? "" : fmt::format(" to {}", most));
      });
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
  std::string near;
  return value(
      key, -1,
      [&](const Value& v) -> std::optional<int> {
        if (v.kind() != Value::Kind::text) return {};
        const auto at = std::find(words.begin(), words.end(), v.text());
        if (at != words.end()) return static_cast<int>(at - words.begin());
        near = nearest(v.text(), words);
        return {};
      },
      [&] {
        return "must be one of " + list(words) +
               (near.empty() ? "" : fmt::format("; did you mean \"{}\"?", near));
      });
}

std::vector<const Value*> Fields::tables(std::string_view key) {
  const Entry* found = entry(key);
  std::vector<const Value*> out;
  if (found == nullptr) return out;
  if (found->value.kind() != Value::Kind::array)
    wrong(*found, found->value, fmt::format("must be an array of tables: [[{}]]", key));
  for (const Value& item : found->value.items())
    if (item.kind() == Value::Kind::table)
      out.push_back(&item);
    else
      wrong(*found, item, fmt::format("must be a table: [[{}]]", key));
  return out;
}

}  // namespace tether::scene::files
