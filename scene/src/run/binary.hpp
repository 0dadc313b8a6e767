// Tether: numbers of a saved state, bit by bit. SPDX-License-Identifier: BSD-3-Clause
//
// For the machine that wrote them: a state is for going on, not for exchange.
#pragma once

#include <istream>
#include <ostream>
#include <stdexcept>
#include <type_traits>

namespace tether::scene::binary {

template <class... T>
void put(std::ostream& out, const T&... values) {
  static_assert((std::is_arithmetic_v<T> && ...));
  (out.write(reinterpret_cast<const char*>(&values), sizeof values), ...);
}

template <class... T>
void get(std::istream& in, T&... values) {
  static_assert((std::is_arithmetic_v<T> && ...));
  (in.read(reinterpret_cast<char*>(&values), sizeof values), ...);
  if (!in) throw std::runtime_error("the saved state is cut off");
}

}  // namespace tether::scene::binary
