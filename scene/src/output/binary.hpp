// Tether: numbers of a saved state, bit by bit. SPDX-License-Identifier: BSD-3-Clause
//
// For the machine that wrote them: a state is for going on, not for exchange.
#pragma once

#include <Eigen/Core>
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

/// A bool of any byte but 0 and 1 would be undefined.
template <class T>
void get_one(std::istream& in, T& value) {
  if constexpr (std::is_same_v<T, bool>) {
    const int byte = in.get();
    if (in && byte > 1) throw std::runtime_error("the saved state is damaged");
    value = byte == 1;
  } else {
    in.read(reinterpret_cast<char*>(&value), sizeof value);
  }
}

template <class... T>
void get(std::istream& in, T&... values) {
  static_assert((std::is_arithmetic_v<T> && ...));
  (get_one(in, values), ...);
  if (!in) throw std::runtime_error("the saved state is cut off");
}

template <class T>
T get(std::istream& in) {
  T value{};
  get(in, value);
  return value;
}

/// Vectors of Eigen, of a length that reader and writer know.
template <class... Vector>
void put_array(std::ostream& out, const Vector&... vectors) {
  const auto each = [&](const auto& v) {
    for (Eigen::Index i = 0; i < v.size(); ++i) put(out, v[i]);
  };
  (each(vectors), ...);
}

template <class... Vector>
void get_array(std::istream& in, Vector&&... vectors) {
  const auto each = [&](auto& v) {
    for (Eigen::Index i = 0; i < v.size(); ++i) get(in, v[i]);
  };
  (each(vectors), ...);
}

}  // namespace tether::scene::binary
