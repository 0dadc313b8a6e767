// Tether: how materials meet. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/meetings.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

namespace tether::contact::detail {

Meetings::Meetings(std::vector<Meeting> meetings) : list_(std::move(meetings)) {
  for (const Meeting& m : list_) {
    if (m.first < 0 || m.second < 0 || !(m.friction >= 0) || !std::isfinite(m.friction) ||
        !(m.restitution >= 0 && m.restitution <= 1))
      throw std::invalid_argument(
          "meeting: materials must be >= 0, friction >= 0 and finite, restitution 0 .. 1");
    if (!(m.rolling >= 0 && m.torsional >= 0) || !std::isfinite(m.rolling + m.torsional))
      throw std::invalid_argument("meeting: rolling and torsional must be >= 0 and finite");
    pairs_.push_back({std::min(m.first, m.second), std::max(m.first, m.second),
                      static_cast<int>(pairs_.size())});
  }
  std::sort(pairs_.begin(), pairs_.end());
}

int Meetings::find(int first, int second) const {
  const std::array<int, 3> last{std::min(first, second), std::max(first, second),
                                std::numeric_limits<int>::max()};
  const auto after = std::upper_bound(pairs_.begin(), pairs_.end(), last);
  if (after == pairs_.begin()) return -1;
  const std::array<int, 3>& found = after[-1];
  return found[0] == last[0] && found[1] == last[1] ? found[2] : -1;
}

}  // namespace tether::contact::detail
