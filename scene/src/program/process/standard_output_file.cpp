// Tether: an output of a run that goes to the standard output. SPDX-License-Identifier:
// BSD-3-Clause
#include "standard_output_file.hpp"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <vector>

#include "record/formats.hpp"

namespace tether::scene {

namespace fs = std::filesystem;

StandardOutputFile::StandardOutputFile(Output& output, std::string& html) {
  std::vector<std::string*> files = {&html};
  for (const formats::Format* each : formats::all()) {
    files.push_back(&output[each->name]);
    if (each->film && *files.back() == "-")
      throw std::invalid_argument(std::string(each->name) +
                                  " = \"-\": a film has many files and needs a name");
  }
  std::string* there = nullptr;
  for (std::string* each : files) {
    if (*each != "-") continue;
    if (there != nullptr)
      throw std::invalid_argument("only one output can be -, the standard output");
    there = each;
  }
  if (there == nullptr) return;
  std::string folder = (fs::temp_directory_path() / "tether-XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr)
    throw std::runtime_error("cannot make " + folder + ": " + std::strerror(errno));
  folder_ = folder;
  *there = file_ = (fs::path(folder) / "output").string();
  out_ = std::make_unique<StandardOutput>("-");
}

StandardOutputFile::~StandardOutputFile() {
  std::error_code ignored;
  if (!folder_.empty()) fs::remove_all(folder_, ignored);
}

void StandardOutputFile::copy() {
  if (!out_) return;
  std::ifstream in(file_, std::ios::binary);
  out_->write({std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()});
}

}  // namespace tether::scene
