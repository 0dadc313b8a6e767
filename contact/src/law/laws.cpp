// Tether: the list of friction laws. SPDX-License-Identifier: BSD-3-Clause
#include <stdexcept>
#include <string>

#include "law.hpp"

namespace tether::contact {
namespace detail {

extern const LawKernels kMaximumDissipation, kCoulomb, kFrictionless;

namespace {

// In the order of their enumerators.
const LawKernels* const kLaws[] = {&kMaximumDissipation, &kCoulomb, &kFrictionless};

}  // namespace

const LawKernels& kernels(Law law) {
  const std::size_t i = static_cast<std::size_t>(law);
  if (i >= std::size(kLaws))
    throw std::invalid_argument("law = " + std::to_string(i) +
                                " is none of those of tether::contact::Law");
  return *kLaws[i];
}

}  // namespace detail

const std::vector<Law>& laws() {
  static const std::vector<Law> all = [] {
    std::vector<Law> list;
    for (const detail::LawKernels* k : detail::kLaws) list.push_back(k->law);
    return list;
  }();
  return all;
}

const char* name(Law law) { return detail::kernels(law).name; }

}  // namespace tether::contact
