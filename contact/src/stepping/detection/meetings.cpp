// Tether: how materials meet. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/meetings.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <tether/linalg/index.hpp>
#include <tuple>
#include <utility>

namespace tether::contact::detail {

namespace {
using linalg::at;
}  // namespace

Meetings::Meetings(std::vector<Meeting> meetings) : list_(std::move(meetings)) {
  for (const Meeting& m : list_) {
    if (m.first < 0 || m.second < 0 || !(m.friction >= 0) || !std::isfinite(m.friction) ||
        !(m.restitution >= 0 && m.restitution <= 1))
      throw std::invalid_argument(
          "meeting: materials must be >= 0, friction >= 0 and finite, restitution 0 .. 1");
    if (!(m.rolling >= 0 && m.torsional >= 0) || !std::isfinite(m.rolling + m.torsional))
      throw std::invalid_argument("meeting: rolling and torsional must be >= 0 and finite");
    materials_.insert(materials_.end(), {m.first, m.second});
  }
  std::sort(materials_.begin(), materials_.end());
  materials_.erase(std::unique(materials_.begin(), materials_.end()), materials_.end());

  struct Entry {
    int row, other, meeting;
  };
  std::vector<Entry> entries;
  for (std::size_t k = 0; k < list_.size(); ++k) {
    const int a = row(list_[k].first), b = row(list_[k].second), meeting = static_cast<int>(k);
    entries.push_back({a, b, meeting});
    if (a != b) entries.push_back({b, a, meeting});
  }
  std::sort(entries.begin(), entries.end(), [](const Entry& p, const Entry& q) {
    return std::tie(p.row, p.other, p.meeting) < std::tie(q.row, q.other, q.meeting);
  });
  start_.assign(materials_.size() + 1, 0);
  for (std::size_t k = 0; k < entries.size(); ++k) {
    const Entry& e = entries[k];
    if (k + 1 < entries.size() && entries[k + 1].row == e.row && entries[k + 1].other == e.other)
      continue;
    partners_.push_back({e.other, e.meeting});
    start_[at(e.row) + 1] = partners_.size();
  }
}

int Meetings::row(int material) const {
  const auto found = std::lower_bound(materials_.begin(), materials_.end(), material);
  return found != materials_.end() && *found == material
             ? static_cast<int>(found - materials_.begin())
             : -1;
}

int Meetings::find(int row, int other) const {
  if (row < 0 || other < 0) return -1;
  const auto begin = partners_.begin() + static_cast<std::ptrdiff_t>(start_[at(row)]);
  const auto end = partners_.begin() + static_cast<std::ptrdiff_t>(start_[at(row) + 1]);
  const auto found =
      std::lower_bound(begin, end, other, [](const Partner& p, int o) { return p.other < o; });
  return found != end && found->other == other ? found->meeting : -1;
}

}  // namespace tether::contact::detail
