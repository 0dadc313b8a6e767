// Tether: contacts as all ranks know them. SPDX-License-Identifier: BSD-3-Clause
#include <stdexcept>
#include <string>
#include <tether/contact/ranks.hpp>

#include "body_passes/given_problem.hpp"
#include "law/interface/law.hpp"
#include "problem/refuse.hpp"

namespace tether::contact {

std::uint8_t rank_traits(std::size_t number, const RigidBody& body) {
  detail::check(number, body);
  return detail::body_traits(body);
}

RankContact rank_contact(std::size_t number, const PointContact& c,
                         const std::vector<std::uint8_t>& traits, Law law) {
  detail::check(number, c, static_cast<int>(traits.size()));
  const detail::MovingPair pair = detail::moving_pair(c, traits, detail::traits(law).friction);
  if (pair.first < 0) detail::refuse_fixed(number);
  RankContact out;
  out.first = pair.first;
  out.second = pair.second;
  if (pair.second < 0) out.fixed = pair.exchanged ? c.first : c.second;
  out.kind = static_cast<std::uint8_t>(pair.kind);
  return out;
}

}  // namespace tether::contact
