// Tether: what a run writes. SPDX-License-Identifier: BSD-3-Clause
#include "output_names.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <filesystem>
#include <map>
#include <stdexcept>

#include "own_files.hpp"

namespace tether::scene {

namespace fs = std::filesystem;

namespace {

std::string one_name(const std::string& file) {
  std::error_code error;
  const fs::path whole = fs::weakly_canonical(fs::absolute(file, error), error);
  return error ? file : whole.string();
}

}  // namespace

std::string identity(const std::string& file) {
  struct stat there {};
  if (stat(file.c_str(), &there) == 0 && S_ISREG(there.st_mode))
    return fmt::format("file {} of device {}", there.st_ino, there.st_dev);
  return one_name(file);
}

bool is_device(const std::string& file) {
  std::error_code error;
  const fs::file_status there = fs::status(file, error);
  return fs::exists(there) && !fs::is_regular_file(there) && !fs::is_directory(there);
}

std::string event_file(const std::string& csv) {
  return fs::path(csv).replace_extension(".events.csv").string();
}

std::string contact_file(const std::string& csv) {
  return fs::path(csv).replace_extension(".contacts.csv").string();
}

std::string film_file(const std::string& vtk) {
  return fs::path(vtk).replace_extension(".pvd").string();
}

std::string film_folder(const std::string& vtk) {
  return fs::path(vtk).replace_extension("").string();
}

std::vector<std::string> inputs_of(const Scene& scene) {
  std::vector<std::string> out = scene.surface_files;
  out.push_back(scene.file);
  return out;
}

void check_names(const Output& o, const std::vector<std::string>& inputs) {
  std::map<std::string, std::string> taken;  // name: its purpose
  for (const std::string& input : inputs)
    if (!input.empty()) taken.emplace(identity(input), "an input of this run: " + input);
  const auto take = [&](const char* what, const std::string& file) {
    if (is_device(file)) return;
    const auto [at, fresh] = taken.emplace(identity(file), fmt::format("written as {}", what));
    if (!fresh)
      throw std::invalid_argument(
          fmt::format("{} = \"{}\": this file is {}", what, file, at->second));
  };
  const auto take_all = [&](const char* what, const std::string& file,
                            std::initializer_list<const char*> with) {
    if (file.empty()) return;
    const fs::path name = fs::path(file).filename();
    if (name.empty() || name == "." || name == "..")
      throw std::invalid_argument(fmt::format("{} = \"{}\": must name a file", what, file));
    take(what, file);
    for (const char* each : with) take(what, file + each);
  };
  take_all("csv", o.csv, {".lock", ".new"});
  if (!o.csv.empty() && !is_device(o.csv)) take("csv", event_file(o.csv));
  if (!o.csv.empty() && o.forces && !is_device(o.csv)) take("csv", contact_file(o.csv));
  take_all("svg", o.svg, {".lock", ".new"});
  take_all("state", o.state, {".lock", ".new"});
  if (o.vtk.empty()) return;
  take_all("vtk", film_file(o.vtk), {".lock", ".new"});
  take("vtk", film_folder(o.vtk));
  for (const std::string& other : {o.csv, o.svg, o.state}) {
    const fs::path path = one_name(other);
    if (!other.empty() && (path.extension() == ".vtp" || path.extension() == ".pvtp") &&
        path.parent_path() == one_name(film_folder(o.vtk)))
      throw std::invalid_argument(
          fmt::format("\"{}\": frames of vtk = \"{}\" have such names", other, o.vtk));
  }
}

void check_page_name(const std::string& html, const std::vector<std::string>& others) {
  const fs::path name = fs::path(html).filename();
  if (name.empty() || name == "." || name == "..")
    throw std::invalid_argument(fmt::format("html = \"{}\": must name a file", html));
  if (is_device(html)) return;
  for (const std::string& each : others)
    for (const char* with : {"", ".new", ".lock"})
      if (!each.empty() &&
          (identity(each + with) == identity(html) || identity(html + with) == identity(each)))
        throw std::invalid_argument(
            fmt::format("html = \"{}\": this file is an input or another output", html));
}

std::vector<std::string> names(const Output& o) {
  std::vector<std::string> all;
  for (const std::string& each :
       {o.csv, o.vtk.empty() ? std::string() : film_file(o.vtk), o.svg, o.state})
    if (!each.empty()) all.push_back(each);
  return all;
}

std::vector<std::string> all_names(const Output& o) {
  std::vector<std::string> all = names(o);
  if (!o.csv.empty()) {
    all.push_back(event_file(o.csv));
    all.push_back(contact_file(o.csv));
  }
  if (!o.vtk.empty()) all.push_back(film_folder(o.vtk));
  return all;
}

void check_replaceable(const Output& o) {
  for (const std::string& each : all_names(o))
    if (o.vtk.empty() || each != film_folder(o.vtk)) check_replaceable(each);
  if (o.vtk.empty()) return;
  std::error_code error;
  for (const fs::directory_entry& each : fs::directory_iterator(film_folder(o.vtk), error))
    if (const fs::path end = each.path().extension(); end == ".vtp" || end == ".pvtp")
      check_replaceable(each.path().string());
}

}  // namespace tether::scene
