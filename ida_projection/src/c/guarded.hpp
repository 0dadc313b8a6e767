// Tether: errors of functions for programs in C. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstring>
#include <exception>
#include <new>
#include <stdexcept>
#include <string>
#include <tether/ida_projection.h>

namespace tether::ida_projection::c {

// Plain storage: a string would register its destructor, which ends the program without memory.
inline thread_local char last_error[2048];

inline int fail(int flag, const char* text) noexcept {
  std::strncpy(last_error, text != nullptr ? text : "an exception whose what() is null",
               sizeof last_error - 1);
  return flag;
}

// An argument in error, e.g. "tether_add_rows: count = 0, must be at least 1".
inline int ill(const std::string& text) { return fail(TETHER_ILL_INPUT, text.c_str()); }
inline int null(const char* function, const char* argument) {
  return fail(TETHER_MEM_NULL, (std::string(function) + ": " + argument + " is null").c_str());
}

// Every function that C calls: no exception gets out.
template <class Function>
int guarded(Function&& function) noexcept {
  try {
    last_error[0] = 0;
    return function();
  } catch (const std::bad_alloc&) {
    return fail(TETHER_MEM_FAIL, "out of memory");
  } catch (const std::invalid_argument& error) {
    return fail(TETHER_ILL_INPUT, error.what());
  } catch (const std::exception& error) {
    return fail(TETHER_INTERNAL_ERROR, error.what());
  } catch (...) {
    return fail(TETHER_INTERNAL_ERROR, "unknown exception");
  }
}

}  // namespace tether::ida_projection::c
