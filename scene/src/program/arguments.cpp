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

}  // namespace tether::scene
