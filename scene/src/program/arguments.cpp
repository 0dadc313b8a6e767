// Tether: numbers of the command line. SPDX-License-Identifier: BSD-3-Clause
#include "commands.hpp"

#include <cstdio>
#include <fstream>
#include <iostream>

#include "files/read.hpp"

namespace tether::scene {

namespace {

constexpr double kMostSettings = 1000;

std::optional<double> positive(const std::string& text) {
  const std::optional<double> value = finite_number(text);
  return value && *value > 0 ? value : std::nullopt;
}

std::string all_of(std::istream& in) { return files::read_stream(in, kLargestScene); }

[[noreturn]] void refuse(const std::string& word, const std::string& why) {
  throw std::invalid_argument(fmt::format("--vary {}: {}", word, why));
}

std::vector<double> range(const std::string& word, const std::vector<std::string>& parts) {
  const bool logarithmic = parts.size() == 4 && parts[3] == "log";
  const std::optional<double> from = finite_number(parts[0]), to = finite_number(parts[1]),
                              count = finite_number(parts[2]);
  if ((parts.size() == 4 && !logarithmic) || !from || !to || !count)
    refuse(word, "a range is FROM:TO:COUNT or FROM:TO:COUNT:log, e.g. 0.1:0.5:9");
  if (*count != std::floor(*count) || *count < 2 || *count > static_cast<double>(kMostListed))
    refuse(word, fmt::format("COUNT must be a whole number from 2 to {}", kMostListed));
  if (logarithmic && !(*from > 0 && *to > 0)) refuse(word, "both ends of log must be > 0");
  const int last = static_cast<int>(*count) - 1;
  std::vector<double> values;
  for (int k = 0; k <= last; ++k) {
    const double share = static_cast<double>(k) / last;
    // Values have 15 digits, so that 0.1:0.5:9 has 0.15 and not the number beside it.
    const double value =
        logarithmic ? *from * std::pow(*to / *from, share) : *from * (1 - share) + *to * share;
    values.push_back(finite_number(fmt::format("{:.15g}", value)).value_or(value));
  }
  values.back() = *to;
  return values;
}

}  // namespace

void check_outputs(const Output& files, const std::vector<std::string>& inputs, bool force) {
  formats::check_names(files, inputs);
  for (const std::string& file : formats::names(files)) {
    if (!force) check_replaceable(file);
    check_writable(file);
  }
}

std::optional<double> finite_number(const std::string& text) {
  double value = 0;
  if (!CLI::detail::lexical_cast(text, value) || !std::isfinite(value)) return {};
  return value;
}

CLI::Validator positive_number() {
  return CLI::Validator(
      [](const std::string& text) {
        return positive(text) ? std::string() : fmt::format("\"{}\" is not a number > 0", text);
      },
      "NUMBER > 0");
}

std::vector<double> read_settings(const std::string& option, const std::vector<std::string>& items,
                                  double ratio) {
  std::vector<double> settings;
  for (const std::string& item : items) {
    const std::size_t colon = item.find(':');
    const std::optional<double> from = positive(item.substr(0, colon));
    const std::optional<double> to =
        colon == std::string::npos ? from : positive(item.substr(colon + 1));
    if (!from || !to)
      throw std::invalid_argument(fmt::format(
          "{}: \"{}\" is neither a number > 0 nor a range such as 1e-3:1e-9", option, item));
    const double steps = std::abs(std::log(*to / *from)) / std::log(ratio);
    if (!(steps < kMostSettings))
      throw std::invalid_argument(
          fmt::format("{}: \"{}\" has more than {} settings by factors of {}", option, item,
                      kMostSettings, ratio));
    const double factor = *to < *from ? 1 / ratio : ratio;
    for (int k = 0; k < steps - 1e-6; ++k) settings.push_back(*from * std::pow(factor, k));
    settings.push_back(*to);
  }
  return settings;
}

SceneText read_text(const std::string& file) {
  if (file == "-") return {all_of(std::cin), "standard input"};
  std::ifstream in(file, std::ios::binary);
  std::string text = in ? all_of(in) : "";
  if (!in.eof()) throw std::invalid_argument(file + ": cannot be read, or is beyond 256 MiB");
  return {std::move(text), file};
}

SceneText read_scene_text(const std::string& file) {
  SceneText out = read_text(file);
  if (out.text.empty() && file != "-") read_scene(file);  // says what is wrong
  return out;
}

Scene read_scene_argument(const std::string& file) {
  if (file != "-") return read_scene(file);
  const SceneText scene = read_scene_text(file);
  Scene out = parse_scene(scene.text, scene.name);
  out.file.clear();  // no name of a file that an output could have
  return out;
}

void parse_paths(const SceneText& scene, const std::vector<Setting>& settings) {
  try {
    parse_scene_with(scene.text, scene.name, settings);
  } catch (const SceneError& e) {
    // An unknown key is a path that leads to nothing; values are judged one by one.
    for (const Problem& problem : e.problems())
      for (const Setting& each : settings) {
        const std::string key = each.path.substr(each.path.rfind('.') + 1);
        const std::size_t at = problem.field.size() - std::min(problem.field.size(), key.size());
        if (problem.allowed.rfind("unknown key", 0) == 0 && problem.field.substr(at) == key)
          throw std::invalid_argument(fmt::format("\"{}\": {}", each.path, problem.allowed));
      }
  }
}

VariedNumber read_varied(const std::string& word) {
  const std::size_t equals = word.find('=');
  if (equals == std::string::npos || equals == 0)
    refuse(word, "must be PATH=VALUES, e.g. pair.friction=0.1:0.5:9");
  VariedNumber out;
  out.path = word.substr(0, equals);
  const std::string values = word.substr(equals + 1);
  if (const auto parts = files::split(values, ':'); parts.size() == 3 || parts.size() == 4) {
    out.values = range(word, parts);
    return out;
  }
  for (const std::string& each : files::split(values, ',')) {
    const std::optional<double> value = finite_number(each);
    if (!value) refuse(word, fmt::format("\"{}\" is not a finite number", each));
    out.values.push_back(*value);
  }
  return out;
}

}  // namespace tether::scene
