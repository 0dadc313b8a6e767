// Tether: numbers of a saved state, bit by bit. SPDX-License-Identifier: BSD-3-Clause
//
// For the machine that wrote them: a state is for going on, not for exchange.
#pragma once

#include <cmath>
#include <istream>
#include <ostream>
#include <string_view>
#include <tether/scene/engine.hpp>
#include <type_traits>

namespace tether::scene::binary {

/// The largest count in a state; sums of a few are numbers.
constexpr long kMostCounted = 1L << 40;

using Magic = char[8];  ///< The first letters of a part of a state.

/// Whether the next letters are these, which are read then.
inline bool begins(std::istream& in, const Magic& wanted) {
  Magic found = {};
  in.read(found, sizeof found);
  return in && std::string_view(found, sizeof found) == std::string_view(wanted, sizeof wanted);
}

/// FNV-1a.
inline std::uint64_t hash_of(std::string_view bytes) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const char c : bytes) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  return hash;
}

/// Writes an object into a state, or reads it: what it consists of is said once.
class Archive {
 public:
  explicit Archive(std::ostream& out) : out_(&out) {}
  explicit Archive(std::istream& in) : in_(&in) {}
  bool reads() const { return in_ != nullptr; }

  /// Numbers, enumerators, texts, and vectors of Eigen, which are finite and of a length that
  /// reader and writer know. Throws std::runtime_error.
  template <class... T>
  void operator()(T&&... values) {
    (one(values), ...);
  }
  /// A list behind its length. It grows by what is there: a damaged length asks for no memory.
  template <class List, class Each>
  void list(List& all, const Each& each) {
    auto left = static_cast<std::uint64_t>(all.size());
    one(left);
    if constexpr (!std::is_const_v<List>) {
      if (reads()) {
        for (all.clear(); left > 0; --left) each(all.emplace_back());
        return;
      }
    }
    for (auto& each_one : all) each(each_one);
  }
  /// Throws where a state that is read does not have what every state has: it is damaged.
  void demand(bool holds, const std::string& why = "") const {
    if (reads() && !holds)
      throw std::runtime_error("the saved state is damaged" + (why.empty() ? why : ": " + why));
  }

 private:
  static constexpr std::uint64_t kLongestText = 100000;

  void bytes(char* at, std::size_t size) {
    if (out_ != nullptr) out_->write(at, static_cast<std::streamsize>(size));
    if (in_ != nullptr && !in_->read(at, static_cast<std::streamsize>(size)))
      throw std::runtime_error("the saved state is cut off");
  }
  template <class T>
  void one(T& value) {
    using Plain = std::remove_const_t<T>;
    Plain now = value;
    if constexpr (std::is_same_v<Plain, bool>) {  // of any byte but 0 and 1 it would be undefined
      char byte = now ? 1 : 0;
      bytes(&byte, 1);
      demand(byte == 0 || byte == 1);
      now = byte == 1;
    } else if constexpr (std::is_arithmetic_v<Plain>) {
      bytes(reinterpret_cast<char*>(&now), sizeof now);
    } else if constexpr (std::is_enum_v<Plain>) {
      auto number = static_cast<std::int32_t>(now);
      one(number);
      now = static_cast<Plain>(number);
      demand(static_cast<std::int32_t>(now) == number);
    } else if constexpr (std::is_same_v<Plain, std::string>) {
      auto size = static_cast<std::uint64_t>(now.size());
      one(size);
      demand(size <= kLongestText);
      now.resize(size);
      bytes(now.data(), now.size());
    } else {
      for (double& x : coefficients(now)) one(x);
      demand(coefficients(now).allFinite(), "a number in it is not finite");
    }
    if constexpr (!std::is_const_v<T>) value = std::move(now);
  }
  template <class Derived>
  static auto& coefficients(Eigen::MatrixBase<Derived>& vector) {
    return vector.derived();
  }
  template <class Derived>
  static auto& coefficients(Eigen::QuaternionBase<Derived>& quaternion) {
    return quaternion.coeffs();
  }

  std::ostream* out_ = nullptr;
  std::istream* in_ = nullptr;
};

}  // namespace tether::scene::binary

namespace tether::scene {

/// The first letters of a state that begins with its bodies.
constexpr binary::Magic kBodiesFirst = {'b', 'o', 'd', 'i', 'e', 's', ' ', '1'};

/// Their number, the time and what moves them. Throws std::runtime_error on other numbers of bodies
/// and on what is no motion.
template <class Bodies>
void exchange_bodies(binary::Archive& io, double& time, Bodies& bodies) {
  auto count = static_cast<std::uint64_t>(bodies.size());
  io(count, time);
  if (count != bodies.size())
    throw std::runtime_error("the saved state is of another scene: of another size");
  for (auto& b : bodies) {
    io(b.position, b.orientation, b.velocity, b.angular_velocity);
    io.demand(std::abs(b.orientation.norm() - 1) < 1e-6);
  }
}

/// Writes the bodies that such a state begins with, and the letters of the part behind them.
template <class Bodies>
void write_bodies(std::ostream& out, double time, const Bodies& bodies, const binary::Magic& part) {
  binary::Archive io(out);
  out.write(kBodiesFirst, sizeof kBodiesFirst);
  exchange_bodies(io, time, bodies);
  out.write(part, sizeof part);
}

/// Reads such bodies, which the state has once more. Throws std::runtime_error where it does not
/// begin with them.
inline void skip_bodies(std::istream& in, std::size_t count, const char* no_such_state) {
  if (!binary::begins(in, kBodiesFirst)) throw std::runtime_error(no_such_state);
  std::vector<BodyState> bodies(count);
  double seconds = 0;
  binary::Archive io(in);
  exchange_bodies(io, seconds, bodies);
}

}  // namespace tether::scene
