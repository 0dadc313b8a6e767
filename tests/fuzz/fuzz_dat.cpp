// Fuzz target of the .dat reader, and of the solver on what it reads. SPDX-License-Identifier:
// BSD-3-Clause
#include <cstdlib>
#include <stdexcept>
#include <tether/contact.hpp>
#include <tether/contact/files.hpp>

#include "driver.hpp"
#include "memory_file.hpp"
#include "solve_read.hpp"

using namespace tether;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static fuzz::MemoryFile file("dat");
  file.write(data, size);
  try {
    fuzz::solve_read(contact::read_problem(file.path()));
  } catch (const std::runtime_error&) {  // the file says why
  }
  try {
    fuzz::solve_read(contact::read_cones(file.path()));
  } catch (const std::runtime_error&) {
  }
  return 0;
}

std::vector<std::string> own_corpus() { return {}; }
