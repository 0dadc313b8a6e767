// Tether: files that are not there yet. SPDX-License-Identifier: BSD-3-Clause
#include "new_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "output/whole_file.hpp"

namespace tether::scene {

void reserve(const std::string& file) {
  make_folder_of(file);
  const int descriptor = open(file.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0666);
  if (descriptor < 0)
    throw std::invalid_argument(errno == EEXIST
                                    ? file + " is there already; --force replaces it"
                                    : "cannot write " + file + ": " + std::strerror(errno));
  close(descriptor);
}

}  // namespace tether::scene
