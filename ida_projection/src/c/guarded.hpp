// Tether: errors of functions for programs in C. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstring>
#include <exception>
#include <new>
#include <stdexcept>
#include <string>
#include <tether/ida_projection.h>
#include <tether/ida_projection/options.hpp>
#include <tether/ida_projection/sundials_build.hpp>
#include <type_traits>

namespace tether::ida_projection::c {

// Plain storage: a string would register its destructor, which ends the program without memory.
inline thread_local char last_error[2048];

inline int fail(int flag, const char* text) noexcept {
  std::strncpy(last_error, text != nullptr ? text : "an exception whose what() is null",
               sizeof last_error - 1);
  return flag;
}

/// An error of a call, for guarded().
struct Error {
  int flag;
  std::string text;
};

/// The arguments of a function for C; errors name both.
class Arguments {
 public:
  explicit Arguments(const char* function) : function_(function) {}
  /// "tether_add_rows: value is null".
  template <class Pointer>
  void require(const Pointer& argument, const char* name) const {
    if (argument == nullptr)
      throw Error{TETHER_MEM_NULL, std::string(function_) + ": " + name + " is null"};
  }
  [[noreturn]] void refuse(const std::string& text) const {
    throw Error{TETHER_ILL_INPUT, std::string(function_) + ": " + text};
  }
  /// "tether_add_rows: count = 0, must be at least 1".
  template <class Number>
  void check(bool right, const char* name, Number value, const char* allowed) const {
    if (!right) refuse(std::string(name) + " = " + std::to_string(value) + ", must be " + allowed);
  }
  void check_build(const tether_sundials_build* host) const {
    require(host, "host");
    try {
      check_running_sundials(*host);
    } catch (const std::runtime_error& error) {
      throw Error{TETHER_WRONG_SUNDIALS, error.what()};
    }
  }

 private:
  const char* function_;
};

/// The body of a function that C calls: no exception gets out. Returns its int, or 0.
template <class Body>
int guarded(const char* function, Body&& body) noexcept {
  try {
    last_error[0] = 0;
    if constexpr (std::is_void_v<std::invoke_result_t<Body&, Arguments>>)
      return body(Arguments(function)), 0;
    else
      return body(Arguments(function));
  } catch (const Error& error) {
    return fail(error.flag, error.text.c_str());
  } catch (const std::bad_alloc&) {
    return fail(TETHER_MEM_FAIL, "out of memory");
  } catch (const std::logic_error& error) {  // std::invalid_argument, or a call out of turn
    return fail(TETHER_ILL_INPUT, error.what());
  } catch (const std::exception& error) {
    return fail(TETHER_INTERNAL_ERROR, error.what());
  } catch (...) {
    return fail(TETHER_INTERNAL_ERROR, "unknown exception");
  }
}

/// Options as programs in C give them; null: the defaults. `unknowns`: the length of `hold` and
/// `group`, read only where these are given. Throws std::invalid_argument, naming the field and its
/// value.
TETHER_EXPORT_BEGIN
Options options_of(const tether_options* options, long unknowns);
TETHER_EXPORT_END

}  // namespace tether::ida_projection::c
