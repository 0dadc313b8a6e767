// Tether: operations on serial vectors with the bits of SUNDIALS' own.
// SPDX-License-Identifier: BSD-3-Clause
//
// Compiled without contraction to fused multiply-adds and without -ffast-math: bits count.
#include "kernels.hpp"

#include <nvector/nvector_serial.h>

#include <array>
#include <cmath>
#include <cstring>
#include <tether/linalg/vector_code.hpp>
#include <utility>

namespace tether::ida_projection::fast {

namespace {

N_VectorContent_Serial content(N_Vector v) {
  return static_cast<N_VectorContent_Serial>(v->content);
}
double* data(N_Vector v) { return content(v)->data; }

using Pair = double __attribute__((vector_size(16)));
Pair pair_at(const double* x) {
  Pair pair;
  std::memcpy(&pair, x, sizeof pair);
  return pair;
}
// Reads one element, or two.
struct One {
  static double at(const double* x) { return *x; }
};
struct Two {
  static Pair at(const double* x) { return pair_at(x); }
};
double where_positive(double mask, double x) { return mask > 0.0 ? x : 0.0; }
Pair where_positive(Pair mask, Pair x) {
  using Bits = long long __attribute__((vector_size(16)));
  return reinterpret_cast<Pair>((mask > Pair{0.0, 0.0}) & reinterpret_cast<Bits>(x));
}

/// The kernels for vectors of one length, or of any (Length 0).
template <int Length>
struct Kernels {
  static sunindextype length(N_Vector v) { return Length > 0 ? Length : content(v)->length; }

  template <class Function>
  static void each(N_Vector Z, Function f) {
    const sunindextype n = length(Z);
    double* z = data(Z);
    TETHER_ELEMENTWISE
    for (sunindextype i = 0; i < n; ++i) z[i] = f(i);
  }
  /// Terms f(how to read, i) two at a time, their sum from the first to the last.
  template <class Function>
  static double sum(N_Vector X, Function f) {
    const sunindextype n = length(X);
    double total = 0.0;
    sunindextype i = 0;
    for (; i + 1 < n; i += 2) {
      const Pair two = f(Two(), i);
      total += two[0];
      total += two[1];
    }
    if (i < n) total += f(One(), i);
    return total;
  }

  /// a x + b y as SUNDIALS rounds it.
  static void linear_sum(sunrealtype a, N_Vector X, sunrealtype b, N_Vector Y, N_Vector Z) {
    const double *x = data(X), *y = data(Y);
    if (b == 1.0)
      each(Z, [=](auto i) { return a * x[i] + y[i]; });
    else if (a == 1.0)
      each(Z, [=](auto i) { return x[i] + b * y[i]; });
    else if (a == b && a != -1.0)
      each(Z, [=](auto i) { return a * (x[i] + y[i]); });
    else if (a == -b)
      each(Z, [=](auto i) { return a * (x[i] - y[i]); });
    else
      each(Z, [=](auto i) { return a * x[i] + b * y[i]; });
  }
  static int linear_sums(int count, sunrealtype a, N_Vector* X, sunrealtype b, N_Vector* Y,
                         N_Vector* Z) {
    if (a == 1.0 && b == 1.0)
      for (int k = 0; k < count; ++k)
        each(Z[k], [x = data(X[k]), y = data(Y[k])](auto i) { return x[i] + y[i]; });
    else
      for (int k = 0; k < count; ++k) linear_sum(a, X[k], b, Y[k], Z[k]);
    return 0;
  }
  static void constant(sunrealtype c, N_Vector Z) {
    each(Z, [=](auto) { return c; });
  }
  static void scale(sunrealtype c, N_Vector X, N_Vector Z) {
    each(Z, [=, x = data(X)](auto i) { return c * x[i]; });
  }
  static void absolute(N_Vector X, N_Vector Z) {
    each(Z, [x = data(X)](auto i) { return std::abs(x[i]); });
  }
  static void inverse(N_Vector X, N_Vector Z) {
    each(Z, [x = data(X)](auto i) { return 1.0 / x[i]; });
  }
  static void add_constant(N_Vector X, sunrealtype b, N_Vector Z) {
    each(Z, [=, x = data(X)](auto i) { return x[i] + b; });
  }

