// Tether: code shared by all passes over contacts between bodies. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include "kernels/body_contacts.hpp"

namespace tether::contact::detail {
namespace {

// Bodies of a contact to come; the contacts themselves are read in order.
constexpr int kAhead = 4;

template <class Contact>
TETHER_INLINE void fetch(const BodyArrays& s, const Contact* c, const Contact* end) {
#if defined(__GNUC__)
  if (c + kAhead >= end) return;
  __builtin_prefetch(s.state + c[kAhead].first, 1);
  __builtin_prefetch(s.state + (c[kAhead].second < 0 ? 0 : c[kAhead].second), 1);
#endif
}

template <class Contact>
TETHER_INLINE const BodyState& second(const BodyArrays& s, const Contact& c) {
  return *(c.second < 0 ? s.fixed - 1 - c.second : s.state + c.second);
}

TETHER_INLINE void add(Squares& sum, double square, double share) {
  square /= share * share;
  sum.sum += square;
  sum.most = square > sum.most ? square : sum.most;
}

}  // namespace
}  // namespace tether::contact::detail
