// Tether: impulses of the previous solve, found by contact id. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <tether/contact/body_solver.hpp>
#include <utility>
#include <vector>

namespace tether::contact::detail {

// The impulses of the last solve, and of the one before it, so that the last one can be taken back.
// Lists of contacts hardly change between steps: an id is first looked for after the one found
// before. The hash table is built only when that fails. Keeps its storage.
class ImpulseMemory {
 public:
  bool empty() const { return last_.ids.empty(); }
  // Before a run of find().
  void rewind() {
    next_ = 0;
    mask_ = 0;
  }
  const Eigen::Vector3d* find(std::uint64_t id) {
    const std::vector<std::uint64_t>& ids = last_.ids;
    if (ids.empty() || id == kNoId) return nullptr;
    if (next_ < ids.size() && ids[next_] == id) return &last_.impulses[next_++];
    if (mask_ == 0) index();
    for (std::size_t k = hash(id);; k = (k + 1) & mask_) {
      if (table_[k] == kEmpty) return nullptr;
      if (ids[table_[k]] == id) {
        next_ = table_[k] + 1;
        return &last_.impulses[next_ - 1];
      }
    }
  }
  // After a solve: its impulses.
  void keep(const std::vector<PointContact>& contacts, const std::vector<Eigen::Vector3d>& p) {
    std::swap(last_, before_);
    forget();
    for (std::size_t i = 0; i < contacts.size(); ++i) add(contacts[i].id, p[i]);
  }
  void add(std::uint64_t id, const Eigen::Vector3d& impulse) {
    if (id == kNoId) return;
    last_.ids.push_back(id);
    last_.impulses.push_back(impulse);
  }
  void take_back() { std::swap(last_, before_); }
  void scale(double factor) {
    for (Eigen::Vector3d& p : last_.impulses) p *= factor;
  }
  void forget() {
    last_.ids.clear();
    last_.impulses.clear();
  }
  const WarmStart& last() const { return last_; }
  void set(const WarmStart& start) {
    forget();
    for (std::size_t i = 0; i < start.ids.size(); ++i) add(start.ids[i], start.impulses[i]);
  }

 private:
  static constexpr std::uint64_t kNoId = std::numeric_limits<std::uint64_t>::max();
  static constexpr std::uint32_t kEmpty = std::numeric_limits<std::uint32_t>::max();
  std::size_t hash(std::uint64_t id) const {
    id ^= id >> 32;
    id *= 0x9e3779b97f4a7c15u;
    return static_cast<std::size_t>(id >> 29) & mask_;
  }
  void index() {
    std::size_t size = 16;
    while (size < 2 * last_.ids.size()) size *= 2;
    mask_ = size - 1;
    table_.assign(size, kEmpty);
    for (std::size_t i = 0; i < last_.ids.size(); ++i) {
      std::size_t k = hash(last_.ids[i]);
      while (table_[k] != kEmpty) k = (k + 1) & mask_;
      table_[k] = static_cast<std::uint32_t>(i);
    }
  }

  WarmStart last_, before_;
  std::vector<std::uint32_t> table_;
  std::size_t next_ = 0, mask_ = 0;  // 0: not indexed
};

}  // namespace tether::contact::detail
