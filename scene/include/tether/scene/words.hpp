// Tether: the words that scene files use for the values of scene.hpp. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <array>
#include <string_view>
#include <tether/contact/one_contact.hpp>
#include <tether/scene/scene.hpp>
#include <utility>
#include <vector>

namespace tether::scene {

/// Every value of an enumeration E with its word: specialisations have a static `list` of (word,
/// value) pairs.
template <class E>
struct Words;

/// Values of the contact library with their names there.
template <class E, class Values>
std::vector<std::pair<std::string_view, E>> named(const Values& values) {
  std::vector<std::pair<std::string_view, E>> list;
  for (const E value : values) list.emplace_back(name(value), value);
  return list;
}

/// @cond
template <>
struct Words<ShapeKind> {
  inline static const auto list = named<ShapeKind>(contact::kShapeKinds);
};

template <>
struct Words<Gyroscopic> {
  inline static const auto list = named<Gyroscopic>(contact::kGyroscopics);
};

template <>
struct Words<RestitutionLaw> {
  inline static const auto list = named<RestitutionLaw>(contact::kRestitutionLaws);
};

template <>
struct Words<contact::SimultaneousImpacts> {
  inline static const auto list =
      named<contact::SimultaneousImpacts>(contact::kSimultaneousImpacts);
};

// Every friction law of the contact library can be named in a scene.
template <>
struct Words<contact::Law> {
  inline static const auto list = named<contact::Law>(contact::laws());
};

template <>
struct Words<JointKind> {
  static constexpr auto list = kJointWords;
};

template <>
struct Words<InvariantKind> {
  static constexpr auto list = in_order<InvariantKind>({"energy", "momentum", "angular_momentum"});
};

template <>
struct Words<Formulation> {
  static constexpr auto list = in_order<Formulation>({"index1", "index0"});
};

template <>
struct Words<EngineKind> {
  static constexpr auto list = in_order<EngineKind>({"automatic", "smooth", "stepping", "event"});
};

template <>
struct Words<OnFailure> {
  static constexpr auto list = in_order<OnFailure>({"stop", "warn"});
};

template <>
struct Words<Otherwise> {
  static constexpr auto list = in_order<Otherwise>({"stop", "stepping"});
};

template <>
struct Words<Quantity> {
  static constexpr auto list = in_order<Quantity>(
      {"position",    "velocity",      "orientation",  "angular_velocity", "distance_moved",
       "speed",       "contact_force", "contact_slip", "kinetic_energy",   "potential_energy",
       "energy",      "energy_change", "momentum",     "angular_momentum", "drift",
       "contacts",    "penetration",   "residual",     "joint_force",      "joint_moment",
       "joint_drive", "spring_force"});
};

/// @endcond

/// The word of a value; "?" for none of the enumerators.
template <class E>
constexpr std::string_view word(E value) {
  for (const auto& [text, each] : Words<E>::list)
    if (each == value) return text;
  return "?";
}

}  // namespace tether::scene
