// Tether: objects of SUNDIALS with an owner. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <new>
#include <sundials/sundials_nvector.h>
#include <type_traits>

namespace tether::ida_projection {

template <auto Function>
struct FreeBy {
  template <class Object>
  void operator()(Object* object) const {
    Function(object);
  }
};
/// An object that `Free` takes back, e.g. Owned<SUNMatrix, SUNMatDestroy>.
template <class Pointer, auto Free>
using Owned = std::unique_ptr<std::remove_pointer_t<Pointer>, FreeBy<Free>>;

/// Whether the vector is one array in the memory of this process.
bool is_contiguous(N_Vector v);

/// An N_Vector owned by the plugin; null when empty.
class OwnedVector : public Owned<N_Vector, N_VDestroy> {
 public:
  OwnedVector() = default;
  /// Throws std::bad_alloc where the vector cannot be cloned.
  explicit OwnedVector(N_Vector like) {
    if (like == nullptr) return;
    reset(like->ops->nvclone(like));  // N_VClone writes into what it gets, null or not
    if (get() == nullptr) throw std::bad_alloc();
    get()->sunctx = like->sunctx;
  }
  operator N_Vector() const { return get(); }
};

/// Its entries; null of null.
inline OwnedVector copy_of(N_Vector v) {
  OwnedVector copy(v);
  if (copy) N_VScale(1.0, v, copy);
  return copy;
}

}  // namespace tether::ida_projection
