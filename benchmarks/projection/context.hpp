// Tether: a SUNDIALS context without MPI. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sundials/sundials_context.h>

namespace tether::bench {

inline SUNContext make_context() {
  SUNContext context = nullptr;
#ifdef SUN_COMM_NULL  // SUNDIALS 7
  SUNContext_Create(SUN_COMM_NULL, &context);
  SUNContext_ClearErrHandlers(context);  // a failed run is a row of a table, not a message
#else
  SUNContext_Create(nullptr, &context);
#endif
  return context;
}

}  // namespace tether::bench
