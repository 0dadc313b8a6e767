// Tether: the text of an expected exception. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stdexcept>
#include <string>

namespace tether::test {

/// Message of the exception that `call` throws; empty if it throws nothing. (Catch2 v2 and v3 name
/// their string matchers differently.)
template <class Exception = std::invalid_argument, class Call>
std::string thrown(Call&& call) {
  try {
    call();
  } catch (const Exception& e) {
    return e.what();
  }
  return {};
}

inline bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

}  // namespace tether::test
