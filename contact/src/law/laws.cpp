// Tether: the list of friction laws. SPDX-License-Identifier: BSD-3-Clause
#include <stdexcept>
#include <string>

#include "law/coulomb.hpp"
#include "law/frictionless.hpp"
#include "law/interface/law.hpp"
#include "law/maximum_dissipation.hpp"

namespace tether::contact {
namespace detail {

namespace {

// Laws in the order of their enumerators.
template <class... L>
struct List {
  static constexpr LawTraits kTraits[] = {{L::kLaw, L::kName, L::kFriction}...};
  static constexpr const LawKernels* kKernels[] = {&L::kKernels...};
};
using All = List<MaximumDissipation, Coulomb, Frictionless>;

// Tables are indexed by the enumerator.
std::size_t index(Law law) {
  const std::size_t i = static_cast<std::size_t>(law);
  if (i >= std::size(All::kTraits))
    throw std::invalid_argument("law = " + std::to_string(i) +
                                " is none of those of tether::contact::Law");
  return i;
}

}  // namespace

const LawTraits& traits(Law law) { return All::kTraits[index(law)]; }
const LawKernels& kernels(Law law) { return *All::kKernels[index(law)]; }

}  // namespace detail

const std::vector<Law>& laws() {
  static const std::vector<Law> all = [] {
    std::vector<Law> list;
    for (const detail::LawTraits& t : detail::All::kTraits) list.push_back(t.law);
    return list;
  }();
  return all;
}

const char* name(Law law) { return detail::traits(law).name; }

}  // namespace tether::contact
