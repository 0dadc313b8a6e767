// Tether: the list of integrators; a new one is a file and a line here.
// SPDX-License-Identifier: BSD-3-Clause
#include "code.hpp"

namespace tether::bench {

Codes all_codes() {
  Codes codes;
  add_ida_codes(codes);
  add_desolve_codes(codes);
#ifdef TETHER_HAVE_CVODE
  add_cvode_code(codes);
#else
  codes.push_back(std::make_unique<Absent>(
      "CVODE+proj", "needs CVODE when the benchmarks are built (apt-get install libsundials-dev)"));
#endif
  add_cpodes_code(codes);
  return codes;
}

}  // namespace tether::bench
