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
  static constexpr std::array<std::pair<std::string_view, InvariantKind>, 3> list{{
      {"energy", InvariantKind::energy},
      {"momentum", InvariantKind::momentum},
      {"angular_momentum", InvariantKind::angular_momentum},
  }};
};

template <>
struct Words<Formulation> {
  static constexpr std::array<std::pair<std::string_view, Formulation>, 3> list{{
      {"index1", Formulation::index1},
      {"index0", Formulation::index0},
      {"stabilised_index2", Formulation::stabilised_index2},
  }};
};

template <>
struct Words<EngineKind> {
  static constexpr std::array<std::pair<std::string_view, EngineKind>, 4> list{{
      {"automatic", EngineKind::automatic},
      {"smooth", EngineKind::smooth},
      {"stepping", EngineKind::stepping},
      {"event", EngineKind::event},
  }};
};

template <>
struct Words<OnFailure> {
  static constexpr std::array<std::pair<std::string_view, OnFailure>, 2> list{{
      {"stop", OnFailure::stop},
      {"warn", OnFailure::warn},
  }};
};

template <>
struct Words<Otherwise> {
  static constexpr std::array<std::pair<std::string_view, Otherwise>, 2> list{{
      {"stop", Otherwise::stop},
      {"stepping", Otherwise::stepping},
  }};
};

template <>
struct Words<Quantity> {
  static constexpr std::array<std::pair<std::string_view, Quantity>, 22> list{{
      {"position", Quantity::position},
      {"velocity", Quantity::velocity},
      {"orientation", Quantity::orientation},
      {"angular_velocity", Quantity::angular_velocity},
      {"distance_moved", Quantity::distance_moved},
      {"speed", Quantity::speed},
      {"contact_force", Quantity::contact_force},
      {"contact_slip", Quantity::contact_slip},
      {"kinetic_energy", Quantity::kinetic_energy},
      {"potential_energy", Quantity::potential_energy},
      {"energy", Quantity::energy},
      {"energy_change", Quantity::energy_change},
      {"momentum", Quantity::momentum},
      {"angular_momentum", Quantity::angular_momentum},
      {"drift", Quantity::drift},
      {"contacts", Quantity::contacts},
      {"penetration", Quantity::penetration},
      {"residual", Quantity::residual},
      {"joint_force", Quantity::joint_force},
      {"joint_moment", Quantity::joint_moment},
      {"joint_drive", Quantity::joint_drive},
      {"spring_force", Quantity::spring_force},
  }};
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
