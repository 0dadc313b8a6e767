// Tether: calls of functions that may throw, and what IDA is told. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <exception>
#include <stdexcept>
#include <string>
#include <sundials/sundials_nonlinearsolver.h>
#include <tether/linalg/vector_code.hpp>

namespace tether::ida_projection {

constexpr int kRecoverable = SUN_NLS_CONV_RECVR;  // IDA retries with a quarter of the step
constexpr int kFatal = -1;                        // ends in IDA_NLS_FAIL

/// Text of an exception, never empty; what() may be null.
inline const char* text_of(const std::exception& e) noexcept {
  const char* text = e.what();
  if (text == nullptr) return "an exception whose what() is null";
  return *text != '\0' ? text : "an exception without text";
}

/// The parts of an object of this class. Throws std::logic_error if it was moved from.
template <class Pointer>
auto& owned(const char* class_name, const Pointer& owner) {
  if (!owner)
    throw std::logic_error(std::string(class_name) +
                           ": it was moved from; call the one that it was moved to");
  return *owner;
}

/// Runs a user callback: no exception leaves it. Returns the callback's int; `message` receives
/// the text of an exception, which counts as fatal.
template <class Call>
TETHER_INLINE int guarded(Call&& call, std::string& message) noexcept {
  const auto fail = [&message](const char* text) {
    try {
      message = text;
    } catch (...) {
    }
    return -1;
  };
  try {
    return call();
  } catch (const std::exception& e) {
    return fail(text_of(e));
  } catch (...) {
    return fail("what is no std::exception");
  }
}

}  // namespace tether::ida_projection
