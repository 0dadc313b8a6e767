// Tether: calls of functions that may throw, and what IDA is told. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <exception>
#include <string>
#include <sundials/sundials_nonlinearsolver.h>

namespace tether::ida_projection {

constexpr int kRecoverable = SUN_NLS_CONV_RECVR;  // IDA retries with a quarter of the step
constexpr int kFatal = -1;                        // ends in IDA_NLS_FAIL

/// Text of an exception; what() may be null.
inline const char* text_of(const std::exception& e) noexcept {
  const char* text = e.what();
  return text != nullptr ? text : "an exception whose what() is null";
}

/// Runs a user callback: no exception leaves it. Returns the callback's int; `message` receives
/// the text of an exception, which counts as fatal.
template <class Call>
int guarded(Call&& call, std::string& message) noexcept {
  try {
    return call();
  } catch (const std::exception& e) {
    try {
      message = text_of(e);
    } catch (...) {
    }
    return -1;
  } catch (...) {
    return -1;
  }
}

}  // namespace tether::ida_projection
