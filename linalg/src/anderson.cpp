// Tether: Anderson acceleration of a fixed-point map. SPDX-License-Identifier: BSD-3-Clause
#include <tether/linalg/anderson.hpp>

#include <algorithm>
#include <cmath>

namespace tether::linalg {

void Anderson::reset(int size, int depth) {
  size_ = size;
  depth_ = depth;
  if (df_.size() < at(depth)) {
    df_.resize(at(depth));
    dg_.resize(at(depth));
  }
  for (int k = 0; k < depth; ++k) {
    df_[at(k)].resize(at(size));
    dg_[at(k)].resize(at(size));
  }
  f_.resize(at(size));
  g_.resize(at(size));
  next_ = 0;
  clear();
}

void Anderson::step(const PackedVector* g, const PackedVector* f, PackedVector* x) {
  const int n = 4 * size_;
  const double* gv = g->v;
  const double* fv = f->v;
  if (primed_) {
    double* a = df_[at(next_)].data()->v;
    double* b = dg_[at(next_)].data()->v;
    const double* fo = f_.data()->v;
    const double* go = g_.data()->v;
    for (int i = 0; i < n; ++i) {
      a[i] = fv[i] - fo[i];
      b[i] = gv[i] - go[i];
    }
    count_ = std::min(count_ + 1, depth_);
    for (int k = 0; k < count_; ++k) {
      gram_[next_][k] = gram_[k][next_] = dot(a, df(k), n);
    }
    next_ = (next_ + 1) % depth_;
  } else {
    next_ = 0;
  }
  std::copy(g, g + size_, g_.begin());
  std::copy(f, f + size_, f_.begin());
  std::copy(g, g + size_, x);
  primed_ = true;
  if (count_ == 0) return;

  // Normalised columns and 1e-11 on the diagonal: pivots of Cholesky's factors are above 1e-11.
  double scale[kMaxDepth], R[kMaxDepth][kMaxDepth], y[kMaxDepth];
  bool keep[kMaxDepth];
  for (int k = 0; k < count_; ++k) {
    scale[k] = gram_[k][k] > 0 ? 1 / std::sqrt(gram_[k][k]) : 0;
    y[k] = scale[k] * dot(df(k), fv, n);
  }
  for (int k = 0; k < count_; ++k) {
    for (int j = 0; j <= k; ++j) {
      double sum = gram_[k][j] * scale[k] * scale[j] + (j == k ? 1e-11 : 0);
      for (int m = 0; m < j; ++m)
        if (keep[m]) sum -= R[k][m] * R[j][m];
      if (j < k) {
        R[k][j] = keep[j] ? sum / R[j][j] : 0;
      } else {
        keep[k] = scale[k] > 0 && sum > 0;
        R[k][k] = keep[k] ? std::sqrt(sum) : 1;
      }
    }
  }
  for (int k = 0; k < count_; ++k) {
    for (int m = 0; m < k; ++m)
      if (keep[m]) y[k] -= R[k][m] * y[m];
    y[k] = keep[k] ? y[k] / R[k][k] : 0;
  }
  for (int k = count_; k-- > 0;) {
    if (!keep[k]) continue;
    for (int m = k + 1; m < count_; ++m)
      if (keep[m]) y[k] -= R[m][k] * y[m];
    y[k] /= R[k][k];
  }
  for (int k = 0; k < count_; ++k) {
    if (keep[k]) axpy(-y[k] * scale[k], dg_[at(k)].data()->v, x->v, n);
  }
}

}  // namespace tether::linalg
