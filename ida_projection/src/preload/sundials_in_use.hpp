// Tether: the functions of SUNDIALS that stand behind ours. SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace tether::ida_projection::preload {

/// The program's own IDA function of this name; null: the program has none loaded.
void* find_in_sundials(const char* name) noexcept;

template <class Function>
Function* sundials_function(const char* name) noexcept {
  return reinterpret_cast<Function*>(find_in_sundials(name));
}

}  // namespace tether::ida_projection::preload
