// Tether: the SUNDIALS that runs must be the one that the plugin was compiled with.
// SPDX-License-Identifier: BSD-3-Clause
#include <tether/ida_projection/sundials_build.hpp>

#include <algorithm>
#include <cstring>
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
  // Minor versions only add functions; structures stay compatible.
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

// Another library of the same name and version may be a build with other indices.
void check_running_indices(N_Vector vector) {
  if (vector->ops->nvspace == nullptr) return;
  constexpr std::size_t kNarrow = 4, kWide = 8;
  constexpr unsigned char kUntouched = 0xA5;
  alignas(kWide) unsigned char counts[2][kWide];
  std::memset(counts, kUntouched, sizeof counts);
  vector->ops->nvspace(vector, reinterpret_cast<sunindextype*>(counts[0]),
                       reinterpret_cast<sunindextype*>(counts[1]));
  const auto touched = [&](std::size_t from, std::size_t to) {
    return std::any_of(counts, counts + 2, [=](const unsigned char* count) {
      return std::any_of(count + from, count + to,
                         [](unsigned char byte) { return byte != kUntouched; });
    });
  };
  if (!touched(0, kNarrow)) return;  // it writes nothing
  const int bits = touched(kNarrow, kWide) ? 64 : 32;
  if (bits == TETHER_SUNDIALS_INDEX_BITS) return;
  throw std::runtime_error("Projection: this SUNDIALS has " + std::to_string(bits) +
                           "-bit indices, but the plugin was compiled for " +
                           std::to_string(TETHER_SUNDIALS_INDEX_BITS) +
                           "-bit ones (SUNDIALS_INDEX_SIZE); run with the SUNDIALS that it was "
                           "compiled with, or compile "
                           "the plugin with this one");
}

}  // namespace tether::ida_projection
