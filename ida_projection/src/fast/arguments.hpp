// Tether: arguments that are refused, by name. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sundials/sundials_nvector.h>

#include <stdexcept>
#include <string>

namespace tether::ida_projection::fast {

[[noreturn]] inline void refuse(const std::string& what) { throw std::invalid_argument(what); }

/// `name` says whose argument it is.
inline void require_serial(N_Vector v, const std::string& name) {
  if (!v) refuse(name + " is null; want a vector of N_VNew_Serial or N_VMake_Serial");
  const N_Vector_ID id =
      v->ops && v->ops->nvgetvectorid ? v->ops->nvgetvectorid(v) : SUNDIALS_NVEC_CUSTOM;
  if (id != SUNDIALS_NVEC_SERIAL || !v->content)
    refuse(name + " is not a serial vector (N_VGetVectorID gives " + std::to_string(id) +
           "); want one of N_VNew_Serial or N_VMake_Serial, others keep their own operations");
}

}  // namespace tether::ida_projection::fast
