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

// Lists of contacts hardly change between steps: an id is first looked for after the one found
// before. The hash table is built only when that fails. Keeps its storage.
class ImpulseMemory {
 public:
  static constexpr std::uint64_t kNoId = ~std::uint64_t{0};

  void clear() {
    ids_.clear();
    impulses_.clear();
    rewind();
  }
  void scale(double factor) {
    for (Eigen::Vector3d& p : impulses_) p *= factor;
  }

  const std::vector<std::uint64_t>& ids() const { return ids_; }
  const std::vector<Eigen::Vector3d>& impulses() const { return impulses_; }
  bool empty() const { return ids_.empty(); }
  // Before a run of find().
  void rewind() {
    next_ = 0;
    mask_ = 0;
  }

  const Eigen::Vector3d* find(std::uint64_t id) {
    if (ids_.empty() || id == kNoId) return nullptr;
    if (next_ < ids_.size() && ids_[next_] == id) return &impulses_[next_++];
    if (mask_ == 0) index();
    for (std::size_t k = hash(id);; k = (k + 1) & mask_) {
      if (table_[k] == kEmpty) return nullptr;
      if (ids_[table_[k]] == id) {
        next_ = table_[k] + 1;
        return &impulses_[next_ - 1];
      }
    }
  }

  // After clear(): a new list.
  void add(std::uint64_t id, const Eigen::Vector3d& impulse) {
    if (id == kNoId) return;
    ids_.push_back(id);
    impulses_.push_back(impulse);
  }

 private:
  static constexpr std::uint32_t kEmpty = std::numeric_limits<std::uint32_t>::max();

  std::size_t hash(std::uint64_t id) const {
    id ^= id >> 32;
    id *= 0x9e3779b97f4a7c15u;
    return static_cast<std::size_t>(id >> 29) & mask_;
  }
  void index() {
    std::size_t size = 16;
    while (size < 2 * ids_.size()) size *= 2;
    mask_ = size - 1;
    table_.assign(size, kEmpty);
    for (std::size_t i = 0; i < ids_.size(); ++i) {
      std::size_t k = hash(ids_[i]);
      while (table_[k] != kEmpty) k = (k + 1) & mask_;
      table_[k] = static_cast<std::uint32_t>(i);
    }
  }

  std::vector<std::uint64_t> ids_;
  std::vector<Eigen::Vector3d> impulses_;
  std::vector<std::uint32_t> table_;
  std::size_t next_ = 0, mask_ = 0;  // 0: not indexed
};

// The impulses of the last solve, and of the one before it, so that the last one can be taken back.
class ImpulseHistory {
 public:
  bool empty() const { return last_.empty(); }
  // find() in the order of the contacts of this solve, after rewind().
  void rewind() { last_.rewind(); }
  const Eigen::Vector3d* find(std::uint64_t id) { return last_.find(id); }
  // After a solve: its impulses.
  void keep(const std::vector<PointContact>& contacts, const std::vector<Eigen::Vector3d>& p) {
    std::swap(last_, before_);
    last_.clear();
    for (std::size_t i = 0; i < contacts.size(); ++i) last_.add(contacts[i].id, p[i]);
  }
  void add(std::uint64_t id, const Eigen::Vector3d& impulse) { last_.add(id, impulse); }

  void take_back() { std::swap(last_, before_); }
  void scale(double factor) { last_.scale(factor); }
  void forget() { last_.clear(); }
  void get(WarmStart& out) const {
    out.ids = last_.ids();
    out.impulses = last_.impulses();
  }
  void set(const WarmStart& start) {
    last_.clear();
    for (std::size_t i = 0; i < start.ids.size(); ++i) last_.add(start.ids[i], start.impulses[i]);
  }

 private:
  ImpulseMemory last_, before_;
};

}  // namespace tether::contact::detail
