// Tether: fast operations for a serial vector and its clones. SPDX-License-Identifier: BSD-3-Clause
#include <nvector/nvector_serial.h>

#include <tether/ida_projection/fast.hpp>

#include "arguments.hpp"
#include "kernels.hpp"

namespace tether::ida_projection {

N_Vector fast_vector(N_Vector y) {
  check_running_sundials(TETHER_SUNDIALS_BUILD);
  fast::require_serial(y, "fast_vector: y");
  check_running_indices(y);
  fast::install_kernels(y->ops, NV_LENGTH_S(y));
  return y;
}

void fast_vector(N_Vector y, N_Vector yp) {
  fast::require_serial(yp, "fast_vector: yp");
  fast_vector(y);
  fast_vector(yp);
}

}  // namespace tether::ida_projection
