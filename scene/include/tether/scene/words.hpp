// Tether: the words that scene files use for the values of scene.hpp. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <array>
#include <string_view>
#include <tether/scene/scene.hpp>
#include <utility>

namespace tether::scene {

/// Every value of E with its word.
template <class E>
struct Words;

template <>
struct Words<ShapeKind> {
  static constexpr std::array<std::pair<std::string_view, ShapeKind>, 6> list{{
      {"sphere", ShapeKind::sphere},
      {"plane", ShapeKind::plane},
      {"box", ShapeKind::box},
      {"capsule", ShapeKind::capsule},
      {"convex", ShapeKind::convex},
      {"points", ShapeKind::points},
  }};
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
struct Words<Gyroscopic> {
  static constexpr std::array<std::pair<std::string_view, Gyroscopic>, 4> list{{
      {"none", Gyroscopic::none},
      {"explicit", Gyroscopic::explicit_step},
      {"implicit", Gyroscopic::implicit_step},
      {"momentum", Gyroscopic::momentum},
  }};
};

template <>
struct Words<ContactLaw> {
  static constexpr std::array<std::pair<std::string_view, ContactLaw>, 3> list{{
      {"coulomb", ContactLaw::coulomb},
      {"maximum_dissipation", ContactLaw::maximum_dissipation},
      {"frictionless", ContactLaw::frictionless},
  }};
};

template <>
struct Words<RestitutionLaw> {
  static constexpr std::array<std::pair<std::string_view, RestitutionLaw>, 2> list{{
      {"newton", RestitutionLaw::newton},
      {"poisson", RestitutionLaw::poisson},
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
struct Words<Quantity> {
  static constexpr std::array<std::pair<std::string_view, Quantity>, 16> list{{
      {"position", Quantity::position},
      {"velocity", Quantity::velocity},
      {"orientation", Quantity::orientation},
      {"angular_velocity", Quantity::angular_velocity},
      {"distance_moved", Quantity::distance_moved},
      {"speed", Quantity::speed},
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
  }};
};

template <class E>
constexpr std::string_view word(E value) {
  for (const auto& [text, each] : Words<E>::list)
    if (each == value) return text;
  return "?";
}

}  // namespace tether::scene
