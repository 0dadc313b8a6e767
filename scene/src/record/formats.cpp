// Tether: the formats in which a run is recorded. SPDX-License-Identifier: BSD-3-Clause
#include "formats.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "output/files.hpp"

namespace tether::scene::formats {

namespace fs = std::filesystem;

#define FORMAT(name) const Format& name##_format();
#include "format_list.inc"
#undef FORMAT

const std::vector<const Format*>& all() {
  static const std::vector<const Format*> list = {
#define FORMAT(name) &name##_format(),
#include "format_list.inc"
#undef FORMAT
  };
  return list;
}

void check_names(const Output& o, const std::vector<std::string>& inputs) {
  std::map<std::string, std::string> taken;  // name: its purpose
  for (const std::string& input : inputs)
    if (!input.empty()) taken.emplace(identity(input), "an input of this run: " + input);
  for (const Format* each : all()) {
    if (o[each->name].empty()) continue;
    const std::string main = each->main_file(o);
    const auto refuse = [&](const std::string& file, const std::string& why) {
      throw std::invalid_argument(fmt::format("{} = \"{}\": {}", each->name, file, why));
    };
    if (!names_file(main)) refuse(main, "must name a file");
    if (is_device(main)) continue;
    std::vector<std::string> files = each->others(o, o.forces);
    files.insert(files.begin(), {main, main + ".lock", main + ".new"});
    for (const std::string& file : files)
      if (const auto [at, fresh] =
              taken.emplace(identity(file), fmt::format("written as {}", each->name));
          !fresh)
        refuse(file, "this file is " + at->second);
  }
  for (const Format* film : all())
    for (const std::string& folder : film->others(o, o.forces))
      for (const std::string& other : names(o))
        if (film->is_frame && film->is_frame(other) &&
            one_name(fs::path(other).parent_path()) == one_name(folder))
          throw std::invalid_argument(fmt::format("\"{}\": frames of {} = \"{}\" have such names",
                                                  other, film->name, o[film->name]));
}

std::vector<std::string> names(const Output& o) {
  std::vector<std::string> files;
  for (const Format* each : all())
    if (!o[each->name].empty()) files.push_back(each->main_file(o));
  return files;
}

std::vector<std::string> all_names(const Output& o) {
  std::vector<std::string> files = names(o);
  for (const Format* each : all())
    for (const std::string& file : each->others(o, true)) files.push_back(file);
  return files;
}

void check_replaceable(const Output& o) {
  for (const std::string& each : names(o)) scene::check_replaceable(each);
  for (const Format* each : all())
    for (const std::string& other : each->others(o, true)) {
      if (!each->is_frame) {
        scene::check_replaceable(other);
        continue;
      }
      std::error_code error;
      for (const fs::directory_entry& frame : fs::directory_iterator(other, error))
        if (each->is_frame(frame.path().string())) scene::check_replaceable(frame.path().string());
    }
}

}  // namespace tether::scene::formats
