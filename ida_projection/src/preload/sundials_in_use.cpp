// Tether: the functions of SUNDIALS that stand behind ours. SPDX-License-Identifier: BSD-3-Clause
#include "preload/sundials_in_use.hpp"

#include <cstring>
#include <dlfcn.h>
#include <link.h>

namespace tether::ida_projection::preload {

namespace {

// A host's module (as Octave's) may have loaded SUNDIALS for itself alone. IDA and the libraries
// below it become visible to all, which our own calls into SUNDIALS need.
int make_visible(dl_phdr_info* object, std::size_t, void* ida) {
  const char* slash = object->dlpi_name ? std::strrchr(object->dlpi_name, '/') : nullptr;
  const char* file = slash ? slash + 1 : object->dlpi_name;
  if (!file || std::strncmp(file, "libsundials_", 12) != 0) return 0;
  void* handle = dlopen(object->dlpi_name, RTLD_LAZY | RTLD_NOLOAD | RTLD_GLOBAL);
  if (handle && std::strncmp(file, "libsundials_ida", 15) == 0) *static_cast<void**>(ida) = handle;
  return 0;
}

}  // namespace

void* find_in_sundials(const char* name) noexcept {
  if (void* next = dlsym(RTLD_NEXT, name)) return next;
  void* ida = nullptr;
  dl_iterate_phdr(make_visible, &ida);
  return ida ? dlsym(ida, name) : nullptr;
}

}  // namespace tether::ida_projection::preload
