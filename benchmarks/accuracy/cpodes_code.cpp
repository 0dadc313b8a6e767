// Tether: opens the module with CPodes. SPDX-License-Identifier: BSD-3-Clause
#include <dlfcn.h>

#include "code.hpp"

namespace tether::bench {

void add_cpodes_code(Codes& codes) {
#ifdef TETHER_CPODES_MODULE
  void* module = dlopen(TETHER_CPODES_MODULE, RTLD_NOW | RTLD_LOCAL | RTLD_DEEPBIND);
  if (module) {
    if (auto make = reinterpret_cast<Code* (*)()>(dlsym(module, "tether_make_cpodes"))) {
      codes.emplace_back(make());
      return;
    }
  }
  const char* why = dlerror();
  codes.push_back(std::make_unique<Absent>("CPodes", why ? why : "its module has no entry"));
#else
  codes.push_back(std::make_unique<Absent>(
      "CPodes", "needs Simbody when the benchmarks are built (apt-get install libsimbody-dev)"));
#endif
}

}  // namespace tether::bench
