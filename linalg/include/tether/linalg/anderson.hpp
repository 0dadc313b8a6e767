// Tether: Anderson acceleration of a fixed-point map. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/export.hpp>
#include <tether/linalg/block3.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::linalg {

/// Anderson's acceleration of x = G(x), type II. With g = G(x) and the (weighted) residual f of x,
/// the next point is g - sum gamma_k dg_k, gamma = argmin |f - sum gamma_k df_k| over the last
/// `depth` differences. The Gram matrix is kept, so that a step costs 2 depth dots and depth axpys.
class Anderson {
 public:
  static constexpr int kMaxDepth = 20;  ///< largest depth

  /// For x of `size` vectors of three and the last `depth` differences, 1 to kMaxDepth. Allocates;
  /// forgets the differences.
  void reset(int size, int depth);
  /// Forgets the differences; keeps the storage.
  void clear() {
    count_ = 0;
    primed_ = false;
  }
  /// x <- accelerated point (g on the first call after clear()). All have reset()'s size.
  void step(const PackedVector* g, const PackedVector* f, PackedVector* x);

 private:
  const double* df(int k) const { return df_[at(k)].data()->v; }
  int size_ = 0, depth_ = 0, count_ = 0, next_ = 0;
  bool primed_ = false;
  std::vector<PackedVectors> df_, dg_;
  PackedVectors f_, g_;
  double gram_[kMaxDepth][kMaxDepth];
};

}  // namespace tether::linalg
TETHER_EXPORT_END