  static sunrealtype wrms_norm(N_Vector X, N_Vector W) {
    return mean_root(X, sum(X, [x = data(X), w = data(W)](auto read, auto i) {
                       const auto share = read.at(x + i) * read.at(w + i);
                       return share * share;
                     }));
  }
  // Masked elements add 0, which changes no sum of squares.
  static sunrealtype wrms_norm_mask(N_Vector X, N_Vector W, N_Vector Mask) {
    return mean_root(X, sum(X, [x = data(X), w = data(W), m = data(Mask)](auto read, auto i) {
                       const auto share = read.at(x + i) * read.at(w + i);
                       return where_positive(read.at(m + i), share * share);
                     }));
  }
  // SUNRsqrt: 0 for what is negative; what is no number stays none.
  static double mean_root(N_Vector X, double squares) {
    const double mean = squares / static_cast<double>(length(X));
    return mean <= 0.0 ? 0.0 : std::sqrt(mean);
  }

  /// Size elements from `first` on, two at a time.
  template <int Size>
  static void combine(int count, const double* c, N_Vector* X, double* z, sunindextype first) {
    constexpr int kPairs = Size / 2;
    Pair sum[kPairs + 1];
    double last = 0.0;
    const double* x = data(X[0]) + first;
    for (int i = 0; i < kPairs; ++i) sum[i] = Pair{c[0], c[0]} * pair_at(x + 2 * i);
    if (Size % 2) last = c[0] * x[Size - 1];
    for (int k = 1; k < count; ++k) {
      x = data(X[k]) + first;
      for (int i = 0; i < kPairs; ++i) sum[i] += Pair{c[k], c[k]} * pair_at(x + 2 * i);
      if (Size % 2) last += c[k] * x[Size - 1];
    }
    z += first;
#pragma GCC unroll 8
    for (int i = 0; i < kPairs; ++i) std::memcpy(z + 2 * i, &sum[i], sizeof(Pair));
    if (Size % 2) z[Size - 1] = last;
  }

  // As the N_VScale and N_VLinearSum that SUNDIALS uses where this operation is not there.
  static int linear_combination(int count, sunrealtype* c, N_Vector* X, N_Vector Z) {
    double* z = data(Z);
    if constexpr (Length > 0) {
      combine<Length>(count, c, X, z, 0);
    } else {
      const sunindextype n = length(Z);
      sunindextype first = 0;
      for (; first + 8 <= n; first += 8) combine<8>(count, c, X, z, first);
      for (; first < n; ++first) combine<1>(count, c, X, z, first);
    }
    return 0;
  }

  // The same for results whose arguments get these operations, too.
  static void spread(N_Vector X) {
    if (X->ops->nvlinearsum != linear_sum) quicken({X}, false);
  }
  static int combination_of_others(int count, sunrealtype* c, N_Vector* X, N_Vector Z) {
    for (int k = 0; k < count; ++k) spread(X[k]);
    return linear_combination(count, c, X, Z);
  }
  static void scale_of_other(sunrealtype c, N_Vector X, N_Vector Z) {
    spread(X);
    scale(c, X, Z);
  }
  static void inverse_of_other(N_Vector X, N_Vector Z) {
    spread(X);
    inverse(X, Z);
  }

  static void install(N_Vector_Ops ops, bool spreading) {
    ops->nvlinearsum = linear_sum;
    ops->nvconst = constant;
    ops->nvscale = scale;
    ops->nvabs = absolute;
    ops->nvinv = inverse;
    ops->nvaddconst = add_constant;
    ops->nvwrmsnorm = wrms_norm;
    ops->nvwrmsnormmask = wrms_norm_mask;
    if (!ops->nvlinearcombination) ops->nvlinearcombination = linear_combination;
    if (!ops->nvlinearsumvectorarray) ops->nvlinearsumvectorarray = linear_sums;
    if (!spreading) return;
    ops->nvlinearcombination = combination_of_others;
    ops->nvscale = scale_of_other;
    ops->nvinv = inverse_of_other;
  }
};

template <int... Lengths>
constexpr auto install_sized(std::integer_sequence<int, Lengths...>) {
  return std::array{Kernels<Lengths>::install...};
}

}  // namespace

void install_kernels(N_Vector_Ops ops, sunindextype length, bool spreading) {
  static constexpr auto install = install_sized(std::make_integer_sequence<int, kSized + 1>());
  install[static_cast<std::size_t>(length <= kSized ? length : 0)](ops, spreading);
}

}  // namespace tether::ida_projection::fast
