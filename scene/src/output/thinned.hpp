// Tether: a bounded number of records over a run of any length. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <algorithm>
#include <limits>
#include <optional>
#include <tether/scene/engine.hpp>

namespace tether::scene {

/// Keeps records, which have diagnostics d and a number of bytes(). Where there are more than fit,
/// every second one goes; its errors count for the one before it.
template <class Record>
class Thinned {
 public:
  explicit Thinned(std::size_t most,
                   std::size_t most_bytes = std::numeric_limits<std::size_t>::max())
      : most_(most), most_bytes_(most_bytes) {}

  void add(Record now) {
    last_.reset();
    if (seen_++ % stride_ != 0) {
      take_errors(all_.back(), now);
      last_ = std::move(now);
      return;
    }
    bytes_ += now.bytes();
    all_.push_back(std::move(now));
    if (all_.size() > most_ || (bytes_ > most_bytes_ && all_.size() > 2)) halve();
  }

  /// The last record is kept, whatever went before.
  void finish() {
    if (last_) all_.push_back(std::move(*last_));
    last_.reset();
  }

  const std::vector<Record>& all() const { return all_; }

 private:
  static void take_errors(Record& kept, const Record& other) {
    kept.d.drift = std::max(kept.d.drift, other.d.drift);
    kept.d.penetration = std::max(kept.d.penetration, other.d.penetration);
    kept.d.residual = std::max(kept.d.residual, other.d.residual);
  }

  void halve() {
    std::vector<Record> half;
    for (std::size_t i = 0; i < all_.size(); ++i)
      if (i % 2 == 0)
        half.push_back(std::move(all_[i]));
      else
        take_errors(half.back(), all_[i]);
    if (all_.size() % 2 == 0) last_ = std::move(all_.back());  // it may be the end
    all_ = std::move(half);
    stride_ *= 2;
    bytes_ = 0;
    for (const Record& each : all_) bytes_ += each.bytes();
  }

  std::size_t most_, most_bytes_, bytes_ = 0, stride_ = 1, seen_ = 0;
  std::vector<Record> all_;
  std::optional<Record> last_;  // where it is not kept
};

}  // namespace tether::scene
