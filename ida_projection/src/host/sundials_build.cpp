// Tether: the SUNDIALS that runs must be the one that the plugin was compiled with.
// SPDX-License-Identifier: BSD-3-Clause
#include <tether/ida_projection/sundials_build.hpp>

#include <stdexcept>
#include <string>
#include <sundials/sundials_version.h>

const tether_sundials_build TETHER_SUNDIALS_BUILD = {SUNDIALS_VERSION_MAJOR, SUNDIALS_VERSION_MINOR,
                                                     SUNDIALS_VERSION_PATCH,
                                                     TETHER_SUNDIALS_INDEX_BITS};

namespace tether::ida_projection {

void check_running_sundials(const SundialsBuild& built) {
  int major = 0, minor = 0, patch = 0;
  char label[32] = "";
  if (SUNDIALSGetVersionNumber(&major, &minor, &patch, label, sizeof label) != 0)
    throw std::runtime_error("Projection: SUNDIALS does not say which version it is");
  // Within a major version functions are added, and structures keep what they have.
  if (major == built.major && minor >= built.minor) return;
  const auto text = [](int a, int b, int c) {
    return std::to_string(a) + "." + std::to_string(b) + "." + std::to_string(c);
  };
  throw std::runtime_error("Projection: this is SUNDIALS " + text(major, minor, patch) +
                           ", but the plugin was compiled with SUNDIALS " +
                           text(built.major, built.minor, built.patch) +
                           "; run with that one (or a later " + std::to_string(built.major) +
                           ".x), or compile the plugin with this one");
}

}  // namespace tether::ida_projection
