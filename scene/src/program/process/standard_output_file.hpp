// Tether: an output of a run that goes to the standard output. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <tether/scene/scene.hpp>

#include "standard_streams.hpp"

namespace tether::scene {

/// The output that is called "-" is a file in a folder of its own while the run goes, so that it is
/// whole before its first byte leaves. Nothing without such an output.
class StandardOutputFile {
 public:
  /// Replaces "-" in `output` and the name of a page. std::invalid_argument where there are two, or
  /// where it is a film, which has many files.
  StandardOutputFile(Output& output, std::string& html);
  ~StandardOutputFile();
  StandardOutputFile(const StandardOutputFile&) = delete;
  StandardOutputFile& operator=(const StandardOutputFile&) = delete;

  void copy();

 private:
  std::string folder_, file_;
  std::unique_ptr<StandardOutput> out_;
};

}  // namespace tether::scene
