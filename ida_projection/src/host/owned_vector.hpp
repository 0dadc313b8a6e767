// Tether: an N_Vector with an owner. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <new>
#include <sundials/sundials_nvector.h>
#include <utility>

namespace tether::ida_projection {

/// Is this vector contiguous and whole in this process's memory?
bool is_contiguous(N_Vector v);

/// An N_Vector owned by the plugin; null when empty.
class OwnedVector {
 public:
  OwnedVector() = default;
  /// Throws std::bad_alloc where the vector cannot be cloned.
  explicit OwnedVector(N_Vector like) {
    if (like == nullptr) return;
    // N_VClone writes into what it gets, null or not.
    v_ = like->ops->nvclone(like);
    if (v_ == nullptr) throw std::bad_alloc();
    v_->sunctx = like->sunctx;
  }
  ~OwnedVector() {
    if (v_ != nullptr) N_VDestroy(v_);
  }
  OwnedVector(OwnedVector&& other) noexcept : v_(std::exchange(other.v_, nullptr)) {}
  OwnedVector& operator=(OwnedVector&& other) noexcept {
    std::swap(v_, other.v_);
    return *this;
  }
  OwnedVector(const OwnedVector&) = delete;
  OwnedVector& operator=(const OwnedVector&) = delete;
  operator N_Vector() const { return v_; }

 private:
  N_Vector v_ = nullptr;
};

}  // namespace tether::ida_projection
